"""What is asked of an agent.

An agent gets an instruction and an observation and answers with text and actions, as OSWorld's
agents do. It never gets the environment, the name of the task or that of the corruption. Only a
privileged one, the oracle, is given more.

Each episode has a new object, made without arguments, in a thread of its own; all calls are made in
that thread. What should outlive an episode, such as the weights of a model, belongs to the class or
to the module.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, TypeAlias, runtime_checkable

from ..tasks import Machine, Task

Observation: TypeAlias = Mapping[str, Any]
WAIT = "WAIT"
DONE = "DONE"
FAIL = "FAIL"


@runtime_checkable
class Agent(Protocol):
    """What an agent is.

    It may also have `reset()`, which is called before the first `predict` of an episode and after
    the last one.
    """

    def predict(self, instruction: str, obs: Observation) -> tuple[str, Sequence[str]]:
        """Return the agent's words, and the actions to take one after the other.

        An action is pyautogui code, `WAIT`, `DONE` or `FAIL`.

        Args:
            instruction: the task in words.
            obs: `obs["screenshot"]` is uint8 RGB `[H, W, 3]`; actions are in its pixels.
        """
        ...


@runtime_checkable
class Privileged(Agent, Protocol):
    """An agent that knows the task and sees the machine itself: a yardstick, never a contestant."""

    def prepare(self, task: Task, machine: Machine) -> None:
        """Called after `reset`, once the task is set up."""
        ...


@runtime_checkable
class PlanFollower(Agent, Protocol):
    """An agent that receives the steps of the task in words: a yardstick, never a contestant."""

    uses_plan: bool

    def follow(self, lines: Sequence[str]) -> None:
        """Called after `reset`, once the task is set up.

        Args:
            lines: the plan of the task, see `online_env.tasks.plan_words`; empty if it has none.
        """
        ...
