"""The agents that need no model, and all agents by name."""

from collections.abc import Callable, Sequence

from hijack_data.errors import UnknownNameError, suggest

from .agent import DONE, WAIT, Agent, Observation
from .oracle import Oracle


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


AGENTS: dict[str, Callable[[], Agent]] = {"oracle": Oracle, "do_nothing": DoNothing}


def names() -> tuple[str, ...]:
    """The names of all agents."""
    return tuple(AGENTS)


def make(name: str) -> Agent:
    """A new agent. Raises `UnknownNameError` with the closest name."""
    if name not in AGENTS:
        raise UnknownNameError(f"no agent {name!r}{suggest(name, AGENTS)}")
    return AGENTS[name]()
