"""Stages: desktops with tasks, for `CorruptedEnv`.

`SmallTasks` has the small tasks on any desktop.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from hijack_data.apps import normalize_app
from hijack_data.errors import ParameterTypeError, shorten_list

from .. import tasks
from ..desktops.protocol import Desktop
from ..embedded.panel_clock import set_panel_clock
from ..embedded.sites.state import SiteState
from ..errors import DesktopError
from ..tasks.base import Task, Verdict
from ..tasks.machine import Machine


@dataclass(frozen=True)
class Setting:
    """A task that has been set up.

    Args:
        id: The task's id; it is also the key of the random draws, so that every agent gets the
            same disturbances.
        instruction: The instruction that the agent gets.
        apps: Normalised names of the applications that the task uses.
        infeasible: Whether the right answer is `FAIL`.
        seed: The seed of the task's variant.
    """

    id: str
    instruction: str
    apps: tuple[str, ...] = ()
    infeasible: bool = False
    seed: int = 0


class Stage(Protocol):
    """The interface for `CorruptedEnv`; all methods raise `DesktopError` if the desktop fails."""

    @property
    def desktop(self) -> Desktop:
        """The machine."""
        ...

    def reset(self, task: Any, seed: int) -> Setting:
        """Set up a task on a pristine desktop.

        Args:
            task: The task; `None` leaves the choice to the stage.
            seed: Chooses the task's variant.
        """
        ...

    def evaluate(self, history: Sequence[str]) -> Verdict:
        """Judge how well the current task was done.

        Args:
            history: The agent's own actions. An infeasible task is judged by the last action.
        """
        ...

    def close(self) -> None:
        """End the desktop; calling it again does nothing."""
        ...


@runtime_checkable
class TwoPartStage(Stage, Protocol):
    """A stage that can revert the desktop first, and set its task up after something was done.

    See `EvalSettings.environment_errors`.
    """

    @property
    def splits_setup(self) -> bool:
        """Whether its desktop allows it."""
        ...

    def choose(self, task: Any, seed: int) -> Setting:
        """Return what `reset` will set up, without touching the desktop."""
        ...

    def reset_around(self, task: Any, seed: int, cut_network: Callable[[], object]) -> Setting:
        """Set up a task on a pristine desktop whose network is cut before the task's pages open.

        Args:
            task: As for `reset`.
            seed: As for `reset`.
            cut_network: Called once the desktop is pristine, and before anything is set up.
        """
        ...


class TaskStage(Stage, Protocol):
    """A stage whose tasks are known by name, for the agents that are given their task."""

    @property
    def task(self) -> Task:
        """The task that is set up now."""
        ...

    @property
    def machine(self) -> Machine:
        """The desktop in the form that tasks use."""
        ...

    def plan(self) -> Sequence[str]:
        """Return the plan in words of the task, as it holds on this desktop; see `Task.plan`."""
        ...


class TaskHolder:
    """Keeps the task that is set up now, for a stage."""

    _task: Task | None = None

    @property
    def task(self) -> Task:
        """The task that is set up now.

        Raises:
            DesktopError: There was no reset yet.
        """
        if self._task is None:
            raise DesktopError("no task is set up: call reset first")
        return self._task

    def plan(self) -> Sequence[str]:
        """Return the plan in words of the task that is set up now."""
        return tuple(self.task.plan())


class SmallTasks(TaskHolder):
    """The tasks of `online_env.tasks` on a desktop.

    Args:
        desktop: A desktop, for example from `EmbeddedDesktop.up`; with `standby=True` resets are
            fast.
        task: The task of a `reset` that names none: a name, or a task with its own seed.
    """

    def __init__(self, desktop: Desktop, task: str | Task = "write_note") -> None:
        self._desktop = desktop
        self._default = task
        self._machine: Machine | None = None

    @property
    def desktop(self) -> Desktop:
        """The machine; the same object after each reset."""
        return self._desktop

    @property
    def machine(self) -> Machine:
        """The desktop in the form that tasks use.

        Raises:
            DesktopError: There was no reset yet.
        """
        if self._machine is None:
            raise DesktopError("no task is set up: call reset first")
        return self._machine

    @property
    def sites(self) -> SiteState | None:
        """The journal of the desktop's local internet, or `None` without one."""
        record = getattr(self._desktop, "record", None)
        return None if record is None else SiteState(record["sites"])

    def reset(self, task: Any, seed: int) -> Setting:
        """Set up a task on a pristine desktop.

        An unknown name raises `UnknownNameError`.

        Args:
            task: A name (then `seed` chooses the variant), a task, or `None` for the default.
            seed: Chooses the variant of a task that is given by name.

        Raises:
            ParameterTypeError: `task` is neither a name nor a task.
        """
        return self._reset(task, seed, None)

    @property
    def splits_setup(self) -> bool:
        """True: any desktop can be reverted first."""
        return True

    def choose(self, task: Any, seed: int) -> Setting:
        """Return what `reset` will set up, with the same arguments and errors."""
        return describe_task(self._find(task, seed))

    def reset_around(self, task: Any, seed: int, cut_network: Callable[[], object]) -> Setting:
        """Set up a task on a pristine desktop whose network is cut before its pages open."""
        return self._reset(task, seed, cut_network)

    def _reset(self, task: Any, seed: int, cut_network: Callable[[], object] | None) -> Setting:
        chosen_task = self._find(task, seed)
        self._task = None
        self._desktop.reset()
        if self._machine is None:
            self._machine = Machine(self._desktop)
        self._machine.renew(self.sites, offline=cut_network is not None)
        if cut_network is not None:
            cut_network()
        if self.sites is not None:
            set_panel_clock(self._desktop, chosen_task.seed)
        chosen_task.setup(self._machine)
        self._task = chosen_task
        return describe_task(chosen_task)

    def _find(self, task: Any, seed: int) -> Task:
        chosen_task: object = self._default if task is None else task
        if isinstance(chosen_task, str):
            chosen_task = tasks.get(chosen_task, seed)
        if not isinstance(chosen_task, Task):
            task_names = shorten_list(tasks.names())
            raise ParameterTypeError(
                f"a task is a name ({task_names}) or a Task, got {chosen_task!r:.80}"
            )
        return chosen_task

    def evaluate(self, history: Sequence[str]) -> Verdict:
        """Judge the task by files and by the data stored by applications and sites."""
        answer = history[-1] if history else ""
        return self.task.validate(self.machine, answer)

    def close(self) -> None:
        """End the desktop."""
        self._desktop.close()


def describe_task(task: Task) -> Setting:
    """Return what an environment knows of a task."""
    apps = tuple(normalize_app(app) for app in task.apps)
    return Setting(task.id, task.instruction, apps, bool(task.infeasible), task.seed)
