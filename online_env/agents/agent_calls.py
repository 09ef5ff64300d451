"""Call an agent, and check and bound what it returns.

Both ways to run an agent use these functions: in a process of its own (`agent_server`) and in a
thread of the runner (`agent_thread`).
"""

import json
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeAlias, cast

from hijack_data.runs.run_log import MAX_TEXT

from .base import Observation

MAX_FRAMES = 30  # the number of innermost frames that are kept of a traceback
MAX_LINE = 500  # characters of a line of a traceback
MAX_PROBLEM = 2000  # characters of the text of an exception
MAX_ACTIONS = 1000  # actions of one answer; an episode has no more steps
MAX_USAGE = 2**20  # characters of JSON, because lines of the journal are limited
NEEDS_TASK = (
    "an agent with prepare(task, machine) gets objects of the runner, which a process of its own"
    " cannot have: use --in-process"
)
_FOLDER = Path(__file__).parent
_OUR_MODULES = ("agent_calls", "agent_server", "agent_thread")
_OURS = frozenset(str(_FOLDER / f"{name}.py") for name in _OUR_MODULES)
_TEXTS = (str, bytes, bytearray)  # sequences, but of no actions
AgentAnswer: TypeAlias = tuple[str, list[object]]


class AgentError(Exception):
    """An agent raised, died, or gave no answer; `frames` lists its frames, innermost last."""

    def __init__(self, problem: str, frames: Sequence[str] = ()) -> None:
        super().__init__(problem)
        self.frames = tuple(frames)


class AgentGoneError(AgentError):
    """An agent whose process has ended, or that still works on an earlier call."""


class InvalidAction:
    """Stands for an action that is no text, and has the `repr` of the agent's object."""

    text = ""

    def __repr__(self) -> str:
        return self.text


@dataclass(frozen=True, kw_only=True)
class AgentTraits:
    """What an agent can do, read once from its object.

    Args:
        kind: the name of its class.
        methods: those of `METHODS` that it has.
        is_privileged: whether it wants the task and the machine.
        uses_plan: whether it wants the plan of the task in words.
        is_deterministic: whether it claims to repeat its answers.
        uses_devtools: whether it wants the address of the browser's DevTools.
    """

    kind: str
    methods: tuple[str, ...]
    is_privileged: bool
    uses_plan: bool
    is_deterministic: bool
    uses_devtools: bool = False


class RunningAgent(Protocol):
    """An agent that is asked, wherever its code runs. Every method raises `AgentError`."""

    @property
    def traits(self) -> AgentTraits:
        """What the agent can do."""
        ...

    @property
    def alive(self) -> bool:
        """Whether it can be asked: its process runs, and no earlier call is unanswered."""
        ...

    def make(self) -> None:
        """Replace the object of the agent by a new one."""
        ...

    def reset(self) -> None:
        """Begin a new episode; an agent without `reset` has nothing to forget."""
        ...

    def predict(self, instruction: str, obs: Observation) -> AgentAnswer:
        """Return the agent's words and actions."""
        ...

    def predict_batch(
        self, instructions: Sequence[str], pictures: Sequence[Any]
    ) -> list[AgentAnswer]:
        """Return the answers to several pictures, uint8 RGB `[H, W, 3]`."""
        ...

    def check(self, picture: Any) -> str | None:
        """Return the reminder of an onlooker, or `None`."""
        ...

    def summarise(self, before: Any, action: str, after: Any) -> str:
        """Return an onlooker's summary of a step."""
        ...

    def follow(self, lines: Sequence[str]) -> None:
        """Give the agent the plan of the task in words."""
        ...

    def connect(self, address: str) -> None:
        """Give the agent the address of the browser's DevTools."""
        ...

    def usage(self) -> dict[str, Any] | None:
        """Return the usage that the agent reports so far; `None` if it reports none."""
        ...

    def close(self) -> None:
        """End the agent; calling this twice is allowed."""
        ...


METHODS = (
    "predict",
    "reset",
    "predict_batch",
    "check",
    "summarise",
    "follow",
    "prepare",
    "connect",
)


def method_names(agent: Any) -> tuple[str, ...]:
    """Return those of `METHODS` that an agent, or its class, has."""
    return tuple(name for name in METHODS if callable(getattr(agent, name, None)))


def read_traits(agent: Any) -> AgentTraits:
    """Return what an agent can do."""
    methods = method_names(agent)
    return AgentTraits(
        kind=type(agent).__name__[:MAX_LINE],
        methods=methods,
        is_privileged="prepare" in methods,
        uses_plan=bool(getattr(agent, "uses_plan", False)),
        is_deterministic=bool(getattr(agent, "deterministic", True)),
        uses_devtools=bool(getattr(agent, "uses_devtools", False)),
    )


def reset(agent: Any) -> None:
    """Call `reset`, if the agent has it."""
    method = getattr(agent, "reset", None)
    if method is not None:
        method()


