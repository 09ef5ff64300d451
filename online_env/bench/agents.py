"""Agents: what is asked of one, and the two that need no model.

An agent sees an instruction and an observation and answers with text and actions, as OSWorld's agents do. It never gets
the environment, the name of the task or that of the corruption. Only a privileged one, the oracle, is shown more.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, TypeAlias, runtime_checkable

from hijack_data.errors import UnknownNameError, suggest

from ..desktops.protocol import Desktop
from ..tasks import Task

Observation: TypeAlias = Mapping[str, Any]
WAIT, DONE, FAIL = "WAIT", "DONE", "FAIL"


@runtime_checkable
class Agent(Protocol):
    """What an agent is."""

    def reset(self) -> None:
        """Forget everything: a new episode begins."""
        ...

    def predict(self, instruction: str, obs: Observation) -> tuple[str, Sequence[str]]:
        """What the agent says, and the actions to take one after the other: pyautogui code, `WAIT`, `DONE`, `FAIL`.

        `obs["screenshot"]` is uint8 RGB `[H, W, 3]`; actions are in its pixels.
        """
        ...


@runtime_checkable
class Privileged(Agent, Protocol):
    """An agent that knows the task and sees the machine itself: a yardstick, never a contestant."""

    def prepare(self, task: Task, desktop: Desktop) -> None:
        """Called after `reset`, once the task is set up."""
        ...


class DoNothing:
    """Waits until every corruption has had its turn, then claims to be done: it must fail at every task."""

    PATIENCE = 5  # the paper's latest corruption comes at step 3

    def __init__(self) -> None:
        self._waited = 0

    def reset(self) -> None:
        """A new episode."""
        self._waited = 0

    def predict(self, instruction: str, obs: Observation) -> tuple[str, Sequence[str]]:
        """Wait, and at last say `DONE`."""
        self._waited += 1
        if self._waited > self.PATIENCE:
            return "That should do.", [DONE]
        return "Let us see what happens.", [WAIT]


def _oracle() -> Agent:
    from .oracle import Oracle

    return Oracle()


AGENTS: dict[str, Callable[[], Agent]] = {"oracle": _oracle, "do_nothing": DoNothing}


def names() -> tuple[str, ...]:
    """The names of all agents."""
    return tuple(AGENTS)


def make(name: str) -> Agent:
    """A new agent. Raises `UnknownNameError` with the closest name."""
    if name not in AGENTS:
        raise UnknownNameError(f"no agent {name!r}{suggest(name, AGENTS)}")
    return AGENTS[name]()
