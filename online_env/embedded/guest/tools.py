"""Runs what effects ask for (`inside/`) in the server's own process.

The user's Python has no part in it: no file in the home, no variable and no program of the user's
can answer instead.
"""

import socket
import struct
import threading
from collections.abc import Callable
from typing import Any

from Xlib import error

from ...errors import DesktopError, GuestError
from .display import BROKEN, SharedDisplay
from .inside import locktool, nettool, xtool
from .inside.ewmh import Screen
from .shim.ah_input import Connection

_PEER = struct.Struct("3i")  # SO_PEERCRED: process, user, group


class Tools:
    """The operations of `inside/`, one at a time.

    Args:
        name: of the display.
        display: the connection of the server, made before anybody used the desktop.
    """

    def __init__(self, name: str, display: SharedDisplay) -> None:
        self._name = name
        self._display = display
        self._lock = threading.Lock()

    def run(
        self,
        tool: str,
        operation: str,
        fields: dict[str, Any],
    ) -> dict[str, Any]:
        """Carry out one operation of a tool.

        Args:
            tool: its name.
            operation: of it.
            fields: its arguments.

        Returns:
            JSON data. A failing display is a `DesktopError`.

        Raises:
            GuestError: There is no such operation (400).
        """
        tables: dict[str, dict[str, Callable[..., dict[str, Any]]]] = {
            "xtool": xtool.OPERATIONS,
            "locktool": locktool.OPERATIONS,
            "nettool": nettool.OPERATIONS,
        }
        work = tables.get(tool, {}).get(operation)
        if work is None:
            raise GuestError(f"there is no operation {operation!r:.80} of {tool!r:.80}", 400)
        if tool == "nettool":
            return work(**fields)
        with self._lock:
            return self._on_screen(work, fields)

    def _on_screen(
        self, work: Callable[..., dict[str, Any]], fields: dict[str, Any]
    ) -> dict[str, Any]:
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
            known = _served_by(connection)
        if _served_by(screen) != known:
            raise DesktopError(
                f"another program than the X server answers on the display {self._name}"
            )


def _served_by(connection: "Screen | Connection") -> int:
    """The process that made the socket on the other side."""
    line: socket.socket = connection.display.display.socket
    return _PEER.unpack(line.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _PEER.size))[0]
