"""Agents with OSWorld's interface (`mm_agents`), as our agents.

They have `predict(instruction, obs)` with a PNG in `obs["screenshot"]`, and `reset()`, which some
call with a logger. Their actions are code, words or dicts.

    class MyAgent(OsworldAgent):
        wrapped = PromptAgent             # a class or a function: made anew for each episode
"""

import inspect
import json
import logging
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from hijack_data.errors import ParameterError, ParameterTypeError
from hijack_data.png import encode

from ..base import Observation
from .action_codes import read_osworld_codes

# The values of `observation_type` of agents that read the accessibility tree.
TREES = ("a11y_tree", "som")


class OsworldAgent:
    """Wraps an agent with OSWorld's interface.

    The agent gets the screenshot as PNG bytes and an empty accessibility tree. An action that
    cannot be read is passed on as a malformed one.

    Args:
        agent: The agent, or a class or function that returns one; `wrapped` if omitted.

    Raises:
        ParameterError: There is no agent, or it reads the accessibility tree.
        ParameterTypeError: The agent has no `predict`.
    """

    # A class or function without parameters, called once per episode, or one object for all
    # episodes.
    wrapped: ClassVar[Any] = None

    def __init__(self, agent: Any = None) -> None:
        if agent is None:
            agent = _attribute(type(self), "wrapped")
        if agent is None:
            name = type(self).__name__
            raise ParameterError(f"{name} wraps no agent; give it a class attribute `wrapped`")
        self.agent = _made(agent)

    def reset(self) -> None:
        """Begin a new episode; an agent without `reset` has nothing to forget."""
        reset = getattr(self.agent, "reset", None)
        if reset is not None:
            reset(*_loggers(reset))

    def predict(self, instruction: str, obs: Observation) -> tuple[str, Sequence[str]]:
        """Return the agent's words and its actions as code.

        Raises:
            ParameterTypeError: The agent returned neither a pair nor a longer tuple.
        """
        picture = obs["screenshot"]
        size = picture.shape[:2]
        png = encode(picture)
        answer = self.agent.predict(instruction, {"screenshot": png, "accessibility_tree": ""})
        if not isinstance(answer, tuple | list) or len(answer) < 2:
            raise ParameterTypeError(
                f"predict must return (response, actions), got {answer!r:.200}"
            )
        codes: list[str] = []
        for action in _listed(answer[1]):
            codes += read_osworld_codes(action, size)
        return _words(answer[0]), codes


def _attribute(cls: type, name: str) -> Any:
    """Return a class attribute unbound, so that a function does not become a method."""
    found = inspect.getattr_static(cls, name)
    if isinstance(found, staticmethod):
        return found.__func__
    return found


def _made(agent: Any) -> Any:
    if isinstance(agent, type) or not hasattr(agent, "predict"):
        if not callable(agent):
            raise ParameterTypeError(f"{agent!r:.80} has no predict(instruction, obs)")
        agent = agent()
    if not callable(getattr(agent, "predict", None)):
        raise ParameterTypeError(f"{type(agent).__name__} has no predict(instruction, obs)")
    wanted = getattr(agent, "observation_type", None)
    if isinstance(wanted, str) and any(tree in wanted for tree in TREES):
        raise ParameterError(
            f"{type(agent).__name__} has observation_type {wanted!r}, and agents see the screen"
            " only; make it with observation_type='screenshot'"
        )
    return agent


def _loggers(reset: Any) -> list[logging.Logger]:
    """Return the logger, if `reset` cannot be called without."""
    try:
        parameters = inspect.signature(reset).parameters.values()
    except (TypeError, ValueError):  # a class implemented in C has no signature
        return []
    positional = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    needed = [
        parameter.name
        for parameter in parameters
        if parameter.kind in positional and parameter.default is inspect.Parameter.empty
    ]
    if not needed:
        return []
    if len(needed) > 1 or "logger" not in needed[0]:
        raise ParameterTypeError(
            f"reset needs {', '.join(needed)}; only a logger can be given, give the rest defaults"
        )
    return [logging.getLogger("desktopenv.agent")]


def _listed(actions: Any) -> list[Any]:
    if actions is None:
        return []
    if isinstance(actions, str | Mapping):
        return [actions]
    return list(actions)


def _words(response: Any) -> str:
    if response is None:
        return ""
    if isinstance(response, str):
        return response
    return json.dumps(response, default=str, ensure_ascii=False)
