"""Runs what effects ask for (`inside/`) in the server's own process.

The user's Python has no part in it: no file in the home, no variable and no program of the user's
can answer instead.
"""

import socket
import struct
import sys
import threading
import traceback
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from pathlib import Path
from typing import Any

from Xlib import error

from ...errors import DesktopError, DesktopTimeoutError, GuestError
from .display import BROKEN, SharedDisplay
from .inside import inputtool, locktool, nettool, xtool
from .inside.ewmh import Screen
from .shim.ah_input import Connection

PLACES = 6  # of the calls in which an operation waits, so many are named
EXTRA_TIMEOUT_S = (
    45.0  # s for an operation beyond its timeout; the machine waits for its answer longer
)
_PEER = struct.Struct("3i")  # SO_PEERCRED: process, user, group
_Facts = dict[str, Any]
_Work = Callable[..., _Facts]


class Tools:
    """The operations of `inside/`, one at a time.

    Args:
        name: of the display.
        display: the connection of the server, made before anybody used the desktop.
        limit: seconds after which an operation has failed, beyond the timeout that it was given.
    """

    def __init__(self, name: str, display: SharedDisplay, limit: float = EXTRA_TIMEOUT_S) -> None:
        self._name = name
        self._display = display
        self._limit = limit
        self._lock = threading.Lock()

    def run(self, tool: str, operation: str, fields: _Facts) -> _Facts:
        """Carry out one operation of a tool.

        Args:
            tool: its name.
            operation: of it.
            fields: its arguments.

        Returns:
            JSON data. A failing display is a `DesktopError`, one that does not answer a
            `DesktopTimeoutError`.

        Raises:
            GuestError: There is no such operation (400).
        """
        tables: dict[str, dict[str, _Work]] = {
            "xtool": xtool.OPERATIONS,
            "locktool": locktool.OPERATIONS,
            "nettool": nettool.OPERATIONS,
            "inputtool": inputtool.OPERATIONS,
        }
        work = tables.get(tool, {}).get(operation)
        if work is None:
            raise GuestError(f"there is no operation {operation!r:.80} of {tool!r:.80}", 400)
        if tool == "nettool":
            return work(**fields)
        return self._in_time(f"{tool} {operation}", work, fields)

    def _in_time(self, label: str, work: _Work, fields: _Facts) -> _Facts:
        """Carry out an operation on the screen; give up one to which X does not answer.

        X and python-xlib know no time limit: while some program holds the server, all others wait.

        Raises:
            DesktopTimeoutError: It did not end; the message says where it waits.
        """
        future: Future[_Facts] = Future()
        # a thread of its own: one that never ends must not be waited for when the server ends
        thread = threading.Thread(
            target=_carry_out, args=(future, partial(self._on_screen, work, fields)), daemon=True
        )
        limit = self._limit + float(fields.get("timeout", 0.0))
        thread.start()
        thread.join(limit)
        if not future.done():
            raise DesktopTimeoutError(
                f"{label} did not end within {limit:g} s: the display {self._name} does not answer"
                f" at {_place(thread)}; a program may hold the X server"
            )
        return future.result()

    def _on_screen(self, work: _Work, fields: _Facts) -> _Facts:
        with self._lock:
            return self._with_own_connection(work, fields)

    def _with_own_connection(self, work: _Work, fields: _Facts) -> _Facts:
        screen = None
        try:
            screen = Screen.open(self._name)
            self._check(screen)
            return work(screen, **fields)
        except (*BROKEN, error.XError) as problem:
            raise DesktopError(f"the display {self._name} failed: {problem}") from None
        finally:
            if screen is not None:
                screen.close()

    def _check(self, screen: Screen) -> None:
        """Check that the X server that answers is the one that was there before the agent.

        The user owns the display's socket, and could put one of its own in its place.

        Raises:
            DesktopError: It is another.
        """
        with self._display.use() as connection:
            server_pid = _served_by(connection)
        if _served_by(screen) != server_pid:
            raise DesktopError(
                f"another program than the X server answers on the display {self._name}"
            )


def _carry_out(future: "Future[_Facts]", work: Callable[[], _Facts]) -> None:
    try:
        future.set_result(work())
    except Exception as problem:  # noqa: BLE001  (raised again where the result is asked for)
        future.set_exception(problem)


def _place(thread: threading.Thread) -> str:
    """Return where a thread is now: functions with their files, the innermost last."""
    frame = sys._current_frames().get(thread.ident or 0)
    stack = traceback.extract_stack(frame) if frame is not None else []
    return " > ".join(
        f"{summary.name} ({Path(summary.filename).name}:{summary.lineno})"
        for summary in stack[-PLACES:]
    )


def _served_by(connection: "Screen | Connection") -> int:
    """Return the process that made the socket on the other side."""
    line: socket.socket = connection.display.display.socket
    return _PEER.unpack(line.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _PEER.size))[0]
