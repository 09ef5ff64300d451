"""Stages: desktops with tasks, for `CorruptedEnv`.

`SmallTasks` has the small tasks on an embedded desktop, `OsworldStage` the tasks of an environment
with OSWorld's interface.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, cast

from hijack_data.apps import normalize_app
from hijack_data.errors import ConfigError, ParameterTypeError, some_of

from .. import tasks
from ..desktops.http import HttpDesktop
from ..desktops.osworld import OsworldDesktop, OsworldLike
from ..desktops.protocol import Capability, Desktop, RunResult
from ..embedded.panel_clock import set_panel_clock
from ..embedded.sites.state import SiteState
from ..errors import DesktopError
from ..osworld.tasks import OsworldTask, mistakes
from ..tasks.base import Task, Verdict
from ..tasks.machine import Machine

WORDS = ("WAIT", "DONE", "FAIL")
# What OSWorld logs of a browser that is still starting; if it never answers, that is raised.
RETRIED = "Failed to connect, retrying"
# Seconds between the last action and the evaluation, as in OSWorld's own runs: applications write
# late, and evaluators read their files. Chromium may take ten seconds for its settings.
LATE_FILES = 20.0


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
        wanted: object = self._default if task is None else task
        if isinstance(wanted, str):
            wanted = tasks.get(wanted, seed)
        if not isinstance(wanted, Task):
            known = some_of(tasks.names())
            raise ParameterTypeError(f"a task is a name ({known}) or a Task, got {wanted!r:.80}")
        self._task = None
        self._desktop.reset()
        self._machine = Machine(self._desktop, self.sites)
        if self.sites is not None:
            set_panel_clock(self._desktop, wanted.seed)
        wanted.setup(self._machine)
        self._task = wanted
        apps = tuple(normalize_app(app) for app in wanted.apps)
        infeasible = bool(wanted.infeasible)
        return Setting(wanted.id, wanted.instruction, apps, infeasible, wanted.seed)

    def evaluate(self, history: Sequence[str]) -> Verdict:
        """Judge the task by files and by the data stored by applications and sites."""
        answer = history[-1] if history else ""
        return self.task.validate(self.machine, answer)

    def close(self) -> None:
        """End the desktop."""
        self._desktop.close()


class OsworldStage:
    """The tasks of an environment with OSWorld's interface.

    It has `reset`, `step`, `evaluate`, `controller` and `action_history`. The agent's actions and
    the effects both go to the guest through `controller`. The environment itself gets only the last
    action, right before it evaluates, because it judges infeasible tasks by that action.

    Args:
        env: `desktop_env.DesktopEnv`, or the result of `online_env.osworld.run.embedded_env`.
        password: The password of the guest's user, for sudo.
        capabilities: Capabilities of the guest in addition to those that are detected.
        late_files: Seconds to wait before a feasible task is evaluated, for what applications have
            not written yet; by default as long as OSWorld's own runs wait.

    Attributes:
        setup_errors: What OSWorld logged as errors while it set the present task up.
    """

    def __init__(
        self,
        env: OsworldLike,
        password: str | None = "password",
        capabilities: Sequence[Capability] = (),
        late_files: float = LATE_FILES,
    ) -> None:
        self.env = env
        self._late_files = late_files
        self._infeasible = False
        self._desktop = _Guest(env, password, capabilities)
        self.setup_errors: list[str] = []

    @property
    def desktop(self) -> OsworldDesktop:
        """The machine."""
        return self._desktop

    def reset(self, task: Any, seed: int) -> Setting:
        """Set up one of OSWorld's tasks; errors of the environment are passed on.

        A task with mistakes raises `ConfigError`.

        Args:
            task: The content of one of OSWorld's task files, or an `OsworldTask`.
            seed: Not used: OSWorld's tasks have no variants.
        """
        config = _config(task)
        try:
            self._desktop.reset(config)
        finally:
            # Only the environment's own `step` would note that the machine must be reverted; a
            # setup that broke off would be left to the next task.
            if hasattr(self.env, "is_environment_used"):
                cast(Any, self.env).is_environment_used = True
        # OSWorld goes on where a step of its setup fails, and only logs that.
        logged = cast("Sequence[str]", getattr(self.env, "warnings", ()))
        errors = [line for line in logged if line.startswith("ERROR")]
        self.setup_errors = [line for line in errors if RETRIED not in line]
        apps = tuple(normalize_app(app) for app in config.get("related_apps", ()))
        self._infeasible = config["evaluator"].get("func") == "infeasible"
        return Setting(config["id"], config["instruction"], apps, self._infeasible)

    def evaluate(self, history: Sequence[str]) -> Verdict:
        """Return OSWorld's own score, after a wait; the reason says if its setup logged an error.

        A guest that does not answer any more is a `GuestError`.
        """
        actions = list(history)
        last = actions.pop() if actions and actions[-1] in WORDS else None
        self.env.action_history[:] = actions
        if last is not None:
            self.env.step(last, pause=0)
        reason = "OSWorld's evaluator"
        if self.setup_errors:
            reason += f"; the task's setup logged {len(self.setup_errors)} errors, the first:"
            reason += f" {self.setup_errors[0]}"
        if not self._infeasible:  # else it is judged by the last action alone
            time.sleep(self._late_files)
        score = self._desktop.evaluate()
        # OSWorld takes what a guest that has died does not send for a file that is not there: a 0.
        self._desktop.screenshot()
        return Verdict(score, reason)

    def close(self) -> None:
        """Close the environment."""
        self._desktop.close()


class _Guest(OsworldDesktop):
    """The environment's guest, with its network namespace if that is on this machine.

    See `effects.guest` for `namespace` and `tool`.
    """

    @property
    def namespace(self) -> Path | None:
        """The network namespace of an embedded desktop; `None` for another guest."""
        return getattr(self.env, "namespace", None)

    @property
    def capabilities(self) -> frozenset[Capability]:
        """The guest's capabilities; this machine can close the network of an embedded desktop."""
        if self.namespace is None:
            return super().capabilities
        firewall: frozenset[Capability] = frozenset({"firewall"})
        return super().capabilities | firewall

    @property
    def tool(self) -> Callable[..., dict[str, Any]] | None:
        """A function that calls an embedded desktop's guest server; `None` for another guest."""
        client: HttpDesktop | None = getattr(self.env, "client", None)
        return None if client is None else client.tool

    def execute(self, argv: Sequence[str] | str, timeout: float = 60) -> RunResult:
        """Run a command.

        Our own guest server runs the command without the Python of the desktop's user, which
        OSWorld's client needs.
        """
        client: HttpDesktop | None = getattr(self.env, "client", None)
        if client is None:
            return super().execute(argv, timeout)
        return client.execute(argv, timeout)


def _config(task: object) -> dict[str, Any]:
    config = task.config if isinstance(task, OsworldTask) else task
    found = list(mistakes(config))
    if found:
        raise ConfigError([f"the task: {text}" for text in found])
    return dict(cast("Mapping[str, Any]", config))