def predict(agent: Any, instruction: str, obs: Observation) -> AgentAnswer:
    """Ask for actions.

    Raises:
        AgentError: the agent has no `predict`, or does not return a text and a list.
    """
    answer = _method(agent, "predict", "predict(instruction, obs)")(instruction, obs)
    return _bounded_answer(answer, 'predict must return (text, [actions]), such as ("", ["DONE"])')


def predict_batch(
    agent: Any, instructions: Sequence[str], pictures: Sequence[Any]
) -> list[AgentAnswer]:
    """Ask for the actions of several pictures.

    Raises:
        AgentError: the agent does not return a text and a list for each.
    """
    observations = [{"screenshot": picture} for picture in pictures]
    answers = list(_method(agent, "predict_batch")(instructions, observations))
    if len(answers) != len(pictures):
        raise AgentError(f"predict_batch gave {len(answers)} answers for {len(pictures)} rows")
    rule = "predict_batch must return (text, [actions]) a row"
    return [_bounded_answer(answer, rule) for answer in answers]


def check(agent: Any, picture: Any) -> str | None:
    """Ask an onlooker for a reminder.

    Raises:
        AgentError: it does not return a text or None.
    """
    answer = _method(agent, "check")(picture)
    if answer is None or isinstance(answer, str):
        return answer if answer is None else _cut_text(answer)
    raise AgentError(f"check must return a text or None, got {answer!r:.200}")


def summarise(agent: Any, before: Any, action: str, after: Any) -> str:
    """Ask an onlooker for a summary.

    Raises:
        AgentError: it does not return a text.
    """
    answer = _method(agent, "summarise")(before, action, after)
    if isinstance(answer, str):
        return _cut_text(answer)
    raise AgentError(f"summarise must return a text, got {answer!r:.200}")


def follow(agent: Any, lines: Sequence[str]) -> None:
    """Give the agent the plan of the task in words."""
    _method(agent, "follow")(tuple(lines))


def connect(agent: Any, address: str) -> None:
    """Give the agent the address of the browser's DevTools."""
    _method(agent, "connect", "connect(address)")(address)


def usage(agent: Any) -> dict[str, Any] | None:
    """Return the usage that the agent reports, as JSON data; `None` if it is no mapping.

    Raises:
        AgentError: it is no JSON data, or too large for a record.
    """
    reported = getattr(agent, "usage", None)
    if not isinstance(reported, Mapping):
        return None
    try:
        text = json.dumps(dict(cast("Mapping[Any, Any]", reported)), allow_nan=False)
    except (TypeError, ValueError, RecursionError) as error:
        raise AgentError(str(error)) from None
    if len(text) > MAX_USAGE:
        raise AgentError(f"{len(text)} characters, of which {MAX_USAGE} are allowed")
    return json.loads(text)


def error_text(raised: BaseException) -> str:
    """Return the message of an exception; computing it runs code of the agent, which may raise."""
    if isinstance(raised, AgentError):
        return str(raised)[:MAX_PROBLEM]
    name = type(raised).__name__
    try:
        return f"{name}: {raised}"[:MAX_PROBLEM]
    except Exception:  # noqa: BLE001
        return f"{name}, whose text cannot be shown"[:MAX_PROBLEM]


def error_frames(raised: BaseException) -> tuple[str, ...]:
    """Return the frames of an exception, except ours, as `file:line in function: code`."""
    if isinstance(raised, AgentError):
        return raised.frames
    lines = [
        f"{frame.filename}:{frame.lineno} in {frame.name}: {frame.line}"[:MAX_LINE]
        for frame in traceback.extract_tb(raised.__traceback__)
        if frame.filename not in _OURS
    ]
    return tuple(lines[-MAX_FRAMES:])


def _method(agent: Any, name: str, signature: str = "") -> Callable[..., Any]:
    method = getattr(agent, name, None)
    if method is None:
        raise AgentError(f"{type(agent).__name__} has no {signature or name}")
    return method


def _bounded_answer(answer: object, rule: str) -> AgentAnswer:
    """Return a checked answer; a text that is too long keeps one character more than is allowed.

    So the environment notices that the text was cut, and notes it in the step.

    Raises:
        AgentError: The answer is not a text and a list, or the list is too long.
    """
    match answer:
        case (str() as said, Sequence() as actions) if not isinstance(actions, _TEXTS):
            listed = list(cast("Sequence[object]", actions))
        case _:
            raise AgentError(f"{rule}, got {repr(answer)[:200]}")
    if len(listed) > MAX_ACTIONS:
        raise AgentError(f"an answer has at most {MAX_ACTIONS} actions, got {len(listed)}")
    return _cut_text(said), [_bounded_action(action) for action in listed]


def _bounded_action(action: object) -> object:
    if isinstance(action, str):
        return _cut_text(action)
    return invalid_action(type(action).__name__, _cut_text(repr(action)))


def invalid_action(kind: str, text: str) -> InvalidAction:
    """Return a stand-in for an object of a class named `kind`, for messages and the log."""
    return type(kind[:MAX_LINE], (InvalidAction,), {"text": text})()


def _cut_text(text: str) -> str:
    return str(text[: MAX_TEXT + 1])
