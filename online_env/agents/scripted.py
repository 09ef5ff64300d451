"""An agent that plays a list of actions, for trying a task, a corruption or a change.

The list is YAML or JSON: actions in the form of an agent's answers, in order.

    - pyautogui.click(100, 200)
    - pyautogui.write('hello')
    - DONE

`AGENTHIJACK_SCRIPT=FILE` names it for the agent `scripted`. A class of your own names it itself,
relative to its own file, and then a run also records your file:

    class Mine(Scripted):
        script = "actions.yaml"
"""

import hashlib
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar, cast

import yaml

from hijack_data.actions import read_action
from hijack_data.errors import ActionError, ConfigError, ParameterError

from .base import DONE, Observation

VARIABLE = "AGENTHIJACK_SCRIPT"


class Scripted:
    """Plays the actions of a file, one per step, whatever it sees; then it answers `DONE`.

    Raises:
        ParameterError: no file is named.
        ConfigError: the file holds no list of actions; the message has all mistakes.
    """

    script: ClassVar[str | None] = None

    def __init__(self) -> None:
        self._actions = read_script(self._file())
        self._step = 0

    def reset(self) -> None:
        """Begin with the first action again."""
        self._step = 0

    def predict(self, instruction: str, obs: Observation) -> tuple[str, Sequence[str]]:
        """Return the next action of the file."""
        step = self._step
        self._step += 1
        if step >= len(self._actions):
            return "That was all.", [DONE]
        return f"Action {step + 1} of {len(self._actions)}.", [self._actions[step]]

    @classmethod
    def settings(cls) -> dict[str, str]:
        """Return what a run records of this agent: the file and its SHA-256."""
        file = cls._file()
        return {"script": str(file), "sha256": hashlib.sha256(_read(file)).hexdigest()}

    @classmethod
    def _file(cls) -> Path:
        if cls.script:  # beside the file of the class, whose process has a folder of its own
            module = getattr(sys.modules.get(cls.__module__), "__file__", None) or ""
            return Path(module).parent / Path(cls.script).expanduser()
        name = os.environ.get(VARIABLE)
        if not name:
            raise ParameterError(
                f"the agent 'scripted' plays a file of actions: name it with {VARIABLE}=FILE.yaml"
            )
        return Path(name).expanduser()


def read_script(file: Path) -> tuple[str, ...]:
    """Return the actions of a file; code is limited as for agents, see `read_action`.

    Raises:
        ConfigError: the file cannot be read, is not a list, or holds an item that is not an action.
    """
    text = _read(file)
    try:
        data: object = json.loads(text) if file.suffix == ".json" else yaml.safe_load(text)
    except (ValueError, yaml.YAMLError, RecursionError) as error:
        raise ConfigError([f"{file}: cannot be parsed: {str(error)[:300]}"]) from None
    if not isinstance(data, list) or not data:
        raise ConfigError([f"{file}: must be a list of actions, such as [WAIT, DONE]"])
    problems: list[str] = []
    for number, action in enumerate(cast("list[object]", data), 1):
        try:
            read_action(action)
        except ActionError as error:
            problems.append(f"{file}: action {number}: {error}")
    if problems:
        raise ConfigError(problems)
    return tuple(cast("list[str]", data))


def _read(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise ConfigError([f"{file}: cannot be read ({error.strerror or error})"]) from None
