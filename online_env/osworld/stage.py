"""OSWorld's tasks as a stage of `CorruptedEnv`, in any environment with OSWorld's interface."""

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from hijack_data.apps import normalize_app
from hijack_data.errors import ConfigError

from ..desktops.http import HttpDesktop
from ..desktops.osworld import OsworldDesktop, OsworldLike
from ..desktops.protocol import Capability, RunResult
from ..environment.stage import Setting
from ..tasks.base import Verdict
from .env import OsworldEnv
from .tasks import OsworldTask, mistakes

CONTROL_ACTIONS = ("WAIT", "DONE", "FAIL")
# What OSWorld logs of a browser that is still starting; if it never answers, that is raised.
RETRY_MESSAGE = "Failed to connect, retrying"
# Seconds between the last action and the evaluation, as in OSWorld's own runs: applications write
# late, and evaluators read their files. Chromium may take ten seconds for its settings.
LATE_FILES_S = 20.0
# Seconds between the set-up of a task and its first picture, as in the runs of the paper's authors:
# OSWorld starts programs without waiting for their windows.
SETUP_WAIT_S = 10.0


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
        setup_wait: Seconds to wait after the set-up of a task that has any, for the windows of the
            programs that it started; by default as long as the runs of the paper's authors wait.

    Attributes:
        setup_errors: What OSWorld logged as errors while it set the present task up.
    """

    def __init__(
        self,
        env: OsworldLike,
        password: str | None = "password",
        capabilities: Sequence[Capability] = (),
        late_files: float = LATE_FILES_S,
        setup_wait: float = SETUP_WAIT_S,
    ) -> None:
        self.env = env
        self._late_files = late_files
        self._setup_wait = setup_wait
        self._infeasible = False
        self._cut_network: Callable[[], object] | None = None
        # An environment on an embedded desktop has its network namespace.
        guest = _EmbeddedGuest if hasattr(env, "namespace") else OsworldDesktop
        self._desktop = guest(env, password, capabilities)
        self.setup_errors: list[str] = []

    @property
    def desktop(self) -> OsworldDesktop:
        """The machine."""
        return self._desktop

    def reset(self, task: Any, seed: int) -> Setting:
        """Set up one of OSWorld's tasks.

        Args:
            task: The content of one of OSWorld's task files, or an `OsworldTask`.
            seed: Not used: OSWorld's tasks have no variants.

        Raises:
            ConfigError: The task has mistakes.
            Exception: The environment's own `reset` raised it.
        """
        config = _task_config(task)
        cut_network, self._cut_network = self._cut_network, None
        try:
            if cut_network is None:
                self._desktop.reset(config)
            else:
                self._desktop.reset(None)
                cut_network()
                self._set_up(config)
        finally:
            # Only the environment's own `step` would note that the machine must be reverted; a
            # setup that broke off would be left to the next task.
            if hasattr(self.env, "is_environment_used"):
                cast(Any, self.env).is_environment_used = True
        # OSWorld goes on where a step of its setup fails, and only logs that.
        logged = cast("Sequence[str]", getattr(self.env, "warnings", ()))
        errors = [line for line in logged if line.startswith("ERROR")]
        self.setup_errors = [line for line in errors if RETRY_MESSAGE not in line]
        if config.get("config"):
            time.sleep(self._setup_wait)
        setting = _describe(config)
        self._infeasible = setting.infeasible
        return setting

    @property
    def splits_setup(self) -> bool:
        """Whether the environment can revert its machine and set a task up in two calls."""
        return isinstance(self.env, OsworldEnv) or hasattr(self.env, "is_environment_used")

    def choose(self, task: Any, seed: int) -> Setting:
        """Return what `reset` will set up, with the same arguments and errors."""
        return _describe(_task_config(task))

    def reset_around(self, task: Any, seed: int, cut_network: Callable[[], object]) -> Setting:
        """Set up a task on a pristine machine whose network is cut before its pages open.

        A page that cannot be loaded stops no set-up of OSWorld's.
        """
        self._cut_network = cut_network
        try:
            return self.reset(task, seed)
        finally:
            self._cut_network = None

    def _set_up(self, config: dict[str, Any]) -> None:
        """Set up a task on a machine whose network is cut, without reverting it."""
        # OSWorld would install its proxy from the internet; a failed step makes the set-up fail.
        config = {**config, "proxy": False}
        if isinstance(self.env, OsworldEnv):
            self.env.reset(config, keep=True)
        else:
            cast(Any, self.env).is_environment_used = False
            self.env.reset(task_config=config)

    def evaluate(self, history: Sequence[str]) -> Verdict:
        """Return OSWorld's own score, after a wait; the reason says if its setup logged an error.

        A guest that does not answer any more is a `GuestError`.
        """
        actions = list(history)
        last = actions.pop() if actions and actions[-1] in CONTROL_ACTIONS else None
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


class _EmbeddedGuest(OsworldDesktop):
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


def _describe(config: Mapping[str, Any]) -> Setting:
    apps = tuple(normalize_app(app) for app in config.get("related_apps", ()))
    infeasible = config["evaluator"].get("func") == "infeasible"
    return Setting(config["id"], config["instruction"], apps, infeasible)


def _task_config(task: object) -> dict[str, Any]:
    config = task.config if isinstance(task, OsworldTask) else task
    problems = list(mistakes(config))
    if problems:
        raise ConfigError([f"the task: {text}" for text in problems])
    return dict(cast("Mapping[str, Any]", config))
