"""The interface of agents.

An agent gets an instruction and an observation and answers with text and actions, as OSWorld's
agents do. It never gets the environment, or the names of the task and of the corruption. Only
privileged agents, such as the oracle, get more.

An agent of a user has a process of its own, which plays all episodes of a desktop. For each episode
a new object is made, without arguments; all calls are made in one thread. Keep anything that should
outlive an episode, such as the weights of a model, in the class or in the module.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, runtime_checkable

if TYPE_CHECKING:  # the process of an agent need not load all tasks
    from ..tasks import Machine, Task

Observation: TypeAlias = Mapping[str, Any]
WAIT = "WAIT"
DONE = "DONE"
FAIL = "FAIL"


@runtime_checkable
class Agent(Protocol):
    """The interface of an agent.

    It may also have `reset()`, which is called before the first `predict` of an episode and after
    the last one.
    """

    def predict(self, instruction: str, obs: Observation) -> tuple[str, Sequence[str]]:
        """Return the agent's words, and a list of actions to take in order.

        An action is pyautogui code, `WAIT`, `DONE` or `FAIL`.

        Args:
            instruction: the task in words.
            obs: `obs["screenshot"]` is uint8 RGB `[H, W, 3]`; actions are in its pixels.
        """
        ...


@runtime_checkable
class Privileged(Agent, Protocol):
    """An agent that gets the task and the machine itself: a yardstick, not a contestant."""

    def prepare(self, task: "Task", machine: "Machine") -> None:
        """Called after `reset`, once the task is set up."""
        ...


@runtime_checkable
class PlanFollower(Agent, Protocol):
    """An agent that gets the steps of the task in words: a yardstick, not a contestant."""

    uses_plan: bool

    def follow(self, lines: Sequence[str]) -> None:
        """Called after `reset`, once the task is set up.

        Args:
            lines: the plan of the task, see `online_env.tasks.plan_words`; empty if it has none.
        """
        ...


@runtime_checkable
class DevToolsAgent(Agent, Protocol):
    """An agent that drives the browser itself, by Playwright or another client of DevTools.

    An empty list of actions from `predict` means that it has acted in the browser.
    """

    uses_devtools: bool

    def connect(self, address: str) -> None:
        """Called after `reset`, once the task is set up.

        Args:
            address: of the browser, for `connect_over_cdp`; the task's page is open there.
        """
        ...
