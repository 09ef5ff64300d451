"""Processes that play episodes side by side, each with its own desktop.

If a process dies, only the episode that it was playing is lost: the next episode starts another
process. Processes end with the runner, even if it is killed.
"""

import contextlib
import math
import multiprocessing
import pickle
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterable
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import NamedTuple, NoReturn

from hijack_data.errors import HijackError
from hijack_data.loading import find_loaded_file, load_reference

from ..agents.makers import FileAgentMaker
from ..agents.references import AgentReference
from ..agents.registry import AGENTS
from ..desktops.protocol import Desktop
from ..environment.stage import TaskStage
from ..results.origin import available_memory, usable_cores
from ..results.records import ResultRecord
from ..tasks import TASKS, find_family
from .config import Bench, is_from_data
from .episodes import LiveEpisodes, lost_record
from .jobs import Job
from .models import ModelOptions, prepare
from .providers import BROWSER, PROVIDERS

CORES_PER_DESKTOP = 1  # cores that a desktop needs
BYTES_PER_DESKTOP = 1536 * 2**20  # for a desktop, its standby and an office program
SHUTDOWN_TIMEOUT_S = 20.0  # seconds for a process to end its desktop
MACHINE_SHUTDOWN_TIMEOUT_S = 200.0  # the same, for a machine that OSWorld's provider started


class ForeignEntry(NamedTuple):
    """A plug-in that a process must load: its registry, its name there, and its reference.

    An agent that has a process of its own is registered as its `AgentReference`, and not loaded.
    """

    kind: str
    name: str
    reference: str | AgentReference


@dataclass(frozen=True, kw_only=True)
class WorkerSetup:
    """The settings for a process that plays the episodes of a run.

    Args:
        bench: The benchmark.
        folder: The folder of the run.
        references: The agents, tasks and providers from outside the library, which are loaded
            first.
        models: The options of the command line about models.
    """

    bench: Bench
    folder: Path
    references: tuple[ForeignEntry, ...] = ()
    models: ModelOptions = field(default_factory=ModelOptions)


def references(bench: Bench) -> tuple[ForeignEntry, ...]:
    """Return references to the agents, tasks and provider of a run from outside the library."""
    entries: list[ForeignEntry] = []
    for registry, name, entry in bench.foreign():
        file = find_loaded_file(entry)
        if isinstance(entry, FileAgentMaker):
            entries.append(ForeignEntry(registry.kind, name, name))
        elif isinstance(entry, AgentReference):
            entries.append(ForeignEntry(registry.kind, name, entry))
        elif is_from_data(entry):
            entries.append(ForeignEntry(registry.kind, name, entry.source["path"]))
        else:
            source = entry.__module__ if file is None else file.path
            entries.append(ForeignEntry(registry.kind, name, f"{source}:{entry.__qualname__}"))
    return tuple(entries)


def default_desktops() -> int:
    """Return how many desktops this machine can run side by side, by cores and free memory."""
    cores = usable_cores()
    return max(1, desktops_in(cores, available_memory()))


def desktops_in(cores: float, memory: float) -> int:
    """Return how many desktops fit on a machine.

    Args:
        cores: Its processors.
        memory: The bytes of memory available for them.
    """
    return math.floor(min(cores / CORES_PER_DESKTOP, memory / BYTES_PER_DESKTOP))


class LocalPool:
    """An `EpisodePool` with one process of this machine for each thread that plays episodes.

    An episode is played in the process of the calling thread, which is started with its first one.

    Args:
        setup: What the processes need.
        desktops: How many threads call it.
        serve: The function that a process runs; tests replace it.
    """

    def __init__(
        self,
        setup: WorkerSetup,
        desktops: int = 1,
        serve: Callable[[Connection, WorkerSetup], None] | None = None,
    ) -> None:
        self.desktops = desktops
        self.max_episodes = desktops
        self._setup = setup
        self._serve = serve or serve_episodes
        self._local = threading.local()
        self._workers: list[EpisodeWorker] = []

    def __enter__(self) -> "LocalPool":
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def reserve(self) -> AbstractContextManager[object]:
        """Return at once, since each thread has its own process."""
        return nullcontext()

    def stop(self) -> None:
        """End all processes; those that play break their episodes off."""
        for worker in self._workers:
            worker.close()

    def __call__(self, job: Job, attempt: int) -> ResultRecord:
        """Play an episode.

        If the process ends over it, the record is an error of the machine's, which is tried again.
        Errors that refuse the episode are raised here as they were there.
        """
        worker: EpisodeWorker | None = getattr(self._local, "worker", None)
        if worker is None or not worker.alive:
            worker = EpisodeWorker(self._setup, self._serve)
            self._local.worker = worker
            self._workers.append(worker)
        # A monotonic clock, so that setting the time does not change durations.
        start = time.monotonic()
        try:
            return worker.play(job, attempt)
        except (EOFError, OSError) as error:
            worker.close()
            problem = f"the process that played the episode ended (exit code {worker.code})"
            problem = f"{problem}: {error}".rstrip(": ")
            return lost_record(job, attempt, problem, start=start)


