"""The machines of a user, on which episodes are played side by side, with failover.

A machine that does not start, or fails twice in a row, is taken out; its episode is played again on
another one, as another attempt. The run ends when none is left, and `--resume` goes on. A task
whose judging hangs counts against a machine once, and against none once it hung on two.
"""

import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection

from ..errors import DesktopError
from ..results.records import ResultRecord
from ..tasks.machines import MachineSettings
from .episodes import LiveEpisodes, lost_record
from .jobs import Job
from .workers import EpisodeWorker, WorkerSetup, answer_calls, serve_episodes

MAX_FAILURES = 2  # failures of a machine in a row until it is taken out


class MachineFailureError(DesktopError):
    """A machine failed during an episode.

    Args:
        record: That of the episode.
        hung_in_judging: Whether judging the task did not end in its time.
    """

    def __init__(self, record: ResultRecord, hung_in_judging: bool = False) -> None:
        self.record = record
        self.hung_in_judging = hung_in_judging
        super().__init__(record, hung_in_judging)

    def __str__(self) -> str:
        return str(self.record.get("problem"))


@dataclass(eq=False)
class _Seat:
    """A machine, the process that plays on it, and its failures in a row."""

    settings: MachineSettings
    worker: EpisodeWorker | None = None
    failures: int = 0

    @property
    def name(self) -> str:
        return self.settings.vm[0]


