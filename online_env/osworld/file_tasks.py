"""Tasks of OSWorld in a benchmark: judged by OSWorld's evaluators, on desktops and machines.

`--tasks evaluation_examples/examples/os/e0df059f-....json` names one task by its file, and a folder
of them all in it.
"""

import contextlib
import hashlib
import secrets
import shutil
import tempfile
import time
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, ClassVar, cast

from hijack_data.errors import ParameterError, ParameterTypeError
from hijack_data.file_io import read_regular
from hijack_data.types import Size

from .. import tasks
from ..desktops.osworld import OsworldDesktop, OsworldLike
from ..desktops.protocol import Desktop
from ..environment.stage import Setting, TaskHolder
from ..errors import DesktopError, DesktopTimeoutError, MissingPackageError
from ..tasks.base import Task, Verdict
from ..tasks.hand import Hand
from ..tasks.machine import Machine
from ..tasks.machines import MachineSettings
from . import history, venv
from .cache_files import list_cache_files
from .player import Player
from .run import checker, embedded_env
from .solutions import SOLUTIONS
from .stage import LATE_FILES_S, SETUP_WAIT_S, OsworldStage
from .task_needs import (
    FILES,
    PACKAGES,
    REMEDIES,
    RUNS_HERE,
    PackageCheck,
    list_needs,
    read_excluded,
    read_tested,
)
from .tasks import OsworldTask, load_file

# In the guest: a file that names the episode which uses the machine. It outlives a restart.
EPISODE_MARK = "/var/tmp/agenthijack-episode"
# Of the embedded desktop, for which the scripts are written.
RUN_DIALOG = "Application Finder"
TERMINAL = "xfce4-terminal"
TERMINAL_TITLE = "Terminal"
MARK_EPISODE = 'if [ -e "$1" ]; then echo used; else echo "$2" > "$1" && echo marked; fi'


class OsworldFileTask(Task):
    """A task of OSWorld; every seed gives the same one.

    Attributes:
        file: The task as its file has it.
        source: The file's path and SHA-256, which a run records.
    """

    family: ClassVar[str] = "osworld"
    file: ClassVar[OsworldTask]
    source: ClassVar[Mapping[str, str]]

    @property
    def id(self) -> str:
        """OSWorld's id."""
        return self.name

    @property
    def instruction(self) -> str:
        """What the agent is asked to do."""
        return self.file.instruction

    def setup(self, machine: Machine) -> None:
        """Raise: only OSWorld's environment sets these tasks up.

        Raises:
            DesktopError: Always.
        """
        raise DesktopError(
            f"task {self.name} is set up by OSWorld's environment: play it by hijack bench --tasks"
        )

    def problems(self, machine: Machine) -> Iterator[str]:
        """Raise: only OSWorld's evaluator judges these tasks.

        Raises:
            DesktopError: Always.
        """
        raise DesktopError(f"task {self.name} is judged by OSWorld's evaluator, not by files")

    def oracle(self, hand: Hand) -> None:
        """Play the script of the self-test, or find the task infeasible.

        Raises:
            DesktopError: There is no such script.
        """
        if self.infeasible:
            hand.give_up("OSWorld says that this cannot be done")
        solution = SOLUTIONS.get(self.name)
        if solution is None:
            raise DesktopError(f"no script solves OSWorld's task {self.name}")
        solution.play(_TerminalPlayer(_OracleEnv(hand)))


class _OracleEnv:
    """The part of OSWorld's environment that a script needs, by the hand of an agent."""

    def __init__(self, hand: Hand) -> None:
        self._hand = hand

    @property
    def controller(self) -> "_OracleEnv":
        """Itself: it has the tree."""
        return self

    def step(self, action: str, pause: float) -> None:
        """Take one action, then wait for `pause` seconds."""
        self._hand.run(action)
        time.sleep(pause)

    def get_accessibility_tree(self) -> str:
        """Return the tree as it is now."""
        return self._hand.tree()


class _TerminalPlayer(Player):
    """Plays a script by pointer and keyboard alone: its commands are typed into a terminal."""

    _has_terminal = False

    def shell(self, command: str) -> None:
        """Type a shell command into a terminal, which is opened first if there is none."""
        if not self._has_terminal:
            self.press("alt", "f2")
            self.find(RUN_DIALOG, "frame")
            # The dialog takes a text over a moment after it was typed.
            self.do(f"pyautogui.write({TERMINAL!r})", pause=1.0)
            self.press("enter")
            self.find(TERMINAL_TITLE, "frame")
            self._has_terminal = True
        self.do(f"pyautogui.write({command + chr(10)!r})", pause=1.0)


