"""Agents in processes of their own: one that hangs, dies or forks costs its row, not the run.

A worker opens the dataset, makes its agent, and answers rows; it says which ones right before the
agent is asked, and from then on the clock of the time-out runs. A worker that is late or dead is
ended with all it started, the rows that it was asked get a record as an error of the agent, and
another worker takes over. Rows of a batch that failed are put to the agent again, one by one.
"""

import contextlib
import multiprocessing
import multiprocessing.connection
import os
import signal
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

from hijack_data.errors import HijackError

from ..bench.reading import ResultRecord
from . import serving
from .asking import Asking, blank, failure
from .cases import Case

START_LIMIT = 900.0  # s until an agent is made: weights of a model may be large
MARGIN = 30.0  # s that a worker may need to read a row
TICK = 0.5  # s between two looks at the clock
CHUNK = 16  # rows that a worker is given at a time: as many as a row group of a dataset
LOST = 3  # workers that may die without having asked their agent
Listener: TypeAlias = Callable[[str], object]


class AgentStartError(HijackError, RuntimeError):
    """An agent that cannot be made, or whose process dies before it answers anything."""


@dataclass
class Share:
    """Rows that a worker is to answer; `single` if a batch with them failed."""

    cases: deque[Case]
    single: bool = False


@dataclass
class _Worker:
    """One process, and what it is at."""

    process: Any
    connection: Any
    share: Share | None = None
    asked: list[Case] = field(default_factory=list[Case])
    ready: bool = False
    deadline: float = 0.0

    @property
    def idle(self) -> bool:
        return self.ready and self.share is None


