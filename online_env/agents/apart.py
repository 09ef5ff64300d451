"""Run an agent in its own thread.

Code can ask Python for its callers (`inspect.stack()`) and read their variables. The frames that
run an episode hold its corruption, so none of them may be a caller of the agent. An exception of
the agent is reported with the agent's own frames only.
"""

import queue
import threading
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from .base import Agent, Observation

FRAMES = 30  # the number of innermost frames that are kept of a traceback
_TEXTS = (str, bytes, bytearray)  # sequences, but of no actions
_Function: TypeAlias = Callable[..., Any]
_Call: TypeAlias = tuple[_Function, tuple[Any, ...]]
_Answer: TypeAlias = tuple[Any, BaseException | None]
_Calls: TypeAlias = "queue.SimpleQueue[_Call | None]"
_Answers: TypeAlias = "queue.SimpleQueue[_Answer]"


class AgentError(Exception):
    """An agent raised, or gave no answer; `where` lists its frames, innermost last."""

    def __init__(self, problem: str, where: Sequence[str] = ()) -> None:
        super().__init__(problem)
        self.where = tuple(where)


class Apart:
    """Calls an agent, one call at a time, in a thread that ends with `close`.

    All calls are made in the same thread, since libraries tie browsers and databases to a thread.

    Args:
        make: returns the agent; called in that thread, too.
        timeout: seconds that a call may take.

    Raises `AgentError` if `make` raises.
    """

    def __init__(self, make: Callable[[], Agent], timeout: float | None = None) -> None:
        self._timeout = timeout
        self._busy = False  # whether a call was interrupted and its answer is still due
        self._calls: _Calls = queue.SimpleQueue()
        self._answers: _Answers = queue.SimpleQueue()
        queues = (self._calls, self._answers)
        # A daemon thread, so that Ctrl-C need not wait for the answer of a model.
        thread = threading.Thread(target=_serve, args=queues, name="agent", daemon=True)
        thread.start()
        self.agent: Agent = self.call(make)

    def __enter__(self) -> "Apart":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def reset(self) -> None:
        """Begin a new episode; an agent without `reset` has nothing to forget.

        Raises `AgentError` if the agent raises.
        """
        reset = self.call(getattr, self.agent, "reset", None)
        if reset is not None:
            self.call(reset)

    def predict(self, instruction: str, obs: Observation) -> tuple[str, Sequence[str]]:
        """Return the agent's words and actions.

        Raises:
            AgentError: the agent raises, or does not return a text and a list.
        """
        predict = self.call(getattr, self.agent, "predict", None)
        if predict is None:
            raise AgentError(f"{type(self.agent).__name__} has no predict(instruction, obs)")
        answer = self.call(predict, instruction, obs)
        match answer:
            case (str() as said, Sequence() as actions) if not isinstance(actions, _TEXTS):
                return said, actions
            case _:
                wanted = 'predict must return (text, [actions]), such as ("", ["DONE"])'
                raise AgentError(f"{wanted}, got {self.call(repr, answer)[:200]}")

    def call(self, function: _Function, *values: Any) -> Any:
        """Call a function in the agent's thread.

        Raises:
            AgentError: the function raises or takes too long, or an earlier call has not ended.
        """
        if self._busy:
            raise AgentError("it still works on a call that was interrupted")
        self._busy = True
        self._calls.put((function, values))
        try:
            answer, raised = self._answers.get(timeout=self._timeout)
        except queue.Empty:
            raise AgentError(f"no answer within {self._timeout:g} s") from None
        self._busy = False
        if raised is None:
            return answer
        raise AgentError(_problem(raised), _frames(raised)) from raised

    def close(self) -> None:
        """End the thread; calling this twice is allowed."""
        self._calls.put(None)


def _serve(calls: _Calls, answers: _Answers) -> None:
    """Answer calls until there are no more. An agent can find only the variables of this frame."""
    while True:
        call = calls.get()
        if call is None:
            return
        function, values = call
        try:
            answers.put((function(*values), None))
        except BaseException as error:  # noqa: BLE001  (an agent may raise anything)
            answers.put((None, error))


def _problem(raised: BaseException) -> str:
    """Return the message of an exception; computing it runs code of the agent, which may raise."""
    name = type(raised).__name__
    try:
        return f"{name}: {raised}"
    except Exception:  # noqa: BLE001
        return f"{name}, whose text cannot be shown"


def _frames(raised: BaseException) -> tuple[str, ...]:
    """Return the frames of an exception, except our own, as `file:line in function: code`."""
    found: list[str] = []
    for frame in traceback.extract_tb(raised.__traceback__):
        if Path(frame.filename) == Path(__file__):
            continue
        place = f"{frame.filename}:{frame.lineno}"
        found.append(f"{place} in {frame.name}: {frame.line}")
    return tuple(found[-FRAMES:])