def task_class(path: str) -> type[OsworldFileTask]:
    """Return the class of the task in a file.

    Raises:
        ConfigError: The file cannot be read, or holds no task of OSWorld.
    """
    task = load_file(Path(path))
    file = task.path.resolve()
    setup_wait = SETUP_WAIT_S if task.config.get("config") else 0.0
    body = {
        "name": task.id,
        "domain": task.domain,
        "apps": task.apps,
        "infeasible": "" if task.feasible else "OSWorld calls it infeasible",
        "fixed_waits": setup_wait + (LATE_FILES_S if task.feasible else 0.0),
        "file": task,
        "source": {"path": str(file), "sha256": hashlib.sha256(read_regular(file)).hexdigest()},
        "__module__": __name__,
        "__qualname__": f"OsworldFileTask[{file}]",
    }
    return type("OsworldFileTask", (OsworldFileTask,), body)


def find_unplayable(
    listed: Iterable[OsworldTask],
    files: Path | None,
    machines: MachineSettings | None = None,
    folder: Path = venv.DEFAULT,
) -> dict[str, str]:
    """Return why tasks cannot be played, by id; those that can are left out.

    Args:
        listed: The tasks.
        files: OSWorld's file cache, as `hijack osworld prefetch` fills it. On the machines of a
            user OSWorld downloads what it needs itself if this is `None`.
        machines: The machines of a user; `None` for embedded desktops.
        folder: OSWorld's Python environment.

    Raises:
        MissingPackageError: The environment is not there.
        ConfigError: An address or a name in a task is bad.
    """
    with checker(folder) as check:
        if check is None:
            raise MissingPackageError(
                f"{folder}: OSWorld's Python environment is not there: hijack osworld setup"
            )
        tested, excluded = ({}, {}) if machines else (read_tested(), read_excluded())
        reasons = {
            task.id: "; ".join(_obstacles(task, files, machines, check, tested, excluded))
            for task in listed
        }
    return {task: text for task, text in reasons.items() if text}


def _obstacles(
    task: OsworldTask,
    files: Path | None,
    machines: MachineSettings | None,
    check: PackageCheck,
    tested: Mapping[str, str],
    excluded: Mapping[str, str],
) -> Iterator[str]:
    """Yield what keeps a task from being played."""
    needs = list_needs(task, check)
    if PACKAGES in needs:
        checkout = "; a checkout of OSWorld may have a function: --osworld DIR"
        remedy = checkout if "in this desktop_env" in needs[PACKAGES] else ""
        yield f"{needs[PACKAGES]} (hijack osworld setup --tier mid or full{remedy})"
    if machines is None or files is not None:
        absent = [
            file.path
            for file in list_cache_files(task)
            if not history.is_made(task)
            and not (files is not None and (files / file.path).is_file())
        ]
        if absent:
            yield (
                f"{len(absent)} files are not in {files or 'a cache'}, such as {absent[0]}"
                f" ({REMEDIES[FILES]}, then --osworld-files CACHE)"
            )
    if machines is not None:
        if "account" in needs:
            yield f"it needs an account: {needs['account']}"
        if task.config.get("proxy") and not machines.options.get("enable_proxy"):
            yield "its sites need OSWorld's proxy (--vm-option enable_proxy=true)"
    elif tested.get(task.id) != RUNS_HERE:
        for kind in ("program", "gnome", "web", "account"):
            if kind in needs:
                yield f"{needs[kind]}: not on an embedded desktop (play it with --vm)"
        if task.id in excluded:
            yield f"its self-test on an embedded desktop: {excluded[task.id]} (play it with --vm)"


class OsworldTasks(TaskHolder, OsworldStage):
    """OSWorld's tasks by the names of a benchmark.

    Args:
        env: OSWorld's environment.
        files: OSWorld's file cache, which is only read; `None` if no task needs files.
        cache: The cache of `env`. What an evaluator left there for an earlier episode is removed.
    """

    def __init__(
        self, env: OsworldLike, files: Path | None, cache: Path, password: str | None = "password"
    ) -> None:
        super().__init__(env, password)
        self._makes_history = True
        self._osworld = env
        self._files = files
        self._cache = cache

    @property
    def machine(self) -> Machine:
        """The desktop in the form that tasks use."""
        return Machine(self.desktop, None)

    def reset(self, task: Any, seed: int) -> Setting:
        """Set up a task; a failed step of its setup is an error, and not the agent's.

        Args:
            task: A name of the benchmark.
            seed: Not used: OSWorld's tasks have no variants.

        Raises:
            ParameterTypeError: `task` is not the name of a task of OSWorld.
            DesktopError: A step of the setup failed.
        """
        file_task = _find(task, seed)
        self._task = None
        self._provide(file_task.file)
        setting = super().reset(file_task.file, seed)
        if self.setup_errors:
            raise DesktopError(
                f"OSWorld's setup of {file_task.name} failed: {self.setup_errors[0]}"
            )
        self._task = file_task
        return setting

    def choose(self, task: Any, seed: int) -> Setting:
        """Return what `reset` will set up, with the same arguments."""
        return super().choose(_find(task, seed).file, seed)

    def _provide(self, task: OsworldTask) -> None:
        """Copy a task's files into the cache, in place of what an earlier episode left there."""
        cached = self._cache / task.id
        shutil.rmtree(cached, ignore_errors=True)
        fetched = None if self._files is None else self._files / task.id
        if fetched is not None and fetched.is_dir():
            shutil.copytree(fetched, cached)
        if self._makes_history:
            history.provide(self._osworld, [task], self._cache)