class WorkerPool:
    """Processes that put rows to one agent each; use it in a `with` statement.

    Args:
        folder: the dataset.
        asking: how rows are put to the agent.
        count: how many processes.
        timeout: seconds an agent has for a row.
        notice: called with what a user should know.
    """

    def __init__(
        self, folder: Path, asking: Asking, *, count: int, timeout: float, notice: Listener
    ) -> None:
        self._folder = folder
        self._asking = asking
        self._count = count
        self._timeout = timeout
        self._notice = notice
        self._context = multiprocessing.get_context("spawn")
        self._workers: list[_Worker] = []
        self._shares: deque[Share] = deque()
        self._found: deque[tuple[Case, ResultRecord]] = deque()
        self._left = 0
        self._lost = 0
        self._noticed: set[str] = set()

    def __enter__(self) -> "WorkerPool":
        return self

    def __exit__(self, *_: object) -> None:
        for worker in self._workers:
            _end(worker)
        self._workers.clear()

    def run(self, cases: Sequence[Case]) -> Iterator[tuple[Case, ResultRecord]]:
        """Yield the record of each case, as they come.

        Raises:
            AgentStartError: the agent cannot be made, or its process dies without an answer.
        """
        self._shares.extend(_shares(cases))
        self._left = len(cases)
        while self._left:
            self._hand_out()
            self._listen()
            while self._found:
                self._left -= 1
                yield self._found.popleft()

    def _hand_out(self) -> None:
        """Give shares to idle workers, and start workers for the others."""
        for worker in self._workers:
            if worker.idle and self._shares:
                self._give(worker, self._shares.popleft())
        starting = sum(not worker.ready for worker in self._workers)
        room = self._count - len(self._workers)
        for _ in range(min(room, len(self._shares) - starting)):
            self._workers.append(self._started())

    def _give(self, worker: _Worker, share: Share) -> None:
        worker.share = share
        worker.deadline = time.monotonic() + MARGIN
        with contextlib.suppress(OSError):  # it died: the next look finds out
            worker.connection.send((tuple(share.cases), share.single))

    def _started(self) -> _Worker:
        ours, theirs = self._context.Pipe()
        process = self._context.Process(
            target=serving.serve,
            args=(theirs, self._folder, self._asking, list(sys.path)),
            daemon=False,
        )
        process.start()
        theirs.close()
        return _Worker(process, ours, deadline=time.monotonic() + START_LIMIT)

    def _listen(self) -> None:
        """Take what the workers say, and end those that are late or dead."""
        connections = [worker.connection for worker in self._workers]
        said = multiprocessing.connection.wait(connections, TICK)
        for worker in list(self._workers):
            alive = worker.process.is_alive()  # before its last words are read
            if worker.connection in said or not alive:
                self._read(worker)
            if not alive:
                self._died(worker)
            elif time.monotonic() > worker.deadline and worker.share is not None:
                self._late(worker)
            elif time.monotonic() > worker.deadline and not worker.ready:
                raise AgentStartError(f"{self._asking.agent}: is not made within {START_LIMIT:g} s")

    def _read(self, worker: _Worker) -> None:
        try:
            while worker.connection.poll():
                self._take(worker, *worker.connection.recv())
        except (EOFError, OSError):
            return

    def _take(self, worker: _Worker, kind: str, value: Any) -> None:
        share = worker.share
        if kind == "failed":
            raise AgentStartError(f"{self._asking.agent}: cannot be made: {value}")
        if kind == "ready":
            worker.ready = True
            worker.deadline = float("inf")
        elif kind == "notice":
            self._tell(value)
        elif share is None:
            return
        elif kind == "asks":
            worker.asked = [share.cases[index] for index in range(value)]
            worker.deadline = time.monotonic() + self._timeout * value
        elif kind == "records":
            self._answered(worker, share, value)
        elif kind == "batch failed":
            self._again(worker, share, value)

    def _answered(self, worker: _Worker, share: Share, records: Sequence[ResultRecord]) -> None:
        for record in records:
            self._found.append((share.cases.popleft(), record))
        self._lost = 0
        self._next(worker, share)

    def _again(self, worker: _Worker, share: Share, problem: str) -> None:
        """Let the rows of a batch be asked one by one."""
        self._tell(f"predict_batch fails, so its rows are asked one by one: {problem}")
        self._split(worker, share)
        self._next(worker, share)

    def _split(self, worker: _Worker, share: Share) -> None:
        """Move the rows that a worker was asked into a share of their own."""
        asked = deque(share.cases.popleft() for _ in worker.asked)
        self._shares.appendleft(Share(asked, single=True))

    def _next(self, worker: _Worker, share: Share) -> None:
        worker.asked = []
        worker.deadline = time.monotonic() + MARGIN
        if not share.cases:
            worker.share = None
            worker.deadline = float("inf")

    def _late(self, worker: _Worker) -> None:
        self._read(worker)
        if time.monotonic() <= worker.deadline:
            return
        if worker.asked:
            self._fail(worker, f"gave no answer within {self._timeout:g} s (--timeout)")
        else:
            self._lose(worker, f"reads no row within {MARGIN:g} s")

    def _died(self, worker: _Worker) -> None:
        ending = f"its process died (exit code {worker.process.exitcode})"
        if worker.asked:
            self._fail(worker, ending)
        else:
            self._lose(worker, ending)

    def _fail(self, worker: _Worker, problem: str) -> None:
        """Record that the agent failed at what it was asked, and go on without the worker."""
        share = worker.share
        self._drop(worker)
        if share is None:
            return
        if len(worker.asked) > 1:
            self._tell(f"predict_batch: {problem}; its rows are asked one by one")
            self._split(worker, share)
        else:
            case = share.cases.popleft()
            record = blank(case, self._asking) | failure(f"the agent: {problem}")
            record["seconds"] = self._timeout if "within" in problem else 0.0
            self._found.append((case, record))
        self._put_back(share)

    def _lose(self, worker: _Worker, problem: str) -> None:
        """Go on without a worker that was lost before it asked its agent."""
        self._drop(worker)
        self._lost += 1
        if not worker.ready or self._lost >= LOST:
            raise AgentStartError(f"{self._asking.agent}: {problem} before the agent was asked")
        if worker.share is not None:
            self._put_back(worker.share)

    def _put_back(self, share: Share) -> None:
        if share.cases:
            self._shares.append(share)

    def _drop(self, worker: _Worker) -> None:
        _end(worker)
        self._workers.remove(worker)

    def _tell(self, text: str) -> None:
        if text not in self._noticed:
            self._noticed.add(text)
            self._notice(f"{self._asking.agent}: {text}")


def _shares(cases: Sequence[Case]) -> Iterator[Share]:
    for start in range(0, len(cases), CHUNK):
        yield Share(deque(cases[start : start + CHUNK]))


def _end(worker: _Worker) -> None:
    """Kill a worker with all that its agent started."""
    pid = worker.process.pid
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(pid, signal.SIGKILL)
    worker.process.kill()
    worker.process.join()
    worker.connection.close()