class EpisodeWorker:
    """One process and the connection to it.

    Args:
        setup: What the process needs.
        serve: The function that it runs.
    """

    def __init__(
        self, setup: WorkerSetup, serve: Callable[[Connection, WorkerSetup], None]
    ) -> None:
        context = multiprocessing.get_context("spawn")
        self._connection, child_end = context.Pipe()
        self._busy = False
        self._shutdown_timeout = SHUTDOWN_TIMEOUT_S
        if setup.bench.machines is not None:
            self._shutdown_timeout = MACHINE_SHUTDOWN_TIMEOUT_S
        self._process: SpawnProcess = context.Process(
            target=serve, args=(child_end, setup), name="episodes"
        )
        self._process.start()
        child_end.close()
        self._ready = False

    @property
    def alive(self) -> bool:
        """Whether the process runs."""
        return self._process.is_alive()

    @property
    def code(self) -> int | None:
        """The exit code of the process; negative for a signal."""
        return self._process.exitcode

    def play(self, job: Job, attempt: int) -> ResultRecord:
        """Let the process play an episode.

        Raises:
            EOFError: The process died.
            OSError: The process died while it was written to.
        """
        self.wait_until_ready()
        self._busy = True
        self._connection.send((job, attempt))
        record = self._receive()
        self._busy = False
        return record

    def wait_until_ready(self) -> None:
        """Wait until the process has its desktop.

        Raises:
            EOFError: The process died.
        """
        if not self._ready:
            self._busy = True
            self._receive()
            self._ready = True
            self._busy = False

    def _receive(self) -> ResultRecord:
        record, raised = self._connection.recv()
        if raised is not None:
            raise raised
        return record

    def close(self) -> None:
        """End the process; it ends its desktop."""
        if self._busy:
            self._process.terminate()
        else:
            self._connection.close()
        self._process.join(self._shutdown_timeout)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


def serve_episodes(
    connection: Connection,
    setup: WorkerSetup,
    answer_all: Callable[[Connection, LiveEpisodes], None] | None = None,
) -> None:
    """Play the episodes that come over a connection, on a desktop of this process."""
    from ..embedded.runtime import kernel

    kernel.die_with_parent()
    runner = multiprocessing.parent_process()
    if runner is not None and not runner.is_alive():
        return  # the runner was killed while this process started
    try:
        _serve(connection, setup, answer_all or answer_calls)
    except Exception as error:  # noqa: BLE001  (the runner is to raise it)
        with contextlib.suppress(OSError):  # the runner is gone
            connection.send((None, picklable_error(error)))


def _serve(
    connection: Connection,
    setup: WorkerSetup,
    answer_all: Callable[[Connection, LiveEpisodes], None],
) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the runner handles Ctrl-C and ends this process
    signal.signal(signal.SIGTERM, _leave)
    with live_episodes(setup) as episodes:
        answer_all(connection, episodes)


@contextmanager
def live_episodes(setup: WorkerSetup) -> Generator[LiveEpisodes]:
    """Start a desktop in this process, and yield a function that plays episodes on it."""
    load_references(setup.references)
    prepare(setup.bench, setup.models, setup.folder)
    with (
        open_stage(setup.bench, setup.folder) as stage,
        LiveEpisodes(setup.bench, setup.folder, stage) as episodes,
    ):
        yield episodes


@contextmanager
def open_stage(bench: Bench, folder: Path | None) -> Generator[TaskStage]:
    """Start a desktop in this process, and yield it with the tasks of a benchmark.

    Args:
        bench: The benchmark.
        folder: The folder of the run, which the desktop must not see; `None` for none.
    """
    from ..embedded.runtime import hidden_folders
    from ..environment import SmallTasks

    if folder is not None:
        hidden_folders.hide(folder)
    family = find_family(bench.tasks)
    if family is not None:
        with family.open_stage(bench.size, bench.files, _machine(bench, family.provider)) as stage:
            yield stage
        return
    if bench.provider == BROWSER:
        from ..browser.site_tasks import open_site_tasks

        with contextlib.closing(open_site_tasks(bench.size)) as stage:
            yield stage
        return
    with PROVIDERS.get(bench.provider)(bench.size) as desktop:
        yield SmallTasks(desktop)


def _machine(bench: Bench, default: str) -> AbstractContextManager[Desktop] | None:
    """Return what starts the machine of a family's tasks; `None` for its default provider."""
    if bench.machines is not None:
        return PROVIDERS.get(bench.provider)(bench.size, bench.machines)
    return None if bench.provider == default else PROVIDERS.get(bench.provider)(bench.size)


def answer_calls(connection: Connection, episode: Callable[[Job, int], ResultRecord]) -> None:
    """Report that all is ready, then play the requested episodes until the connection is closed."""
    connection.send((None, None))
    with contextlib.suppress(EOFError, OSError):
        while True:
            job, attempt = connection.recv()
            connection.send(answer(episode, job, attempt))


def load_references(references: Iterable[ForeignEntry]) -> None:
    """Load the files and modules of a run in a new process."""
    registries = {registry.kind: registry for registry in (AGENTS, TASKS, PROVIDERS)}
    for kind, name, reference in references:
        registry = registries[kind]
        if isinstance(reference, AgentReference):
            registry.add(reference, name)
        elif (
            registry is not PROVIDERS and registry.is_reference(reference) and ":" not in reference
        ):
            registry.find(reference)  # an agent file, or a task file
        elif name not in registry.names():
            registry.add(load_reference(reference), name)


def _leave(*_: object) -> NoReturn:
    """End this process as at the end of a run: its desktop is taken down.

    Raises:
        SystemExit: Always.
    """
    raise SystemExit(1)


def answer(
    episode: Callable[[Job, int], ResultRecord], job: Job, attempt: int
) -> tuple[ResultRecord | None, Exception | None]:
    """Play an episode; return its record, or the error that refuses it, fit to be sent."""
    try:
        return episode(job, attempt), None
    except Exception as error:  # noqa: BLE001  (the runner raises what refuses the episode)
        return None, picklable_error(error)


def picklable_error(error: Exception) -> Exception:
    """Return an exception that can be pickled: the same one, or another with its text."""
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301  (it was made right here)
    except Exception:  # noqa: BLE001  (an exception may do anything when it is pickled)
        return HijackError(f"{type(error).__name__}: {error}")
    return error
