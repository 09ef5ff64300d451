"""The state shared by all sessions of a server: desktops, draws, leases and counts."""

import contextlib
import itertools
import logging
import threading
import time
from collections.abc import Generator
from dataclasses import dataclass, field

from ..environment import CorruptedEnv, EvalSettings
from .episode_draws import EpisodeChoice, EpisodeDraws
from .metrics import ServerMetrics
from .pool import DesktopPool, DesktopSeat

REAPER_POLLS_PER_LEASE = 4  # checks for silent clients per lease
MIN_POLL_S = 0.2  # least seconds between two checks
SHUTDOWN_TIMEOUT_S = 30.0  # seconds that a running reset or step may take when the server stops

_log = logging.getLogger(__name__)


@dataclass(eq=False)
class DesktopLease:
    """A desktop that a session holds, from a reset to the end of the episode.

    Code that uses the desktop must hold `lock`.

    Args:
        seat: The desktop.
        end_reason: Why the lease has ended; empty while it lasts.
    """

    seat: DesktopSeat
    env: CorruptedEnv | None = None
    end_reason: str = ""
    last_used: float = field(default_factory=time.monotonic)
    lock: threading.RLock = field(default_factory=threading.RLock)

    @contextlib.contextmanager
    def locked(self) -> Generator[None]:
        """Lock the desktop for the block; the client counts as silent from its end."""
        with self.lock:
            try:
                yield
            finally:
                self.last_used = time.monotonic()


class DesktopService:
    """The shared part of a server; call `start` before the first session, and `close` at the end.

    Args:
        pool: The desktops.
        draws: The object that decides what resets play.
        settings: The settings of all episodes.
        lease: Seconds of silence after which a client loses its desktop.
        metrics: The counters.
    """

    def __init__(
        self,
        pool: DesktopPool,
        draws: EpisodeDraws,
        settings: EvalSettings,
        *,
        lease: float,
        metrics: ServerMetrics | None = None,
    ) -> None:
        self.pool = pool
        self.draws = draws
        self.settings = settings
        self.lease = lease
        self.splits = draws.sides
        self.metrics = metrics or ServerMetrics(pool)
        self._numbers = itertools.count(1)
        self._leases: set[DesktopLease] = set()
        self._lock = threading.Lock()
        self._ending = threading.Event()
        self._reaper = threading.Thread(target=self._reap, name="leases", daemon=True)

    def start(self) -> None:
        """Start the desktops, and begin to check for silent clients.

        Raises:
            DesktopError: A desktop does not start.
        """
        self.pool.start()
        self._reaper.start()

    def close(self) -> None:
        """End the desktops; calling this twice is allowed.

        Running resets and steps end first: otherwise a desktop that is being reset would start
        another one after its end.
        """
        self._ending.set()
        self.pool.stop_lending()
        with self._lock:
            leases = list(self._leases)
        for lease in leases:
            if lease.lock.acquire(timeout=SHUTDOWN_TIMEOUT_S):
                lease.lock.release()
        self.pool.close()
        if self._reaper.is_alive():
            self._reaper.join()

    def new_session(self) -> int:
        """Return the number of a new session, from 1."""
        return next(self._numbers)

    def lend(self) -> DesktopLease:
        """Lend a desktop for an episode.

        Raises:
            ServerBusyError: No desktop is free.
        """
        with self.metrics.waiting():
            lease = DesktopLease(self.pool.take())
        with self._lock:
            self._leases.add(lease)
        return lease

    def end(self, lease: DesktopLease, reason: str, *, is_broken: bool = False) -> None:
        """End a lease; the desktop goes back to the pool, or is replaced if it is broken.

        The caller must hold the lease's lock. Later calls do nothing.
        """
        if lease.end_reason:
            return
        lease.end_reason = reason
        with self._lock:
            self._leases.discard(lease)
        if is_broken:
            self.pool.replace(lease.seat)
        else:
            self.pool.give_back(lease.seat)

    def break_off(self, lease: DesktopLease, reason: str) -> None:
        """End a lease and the episode on it, because the client left, or is silent.

        If episodes are logged, an episode in which the agent has acted is judged in its present
        state.
        """
        with lease.lock:
            if lease.end_reason:
                return
            is_broken = True  # assumed to be broken until it has shown that it is not
            try:
                self._finish(lease, reason)
                is_broken = not lease.seat.is_alive()
            finally:
                self.end(lease, reason, is_broken=is_broken)
            self.metrics.broken_off.inc()

    def _finish(self, lease: DesktopLease, reason: str) -> None:
        """End the episode on a lent desktop."""
        env = lease.env
        if env is None or env.record is not None:
            return
        if self.settings.log is not None:
            env.truncate()
        if env.record is None:
            env.abandon(reason)

    def environment(self, lease: DesktopLease, session: int) -> CorruptedEnv:
        """Return an environment for one episode on a lent desktop."""
        lease.env = CorruptedEnv(
            lease.seat.stage,
            settings=self.settings,
            # Two sessions may play the same episode at the same time, so each has its own folder of
            # logs.
            agent=f"{self.settings.agent}-{session}",
        )
        return lease.env

    def options(self, choice: EpisodeChoice) -> dict[str, object]:
        """Return the options of the environment's `reset`."""
        return {"task": choice.task, "corruption": choice.planner, "label": choice.label}

    def _reap(self) -> None:
        """Take back the desktops of silent clients."""
        pause = max(MIN_POLL_S, self.lease / REAPER_POLLS_PER_LEASE)
        while not self._ending.wait(pause):
            with self._lock:
                leases = list(self._leases)
            for lease in leases:
                try:
                    self._take_back(lease)
                except Exception:  # noqa: BLE001  (the other leases have to end as well)
                    _log.exception("the desktop of a silent client could not be put back")

    def _take_back(self, lease: DesktopLease) -> None:
        if not lease.lock.acquire(blocking=False):
            return  # the client is taking a step
        try:
            silent = time.monotonic() - lease.last_used
            if lease.end_reason or silent < self.lease:
                return
            self.metrics.expired.inc()
            self.break_off(lease, f"the client said nothing for {silent:.0f} s")
        finally:
            lease.lock.release()
