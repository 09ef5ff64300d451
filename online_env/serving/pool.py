"""The desktops of a server: started together, lent for one episode, replaced when they end.

A session that finds no free desktop waits in a queue. The queue is short, and waiting has a limit,
so that a client learns that the server is busy instead of running into its own time-out.
"""

import logging
import math
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass, field
from typing import TypeAlias

from ..environment.stage import Stage
from ..errors import DesktopError
from .errors import ServerBusyError

RESTART_INTERVAL_S = 5.0  # seconds between two tries to replace a desktop that ended
MAX_RETRY_AFTER_S = 300  # the most seconds that a client is told to wait
RECENT_LOANS = 20  # recent loans from which the advised waiting time is computed

# Called without arguments; the stage is there within the context.
StageMaker: TypeAlias = Callable[[], AbstractContextManager[Stage]]

_log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class PoolCounts:
    """The numbers of desktops by state, and of waiting sessions."""

    free: int
    lent: int
    starting: int
    waiting: int


@dataclass(eq=False)
class DesktopSeat:
    """One desktop of the pool.

    Args:
        stage: The desktop with its tasks.
        stack: Ends the desktop.
    """

    stage: Stage
    stack: ExitStack
    lent_at: float = field(default=0.0)

    def is_alive(self) -> bool:
        """Return whether the desktop still shows a screen."""
        try:
            self.stage.desktop.screenshot()
        except DesktopError:
            return False
        return True


class DesktopPool:
    """Lends desktops; safe to call from several threads.

    Args:
        make: Starts a desktop.
        count: How many desktops there are, at least 1.
        line: How many sessions may wait for one.
        wait_timeout: Seconds that a session waits at most.
    """

    def __init__(self, make: StageMaker, *, count: int, line: int, wait_timeout: float) -> None:
        self.count = count
        self.replaced = 0
        self._make = make
        self._line = line
        self._wait_timeout = wait_timeout
        self._changed = threading.Condition()
        self._closing = threading.Event()
        self._free: list[DesktopSeat] = []
        self._lent: set[DesktopSeat] = set()
        self._waiting: deque[object] = deque()
        self._starting: list[threading.Thread] = []
        self._loans: deque[float] = deque(maxlen=RECENT_LOANS)

    def start(self) -> None:
        """Start all desktops side by side, and wait until they are ready.

        Raises:
            DesktopError: One of them does not start; the others are ended.
        """
        failures: list[BaseException] = []

        def begin() -> None:
            try:
                self._add()
            except BaseException as error:  # noqa: BLE001  (raised below, in the calling thread)
                failures.append(error)

        threads = [threading.Thread(target=begin, daemon=True) for _ in range(self.count)]
        for thread in threads:
            thread.start()
        self._starting += threads
        for thread in threads:
            thread.join()
            self._starting.remove(thread)
        if failures:
            self.close()
            raise failures[0]

    def counts(self) -> PoolCounts:
        """Return the current counts."""
        with self._changed:
            free, lent = len(self._free), len(self._lent)
            return PoolCounts(
                free=free,
                lent=lent,
                starting=max(0, self.count - free - lent),
                waiting=len(self._waiting),
            )

    def any_seat(self) -> DesktopSeat:
        """Return a desktop that is free, without lending it.

        Raises:
            DesktopError: None is free.
        """
        with self._changed:
            if not self._free:
                raise DesktopError("no desktop of the server is ready")
            return self._free[0]

    def take(self) -> DesktopSeat:
        """Lend a desktop to the session that has waited longest.

        Raises:
            ServerBusyError: Too many wait already, or none became free in time.
        """
        ticket = object()
        with self._changed:
            if self._closing.is_set():
                raise ServerBusyError("the server is ending", MAX_RETRY_AFTER_S)
            if (self._waiting or not self._free) and len(self._waiting) >= self._line:
                raise self._busy(f"{len(self._waiting)} sessions wait already")
            self._waiting.append(ticket)
            try:
                self._changed.wait_for(lambda: self._may_go(ticket), self._wait_timeout)
            finally:
                is_first = self._waiting[0] is ticket
                self._waiting.remove(ticket)
                self._changed.notify_all()
            if self._closing.is_set():
                raise ServerBusyError("the server is ending", MAX_RETRY_AFTER_S)
            if not is_first or not self._free:
                raise self._busy(f"none became free in {self._wait_timeout:g} s")
            seat = self._free.pop(0)
            seat.lent_at = time.monotonic()
            self._lent.add(seat)
            return seat

    def give_back(self, seat: DesktopSeat) -> None:
        """Take a desktop back; the next reset on it makes it pristine."""
        with self._changed:
            self._lent.discard(seat)
            self._loans.append(time.monotonic() - seat.lent_at)
            self._free.append(seat)
            self._changed.notify_all()

    def replace(self, seat: DesktopSeat) -> None:
        """End a desktop that failed and start another one, in a thread."""
        with self._changed:
            self._lent.discard(seat)
            self.replaced += 1
            if self._closing.is_set():
                seat.stack.close()
                return
            thread = threading.Thread(target=self._replace, args=(seat,), daemon=True)
            self._starting.append(thread)
            thread.start()

    def stop_lending(self) -> None:
        """Lend no desktop from now on, and tell all waiting sessions."""
        with self._changed:
            self._closing.set()
            self._changed.notify_all()

    def close(self) -> None:
        """End all desktops, even lent or starting ones; calling this twice is allowed."""
        self.stop_lending()
        with self._changed:
            seats = [*self._free, *self._lent]
            threads = list(self._starting)
            self._free.clear()
            self._lent.clear()
        enders = [threading.Thread(target=seat.stack.close) for seat in seats]
        for thread in enders:
            thread.start()
        for thread in [*enders, *threads]:
            thread.join()

    def _may_go(self, ticket: object) -> bool:
        if self._closing.is_set():
            return True
        return bool(self._free) and self._waiting[0] is ticket

    def _busy(self, reason: str) -> ServerBusyError:
        """Return the error of a session that gets no desktop."""
        starting = self.count - len(self._free) - len(self._lent)
        state = f"{len(self._lent)} of {self.count} desktops are in use"
        if starting:
            state += f", {starting} are being started"
        mean = sum(self._loans) / len(self._loans) if self._loans else self._wait_timeout
        ahead = len(self._waiting) + 1
        seconds = min(MAX_RETRY_AFTER_S, max(1, math.ceil(mean * ahead / self.count)))
        return ServerBusyError(f"the server is busy: {state}, and {reason}", seconds)

    def _add(self) -> None:
        """Start a desktop and put it among the free ones."""
        with ExitStack() as stack:
            stage = stack.enter_context(self._make())
            seat = DesktopSeat(stage, stack.pop_all())
        with self._changed:
            if not self._closing.is_set():
                self._free.append(seat)
                self._changed.notify_all()
                return
        seat.stack.close()

    def _replace(self, seat: DesktopSeat) -> None:
        """End a desktop, and start another one until that works."""
        # Whatever is raised here (a full disk, too): without this thread the desktop would be
        # missing for good.
        try:
            seat.stack.close()
        except Exception as error:  # noqa: BLE001
            _log.error("a desktop that failed did not end: %s", error)
        while not self._closing.is_set():
            try:
                self._add()
                break
            except Exception as error:  # noqa: BLE001
                _log.error("no desktop in the place of one that ended, trying again: %s", error)
                self._closing.wait(RESTART_INTERVAL_S)
        with self._changed:
            self._starting.remove(threading.current_thread())
