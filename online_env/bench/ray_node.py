"""One desktop on a node of a Ray cluster: the actor that plays episodes on it.

Ray ends an actor with its node's `raylet` and with the runner, and the desktop's keeper ends the
desktop with the actor. Episodes are written to a private folder of the node and sent from there.
"""

import contextlib
import importlib
import os
import shutil
import signal
import socket
import tempfile
import time
from collections.abc import Generator, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hijack_data.locking import LockedError, lock

from ..results.records import ResultRecord
from .episode_files import take_files
from .episodes import LiveEpisodes
from .jobs import Job
from .providers import check_installed
from .worker_bundle import WorkerBundle, unpack
from .workers import answer, live_episodes, picklable_error

PREFIX = "agenthijack-ray-"
LOCK_DELAY_S = 60.0  # seconds during which a new folder may not be locked yet


@dataclass(frozen=True, kw_only=True)
class NodeReport:
    """Where an actor runs, and why it cannot play, if so.

    Args:
        host: The name of the machine.
        node: Ray's id of the node.
        problem: The error that was raised, if any.
    """

    host: str
    node: str
    problem: Exception | None = None


@dataclass(frozen=True, kw_only=True)
class EpisodeEnd:
    """The end of an episode's stream: its record, or the error that refuses it."""

    record: ResultRecord | None = None
    problem: Exception | None = None


class NodeDesktop:
    """A Ray actor that plays episodes, one after the other, on its own desktop."""

    def __init__(self) -> None:
        self._stack = contextlib.ExitStack()
        self._folder = Path()
        self._episodes: LiveEpisodes | None = None

    def begin(self, parcel: WorkerBundle) -> NodeReport:
        """Start the desktop."""
        ray: Any = importlib.import_module("ray")
        report = NodeReport(host=socket.gethostname(), node=ray.get_runtime_context().get_node_id())
        # Ray blocks SIGINT, and the programs of a desktop would inherit that.
        signal.signal(signal.SIGINT, lambda *_: None)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        try:
            folder = self._stack.enter_context(node_folder())
            setup = unpack(parcel, folder)
            check_installed(setup.bench.provider, setup.bench.tasks)
            self._folder = setup.folder
            self._episodes = self._stack.enter_context(live_episodes(setup))
        except Exception as error:  # noqa: BLE001  (the runner raises it)
            self._stack.close()
            return replace(report, problem=picklable_error(error))
        return report

    def ping(self) -> None:
        """Answer, to show that the actor is alive."""

    def play(self, job: Job, attempt: int) -> Iterator[tuple[str, Any]]:
        """Play an episode; yield its files by name, and finally an `EpisodeEnd` without a name."""
        if self._episodes is None:
            raise RuntimeError("begin was not called")
        record, problem = answer(self._episodes, job, attempt)
        yield from take_files(self._folder)
        yield "", EpisodeEnd(record=record, problem=problem)

    def end(self) -> None:
        """Take the desktop down."""
        self._stack.close()


@contextlib.contextmanager
def node_folder() -> Generator[Path]:
    """Yield a private folder, removed afterwards; also remove the folders of killed actors."""
    _sweep(Path(tempfile.gettempdir()))
    folder = Path(tempfile.mkdtemp(prefix=PREFIX))
    try:
        with lock(folder):
            yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _sweep(parent: Path) -> None:
    for folder in parent.glob(f"{PREFIX}*"):
        with contextlib.suppress(OSError, LockedError):
            state = folder.lstat()
            is_old = time.time() - state.st_mtime > LOCK_DELAY_S
            if state.st_uid == os.getuid() and is_old:
                with lock(folder):
                    shutil.rmtree(folder, ignore_errors=True)