class MachinePool:
    """An `EpisodePool` with one process of this machine for each machine of the user.

    Args:
        setup: What the processes need; its benchmark names the machines.
        desktops: How many machines play at most; all by default.
        notice: Called with a line for the user when a machine is taken out.
        serve: The function that a process runs; tests replace it.
    """

    def __init__(
        self,
        setup: WorkerSetup,
        desktops: int,
        notice: Callable[[str], object] = lambda _: None,
        serve: Callable[[Connection, WorkerSetup], None] | None = None,
    ) -> None:
        machines = setup.bench.machines or MachineSettings()
        seats = [_Seat(settings) for settings in machines.single_machines()]
        self.desktops = self.max_episodes = min(desktops, len(seats))
        self._setup = setup
        self._serve = serve or serve_machine
        self._notice = notice
        self._changed = threading.Condition()
        self._free = seats  # more than play at once: the others stand by
        self._in_use: set[_Seat] = set()
        self._lost: dict[str, str] = {}
        self._hung: dict[str, list[_Seat]] = {}  # by task
        self._stopped = False
        self._local = threading.local()

    def __enter__(self) -> "MachinePool":
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @contextmanager
    def reserve(self) -> Generator[None]:
        """Wait for a machine that is free, and hold it.

        Raises:
            DesktopError: All machines have been taken out.
        """
        self._local.seat = self._take()
        try:
            yield
        finally:
            self._give_back(self._local.seat)
            self._local.seat = None

    def __call__(self, job: Job, attempt: int) -> ResultRecord:
        """Play an episode, within `reserve`; see `EpisodePool`.

        Raises:
            DesktopError: All machines have been taken out.
        """
        while True:
            seat: _Seat = self._local.seat
            try:
                worker = self._ready_worker(seat)
                break
            except (DesktopError, EOFError, OSError) as error:
                self._take_out(seat, f"it does not start: {error}")
                self._local.seat = None  # nothing to give back, should none be left
                self._local.seat = self._take()
        start = time.monotonic()
        hung_in_judging = False
        try:
            record = worker.play(job, attempt)
        except MachineFailureError as error:
            record = error.record
            hung_in_judging = error.hung_in_judging
        except (EOFError, OSError) as error:
            problem = f"the process that played the episode ended (exit code {worker.code})"
            record = lost_record(job, attempt, f"{problem}: {error}".rstrip(": "), start=start)
        else:
            seat.failures = 0
            self._local.failed_seat = None
            return record
        self._local.failed_seat = seat  # the next attempt is for another machine
        self._close_worker(seat)
        self._count_failure(seat, job.task if hung_in_judging else "")
        if seat.failures >= MAX_FAILURES:
            self._take_out(seat, str(record["problem"]))
        desktop = record.get("desktop") or {}
        return {**record, "desktop": {**desktop, "machine": seat.name}}

    def _count_failure(self, seat: _Seat, hung_task: str) -> None:
        """Count a failure of a machine; a task whose judging hung on two machines is at fault.

        Args:
            seat: The machine.
            hung_task: The task whose judging hung; "" for another failure.
        """
        with self._changed:
            seats = self._hung.setdefault(hung_task, []) if hung_task else []
            if seat in seats:
                return
            seats.append(seat)
            if len(seats) == 1:
                seat.failures += 1
            elif len(seats) == 2:
                seats[0].failures = max(0, seats[0].failures - 1)
        if len(seats) == 2:
            names = " and ".join(hung_seat.name for hung_seat in seats)
            self._notice(f"judging {hung_task} hung on {names}: the task is at fault, both play on")

    def stop(self) -> None:
        """End all processes, with the machines that they started."""
        with self._changed:
            self._stopped = True
            seats = [*self._free, *self._in_use]
            self._changed.notify_all()
        threads = [threading.Thread(target=self._close_worker, args=(seat,)) for seat in seats]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()

    def _ready_worker(self, seat: _Seat) -> EpisodeWorker:
        if seat.worker is None or not seat.worker.alive:
            bench = replace(self._setup.bench, machines=seat.settings)
            seat.worker = EpisodeWorker(replace(self._setup, bench=bench), self._serve)
        seat.worker.wait_until_ready()
        return seat.worker

    def _take(self) -> _Seat:
        """Wait for a machine, another one than failed last if there are several; hold it.

        Raises:
            DesktopError: All machines have been taken out, or the run is ending.
        """
        failed_seat: _Seat | None = getattr(self._local, "failed_seat", None)

        def free_seats() -> list[_Seat]:
            others = [seat for seat in self._free if seat is not failed_seat]
            return others or ([] if self._in_use else self._free)

        with self._changed:
            self._changed.wait_for(lambda: free_seats() or not self._in_use or self._stopped)
            if self._stopped:
                raise DesktopError("the run is ending")
            if not self._free:
                reasons = "; ".join(f"{name}: {why}" for name, why in self._lost.items())
                raise DesktopError(
                    f"no machine is left to play on ({reasons}); the episodes that ended are kept,"
                    " --resume goes on"
                )
            # One that stands by is not started while another one is free.
            seat = min(free_seats(), key=lambda seat: seat.worker is None)
            self._free.remove(seat)
            self._in_use.add(seat)
            return seat

    def _give_back(self, seat: _Seat | None) -> None:
        with self._changed:
            if seat in self._in_use:
                self._in_use.discard(seat)
                self._free.append(seat)
            self._changed.notify_all()

    def _take_out(self, seat: _Seat, reason: str) -> None:
        self._close_worker(seat)
        with self._changed:
            self._in_use.discard(seat)
            count = sum(name.split(" #")[0] == seat.name for name in self._lost)
            self._lost[f"{seat.name} #{count + 1}" if count else seat.name] = reason
            remaining = len(self._free) + len(self._in_use)
            self._changed.notify_all()
        self._notice(f"{seat.name} is taken out: {reason} ({remaining} machines left)")

    def _close_worker(self, seat: _Seat) -> None:
        worker, seat.worker = seat.worker, None
        if worker is not None:
            worker.close()


def serve_machine(connection: Connection, setup: WorkerSetup) -> None:
    """Play the episodes that come over a connection, on a machine of the user."""
    serve_episodes(connection, setup, _answer_calls)


def _answer_calls(connection: Connection, episodes: LiveEpisodes) -> None:
    def play(job: Job, attempt: int) -> ResultRecord:
        record = episodes(job, attempt)
        failed_here = record["status"] == "invalid" or record.get("cause") == "machine"
        if failed_here and not episodes.desktop_works():
            raise MachineFailureError(record, episodes.hung_in_judging)
        return record

    answer_calls(connection, play)
