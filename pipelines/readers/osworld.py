"""Result folders of OSWorld: the first release, OSWorld-Verified, and the paper authors' fork."""

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from hijack_data.errors import HijackError, short_repr
from hijack_data.types import Platform, Step, Trajectory

from . import fields
from .base import Rejected, register
from .fields import FieldError, FieldTypeError, JsonObject
from .folder_reader import EpisodeFolder, FolderReader, folder_id
from .recorded_actions import COMPUTER_13, PYAUTOGUI, RecordedStep, first_action, raw_action_text
from .safe_files import image_size, inside, parse_file, relative_name

RECORDS = "traj.jsonl"
FIRST_SCREENS = ("initial_state.png", "initial_screenshot.png", "step_0.png")
TASK_FILES = ("task.json", "task_config.json", "example.json")
TASK_FOLDERS = ("examples", "evaluation_examples/examples")
WINDOWS = frozenset({"windows", "examples_windows"})
_WORDS = ("WAIT", "FAIL", "DONE")
_FENCE = "```"
_CODE = "import pyautogui"
_LAST_CALL = re.compile(r"pyautogui\.\w+\([^\n]*\)\s*\Z")
_NOT_SAVED = "the screen before the first action was not saved"
_NOT_THERE = "the picture after the action before is not in the folder"
_OBSERVED = "shows what the agent saw, with the run's own corruption"


@register
class OSWorld(FolderReader):
    """Reads result folders of OSWorld.

    Their layout is `<action space>/<observation>/<model>/[<trial>/]<domain>/<task id>/traj.jsonl`
    with the pictures beside it. A source is any folder above, or a `traj.jsonl`; a trajectory's id
    is its path in the source. Each line is an action: `step_num, action, screenshot_file`. An
    action is pyautogui code, a word (WAIT, FAIL, DONE), a `computer_13` dict, or a dict that holds
    the code which was run (`command`, or `action` beside `action_space: pyautogui`).

    OSWorld takes the screenshot AFTER the action, so each step gets the picture of the line before.
    The first has one only if the initial screen was saved (`initial_state.png`, or a line that
    names it), and is rejected otherwise, as is any step after a picture that is missing. Steps are
    numbered by lines, from 1, since `step_num` repeats where one reply held several actions.

    The authors' fork writes `action` as the reply with the code after it, and saves pictures of its
    corrupted runs BEFORE the action, as the agent saw them (`step_N_agent_observe.png`): those are
    not clean and are rejected.

    The folders do not hold the instruction: it is read from the task's JSON in the task folder, or
    in the source under `examples/<domain>/<task id>.json`; without one it is empty, and reported
    once a trajectory.

    Coordinates: pixels of the screen, whose size the screenshots have; a point outside is rejected.
    """

    name = "osworld"
    records = RECORDS
    file_names = (RECORDS,)
    any_name = True

    def beside(self, file: Path) -> bool:
        """Return whether a file may be the JSON of a task."""
        names = (*TASK_FILES, f"{file.parent.name}.json")
        return file.suffix == ".json" and (file.name in names or "examples" in file.parts)

    def episode(self, file: Path, root: Path) -> Iterator[Trajectory | Rejected]:
        """Yield the trajectory of one task folder, and everything rejected of it."""
        return _Episode(root, file).read()


