"""Tasks of OSWorld in a benchmark: judged by OSWorld's evaluators, on embedded desktops.

`--tasks evaluation_examples/examples/os/e0df059f-....json` names one task by its file, and a folder
of them all in it.
"""

import contextlib
import hashlib
import shutil
import tempfile
import time
from collections.abc import Generator, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, ClassVar

from hijack_data.errors import ConfigError, ParameterTypeError, some_of
from hijack_data.file_io import read_regular
from hijack_data.types import Size

from .. import tasks
from ..environment.stage import Setting, TaskHolder
from ..errors import DesktopError, MissingPackageError
from ..tasks.base import Task
from ..tasks.hand import Hand
from ..tasks.machine import Machine
from . import history, venv
from .cache_files import list_cache_files
from .env import OsworldEnv
from .player import Player
from .run import checker, embedded_env
from .solutions import SOLUTIONS
from .stage import OsworldStage
from .tasks import OsworldTask, load_file


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
        """Play the script of the self-test, if it uses windows, or find the task infeasible.

        Raises:
            DesktopError: There is no such script.
        """
        if self.infeasible:
            hand.give_up("OSWorld says that this cannot be done")
        solution = SOLUTIONS.get(self.name)
        if solution is None or solution.how != "windows":
            raise DesktopError(f"no script solves OSWorld's task {self.name} through windows")
        solution.play(Player(_OracleEnv(hand)))


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


def task_class(path: str) -> type[OsworldFileTask]:
    """Return the class of the task in a file.

    Raises:
        ConfigError: The file cannot be read, or holds no task of OSWorld.
    """
    task = load_file(Path(path))
    place = task.path.resolve()
    body = {
        "name": task.id,
        "domain": task.domain,
        "apps": task.apps,
        "infeasible": "" if task.feasible else "OSWorld calls it infeasible",
        "file": task,
        "source": {"path": str(place), "sha256": hashlib.sha256(read_regular(place)).hexdigest()},
        "__module__": __name__,
        "__qualname__": f"OsworldFileTask[{place}]",
    }
    return type("OsworldFileTask", (OsworldFileTask,), body)


def check_runnable(
    listed: Iterable[OsworldTask], files: Path | None, folder: Path = venv.DEFAULT
) -> None:
    """Check that OSWorld's evaluators and files for some tasks are here.

    Args:
        listed: The tasks.
        files: OSWorld's file cache, as `hijack osworld prefetch` fills it.
        folder: OSWorld's Python environment.

    Raises:
        MissingPackageError: The environment is not there, or lacks packages.
        ConfigError: Files are missing.
    """
    listed = tuple(listed)
    with checker(folder) as check:
        if check is None:
            raise MissingPackageError(
                f"{folder}: OSWorld's Python environment is not there: hijack osworld setup"
            )
        refused = {task.id: check(task.config) for task in listed}
    lacking = {task: reasons[0] for task, reasons in refused.items() if reasons}
    if lacking:
        raise MissingPackageError(
            f"{len(lacking)} tasks cannot be evaluated here ({some_of(_lines(lacking), 3)}): hijack"
            " osworld setup --tier mid, or leave them out with --tasks"
        )
    absent = {
        task.id: file.path
        for task in listed
        for file in list_cache_files(task)
        if not history.is_made(task) and not (files is not None and (files / file.path).is_file())
    }
    if absent:
        raise ConfigError(
            [
                f"{len(absent)} tasks need files that are not in"
                f" {files or 'a cache'} ({some_of(_lines(absent), 3)}):"
                " hijack osworld prefetch TASKS --out CACHE on a connected machine, then"
                " --osworld-files CACHE"
            ]
        )


def _lines(reasons: Mapping[str, str]) -> list[str]:
    return [f"{task[:8]}: {reason}" for task, reason in reasons.items()]


class OsworldTasks(TaskHolder, OsworldStage):
    """OSWorld's tasks by the names of a benchmark.

    Args:
        env: OSWorld's environment.
        files: OSWorld's file cache, which is only read; `None` if no task needs files.
        cache: The cache of `env`. What an evaluator left there for an earlier episode is removed.
    """

    def __init__(self, env: OsworldEnv, files: Path | None, cache: Path) -> None:
        super().__init__(env)
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
        history.provide(self._osworld, [task], self._cache)


def _find(task: object, seed: int) -> OsworldFileTask:
    file_task = tasks.get(task, seed) if isinstance(task, str) else task
    if not isinstance(file_task, OsworldFileTask):
        raise ParameterTypeError(f"a task of OSWorld is wanted, got {task!r:.80}")
    return file_task


@contextlib.contextmanager
def osworld_stage(size: Size, files: Path | None) -> Generator[OsworldTasks]:
    """Yield OSWorld's environment on an embedded desktop, with a cache of its own.

    Args:
        size: `(height, width)` of the screen in pixels.
        files: OSWorld's file cache, which is only read.
    """
    with tempfile.TemporaryDirectory(prefix="agenthijack-osworld-") as scratch:
        cache = Path(scratch)
        with embedded_env(cache=cache, size=size) as env:
            yield OsworldTasks(env, files, cache)
