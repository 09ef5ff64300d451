"""Run an agent in a thread of the runner: agents of this library, and any with `--in-process`.

An agent that hangs costs its time-out, but its code can reach everything of the runner. Agents of
users run in processes of their own, see `agent_process`.
"""

import queue
import threading
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, TypeAlias

from . import agent_calls
from .agent_calls import (
    AgentAnswer,
    AgentError,
    AgentGoneError,
    AgentTraits,
    error_frames,
    error_text,
)
from .base import Agent, Observation

_Function: TypeAlias = Callable[..., Any]
_Call: TypeAlias = tuple[_Function, tuple[Any, ...]]
_Outcome: TypeAlias = tuple[Any, BaseException | None]
_Calls: TypeAlias = "queue.SimpleQueue[_Call | None]"
_Outcomes: TypeAlias = "queue.SimpleQueue[_Outcome]"


class AgentThread:
    """Calls an agent, one call at a time, in a thread that ends with `close`.

    All calls are made in the same thread, since libraries tie browsers and databases to a thread.
    See `RunningAgent` for the methods.

    Args:
        maker: returns the agent; called in that thread, too.
        timeout: seconds that a call may take.

    Raises:
        AgentError: `maker` raises.
    """

    def __init__(self, maker: Callable[[], Agent], timeout: float | None = None) -> None:
        self._maker = maker
        self._timeout = timeout
        self._busy = False  # whether a call was interrupted and its answer is still due
        self._calls: _Calls = queue.SimpleQueue()
        self._answers: _Outcomes = queue.SimpleQueue()
        queues = (self._calls, self._answers)
        # A daemon thread, so that Ctrl-C need not wait for the answer of a model.
        thread = threading.Thread(target=_serve, args=queues, name="agent", daemon=True)
        thread.start()
        self.agent: Agent
        self.make()

    def __enter__(self) -> "AgentThread":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def traits(self) -> AgentTraits:
        """What the agent can do."""
        return self.call(agent_calls.read_traits, self.agent)

    @property
    def alive(self) -> bool:
        """Whether no call is unanswered."""
        return not self._busy

    @property
    def take_notice(self) -> Callable[[Any], None] | None:
        """What passes a guard's notice to an agent that takes notices; `None` for other agents."""
        method = getattr(self.agent, "take_notice", None)
        return None if method is None else partial(self.call, method)

    @property
    def words_have_actions(self) -> bool:
        """Whether the agent's words hold its actions, as those of a model do."""
        return bool(getattr(self.agent, "words_have_actions", False))

    def make(self) -> None:
        """Make a new object of the agent."""
        self.agent = self.call(self._maker)

    def reset(self) -> None:
        """Begin a new episode."""
        self.call(agent_calls.reset, self.agent)

    def predict(self, instruction: str, obs: Observation) -> AgentAnswer:
        """Return the agent's words and actions."""
        return self.call(agent_calls.predict, self.agent, instruction, obs)

    def predict_batch(
        self, instructions: Sequence[str], pictures: Sequence[Any]
    ) -> list[AgentAnswer]:
        """Return the answers to several pictures."""
        return self.call(agent_calls.predict_batch, self.agent, instructions, pictures)

    def check(self, picture: Any) -> str | None:
        """Return the reminder of an onlooker, or `None`."""
        return self.call(agent_calls.check, self.agent, picture)

    def summarise(self, before: Any, action: str, after: Any) -> str:
        """Return an onlooker's summary of a step."""
        return self.call(agent_calls.summarise, self.agent, before, action, after)

    def follow(self, lines: Sequence[str]) -> None:
        """Give the agent the plan of the task in words."""
        self.call(agent_calls.follow, self.agent, lines)

    def connect(self, address: str) -> None:
        """Give the agent the address of the browser's DevTools."""
        self.call(agent_calls.connect, self.agent, address)

    def usage(self) -> dict[str, Any] | None:
        """Return the usage that the agent reports so far."""
        return self.call(agent_calls.usage, self.agent)

    def call(self, function: _Function, *values: Any) -> Any:
        """Call a function in the agent's thread.

        Raises:
            AgentError: The function raises or takes too long.
            AgentGoneError: An earlier call was interrupted and has not ended.
        """
        if self._busy:
            raise AgentGoneError("it still works on a call that was interrupted")
        self._busy = True
        self._calls.put((function, values))
        try:
            answer, raised = self._answers.get(timeout=self._timeout)
        except queue.Empty:
            raise AgentError(f"no answer within {self._timeout:g} s") from None
        self._busy = False
        if raised is None:
            return answer
        raise AgentError(error_text(raised), error_frames(raised)) from raised

    def close(self) -> None:
        """End the thread; calling this twice is allowed."""
        self._calls.put(None)


def _serve(calls: _Calls, answers: _Outcomes) -> None:
    """Answer calls until there are no more."""
    while True:
        call = calls.get()
        if call is None:
            return
        function, values = call
        try:
            answers.put((function(*values), None))
        except BaseException as error:  # noqa: BLE001  (an agent may raise anything)
            answers.put((None, error))