@dataclass
class _Episode(EpisodeFolder):
    """One task folder, while it is read.

    Args:
        actions: actions so far, those without a step included.
        screen: the picture on which the next action is taken; `""` if there is none.
        no_screen: why there is no screen.
        instruction: the task, as the log or the task's JSON gives it.
    """

    actions: int = 0
    screen: str = ""
    no_screen: str = _NOT_SAVED
    instruction: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        saved = (name for name in FIRST_SCREENS if (self.folder / name).is_file())
        self.screen = next(saved, "")

    def read(self) -> Iterator[Trajectory | Rejected]:
        """Yield what is broken, then the trajectory."""
        try:
            inside(self.root, self.records, "")
            yield from self.take_lines()
        except FieldError as error:
            yield Rejected(self.records, "", error.field, error.reason)
            return
        except OSError as error:
            yield self.unreadable(error)
        if not self.actions:
            yield Rejected(self.records, "", "", "holds no step")
        elif self.steps:
            yield from self.trajectory()

    def trajectory(self) -> Iterator[Trajectory | Rejected]:
        """Yield the trajectory, after a broken task file or a missing instruction."""
        parts = relative_name(self.folder, self.root).split("/")
        domain = parts[-2] if len(parts) > 1 else ""
        try:
            task = _task(self.root, self.folder, domain)
            self.instruction = self.instruction or fields.text(task, "instruction", default="")
        except FieldError as error:
            task = {}
            yield Rejected(self.records, "", error.field, error.reason)
        if not self.instruction:
            task_file = f"{TASK_FOLDERS[0]}/{domain or '<domain>'}/{self.folder.name}.json"
            reason = f"not recorded, left empty; put the task's JSON at {task_file}"
            yield Rejected(self.records, "", "instruction", reason)
        yield Trajectory(
            id=folder_id(self.folder, self.root),
            source=OSWorld.name,
            instruction=self.instruction,
            steps=tuple(self.steps),
            domain=domain,
            apps=_apps(task),
            platform=_platform(parts),
        )

    def take(self, record: JsonObject) -> None:
        """Add the step of one line.

        Raises:
            FieldError: the line is broken, or no clean screen goes with its action.
        """
        if "Error" in record:
            raise FieldError("Error", short_repr(record["Error"]))
        if "action" not in record and "initial_state" in record:
            self.screen = fields.text(record, "initial_state")
            self.instruction = fields.text(record, "instruction", default="")
            return
        self.actions += 1
        screen = self.screen
        reason = self.no_screen
        self._advance(record)
        if self._observed(record):
            raise FieldError("screenshot_file", _OBSERVED)
        if not screen:
            raise FieldError("screenshot_file", reason)
        self.steps.append(self._step(record, screen))

    def _step(self, record: JsonObject, screen: str) -> Step:
        image = self.inside(screen, "screenshot_file")
        size = image_size(image, "screenshot_file")
        raw, dialect = _executed(record)
        action = first_action(raw, dialect, size, "action")
        code = raw_action_text(raw, "action")
        return RecordedStep(self.actions, os.fspath(image), action, code, dialect=dialect)

    def _advance(self, record: JsonObject) -> None:
        """Remember the picture after this action."""
        self.screen = ""
        self.no_screen = _NOT_THERE
        name = record.get("screenshot_file")
        if not name:
            name = f"step_{record.get('step_num')}_{record.get('action_timestamp')}.png"
        try:
            if isinstance(name, str) and (self.folder / name).is_file():
                self.screen = name
        except (OSError, ValueError):
            self.no_screen = f"{name!r:.60} is not a path"

    def _observed(self, record: JsonObject) -> bool:
        """Return whether the fork saved the corrupted screen that the agent saw."""
        number = record.get("step_num")
        if not isinstance(number, int):
            return False
        return (self.folder / f"step_{number!s:.12}_agent_observe.png").is_file()


def _executed(record: JsonObject) -> tuple[Any, str]:
    """Return the action of a line and its dialect.

    Raises:
        FieldError: the command is broken.
        FieldTypeError: the action is neither code, a word nor an object.
    """
    action: object = record.get("action")
    if isinstance(action, str):
        code = _after_reply(action) if "summary" in record else action
        return code, PYAUTOGUI
    if not isinstance(action, dict):
        raise FieldTypeError("action", "code, a word or an object", action)
    parts = cast("dict[str, Any]", action)
    command: object = parts.get("command")
    if isinstance(command, str):
        return command, PYAUTOGUI
    code: object = parts.get("action")
    if isinstance(code, str) and parts.get("action_space") == PYAUTOGUI:
        return code, PYAUTOGUI
    if parts.get("action_type") == "tool_use":
        reason = "is missing, so that the point in pixels of the screen is not known"
        raise FieldError("action.command", reason)
    return parts, COMPUTER_13


def _after_reply(text: str) -> str:
    """Return the action that the fork writes right after the model's reply.

    Raises:
        FieldError: neither code nor a word follows the reply.
    """
    for word in _WORDS:
        if text.endswith(word):
            return word
    start = _code_start(text)
    code = text[start:]
    if start < 0 or not code.strip():
        raise FieldError("action", f"no code or word after the reply in {short_repr(text)}")
    return code


def _code_start(text: str) -> int:
    """Return where the code after a reply begins, or -1."""
    start = text.rfind(_CODE)
    if start >= 0:
        return start
    if _FENCE in text:
        return text.rfind(_FENCE) + len(_FENCE)
    call = _LAST_CALL.search(text)
    return call.start() if call else -1


def _apps(task: JsonObject) -> tuple[str, ...]:
    """Return the applications of a task; its snapshot is named after its application."""
    related = fields.strings(task.get("related_apps"))
    return related or fields.strings([task.get("snapshot")])


def _platform(parts: list[str]) -> Platform:
    """Return the machine's platform: Ubuntu, unless a folder is one of the Windows tasks."""
    folders = {part.lower() for part in parts}
    return "windows" if WINDOWS & folders else "linux"


def _task(root: Path, folder: Path, domain: str) -> JsonObject:
    """Return the task's JSON, or an empty mapping if the source does not have it.

    Raises:
        FieldError: the JSON of the task cannot be read.
    """
    for file in _task_files(root, folder, domain):
        if not file.is_file():
            continue
        name = relative_name(file, root)
        try:
            return parse_file(inside(root, name, "instruction"))
        except HijackError as error:
            raise FieldError("instruction", f"{name}: {error}") from None
    return {}


def _task_files(root: Path, folder: Path, domain: str) -> Iterator[Path]:
    """Yield the places where a task's JSON may be, the nearest first."""
    name = f"{folder.resolve().name}.json"
    for beside in (*TASK_FILES, name):
        yield folder / beside
    for base in (folder, *folder.parents):
        if base.is_relative_to(root):
            for task_folder in TASK_FOLDERS:
                yield base / task_folder / domain / name