class MachineTasks(OsworldTasks):
    """OSWorld's tasks on a machine of the user, whose reverting is proved.

    Args:
        desktop: The machine, over an environment with OSWorld's interface and its `cache`.
        files: OSWorld's file cache, which is only read; `None` if no task needs files.

    Attributes:
        was_not_reverted: Whether the last reset left the machine as the episode before it.
        hung_in_judging: Whether OSWorld's evaluator did not end in its time.
    """

    def __init__(self, desktop: OsworldDesktop, files: Path | None) -> None:
        super().__init__(desktop.env, files, cast(Any, desktop.env).cache, desktop.password)
        self._desktop.machine_name = desktop.machine_name
        self._makes_history = False  # where there is an internet, OSWorld downloads that file
        self._episode = ""
        self.was_not_reverted = False
        self.hung_in_judging = False

    def reset(self, task: Any, seed: int) -> Setting:
        """Set up a task on a machine that no episode has used since it was reverted.

        Raises:
            DesktopError: The machine was not reverted, or a step of the setup failed.
        """
        self.hung_in_judging = False
        try:
            setting = super().reset(task, seed)
        except DesktopError:
            with contextlib.suppress(DesktopError):  # the first error is the one to raise
                self._mark_episode()
            raise
        # OSWorld's providers do not look at the outcome of a revert: without the snapshot, vmrun
        # fails and the machine goes on as the last episode left it.
        self.was_not_reverted = self._mark_episode() == "used"
        if self.was_not_reverted:
            raise DesktopError(
                f"{self._desktop.machine_name} was not reverted: {EPISODE_MARK}, which the last"
                " episode left there, still exists; is its snapshot missing"
                " (--vm-option snapshot_name=NAME), or does --reset-command keep the disk?"
            )
        return setting

    def evaluate(self, history: Sequence[str]) -> Verdict:
        """Return OSWorld's own score of the machine that this episode was played on.

        Raises:
            DesktopError: The machine was reverted meanwhile, or another run used it.
            DesktopTimeoutError: The evaluator did not end in its time.
        """
        try:
            verdict = super().evaluate(history)
        except DesktopTimeoutError:
            self.hung_in_judging = True
            raise
        result = self._desktop.execute(["cat", EPISODE_MARK])
        if result.output.strip() != self._episode:
            raise DesktopError(
                f"{self._desktop.machine_name} was reverted, or used by another run, during the"
                f" episode: {EPISODE_MARK} is not as the episode's start left it; use each machine"
                " in one run at a time, and let --reset-command revert AGENTHIJACK_VM only"
            )
        return verdict

    def _mark_episode(self) -> str:
        """Leave the mark of an episode; return `marked`, or `used` if there was one.

        Raises:
            DesktopError: It cannot be written.
        """
        self._episode = secrets.token_hex(8)
        mark = ["sh", "-c", MARK_EPISODE, "sh", EPISODE_MARK, self._episode]
        result = self._desktop.execute(mark)
        if not result.ok or not result.output.strip():
            raise DesktopError(
                f"{EPISODE_MARK} can't be written in the guest: {result.error.strip()[-200:]}"
            )
        return result.output.strip()


def _find(task: object, seed: int) -> OsworldFileTask:
    file_task = tasks.get(task, seed) if isinstance(task, str) else task
    if not isinstance(file_task, OsworldFileTask):
        raise ParameterTypeError(f"a task of OSWorld is wanted, got {task!r:.80}")
    return file_task


@contextlib.contextmanager
def osworld_stage(
    size: Size, files: Path | None, machine: AbstractContextManager[Desktop] | None = None
) -> Generator[OsworldTasks]:
    """Yield OSWorld's environment with its tasks.

    Args:
        size: `(height, width)` of the screen in pixels.
        files: OSWorld's file cache, which is only read.
        machine: Yields the machine, over OSWorld's environment; an embedded desktop by default.

    Raises:
        ParameterError: The machine is a desktop without OSWorld's environment.
    """
    if machine is not None:
        with machine as desktop:
            if not isinstance(desktop, OsworldDesktop):
                raise ParameterError(
                    "desktop.provider: OSWorld's tasks need a provider that yields an"
                    f" OsworldDesktop, and this one yields {type(desktop).__name__}"
                )
            yield MachineTasks(desktop, files)
        return
    with tempfile.TemporaryDirectory(prefix="agenthijack-osworld-") as scratch:
        cache = Path(scratch)
        with embedded_env(cache=cache, size=size) as env:
            yield OsworldTasks(env, files, cache)
