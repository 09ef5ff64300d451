"""What is asked of an agent.

An agent sees an instruction and an observation and answers with text and actions, as OSWorld's agents do. It never gets
the environment, the name of the task or that of the corruption. Only a privileged one, the oracle, is shown more.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, TypeAlias, runtime_checkable

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
