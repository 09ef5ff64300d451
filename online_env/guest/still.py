"""Holds the screen still for a moment, so that the machine can copy it from the X server's own memory.

The machine asks over a socket that it made itself; while X is grabbed no application draws, so what is copied is one
frame and not halves of two. A machine that takes too long loses its hold.
"""

import socket
import threading
import time
from contextlib import suppress

from ..errors import DesktopError
from .display import Shared
from .picture import Held
from .screen import Screen, pointer_of
from .shim.ah_input import Connection

ASK, DONE = b"?", b"."
PATIENCE = 0.2  # s that the screen is held at most


class Still:
    """Answers the machine on the listening socket `door`, in threads of its own.

    Args:
        door: a listening socket (`SOCK_SEQPACKET`).
        name: the display.
        screen: counts the frames.
    """

    def __init__(self, door: socket.socket, name: str, screen: Screen) -> None:
        self._door, self._screen = door, screen
        self._display = Shared(name)  # of its own: while it has X grabbed, the others must wait
        self._bare: Connection | None = None

    def start(self) -> None:
        """Answer from now on."""
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        while True:
            line, _ = self._door.accept()
            threading.Thread(target=self._attend, args=(line,), daemon=True).start()

    def _attend(self, line: socket.socket) -> None:
        # Where the display or the machine is gone, the machine sees the line close and asks by other means.
        with line, suppress(DesktopError, OSError):
            while line.recv(len(ASK)) == ASK:
                with self._display.use() as connection:
                    connection.display.grab_server()
                    try:
                        alive = _show(line, self._describe(connection))
                    finally:
                        connection.display.ungrab_server()
                        connection.display.flush()
                if not alive:
                    return

    def _describe(self, connection: Connection) -> bytes:
        if connection is not self._bare:
            # Else X, too, draws the pointer into its memory, or not yet again where something was drawn below it.
            connection.root.xfixes_hide_cursor()
            self._bare = connection
        pointer, screen = pointer_of(connection), connection.root.get_geometry()
        self._screen.count()
        return Held(screen.width, screen.height, time.monotonic() + PATIENCE, pointer).pack()


def _show(line: socket.socket, message: bytes) -> bool:
    """Tell the machine what is held and wait until it has its copy; returns whether it is still there."""
    try:
        line.settimeout(PATIENCE)
        line.send(message)
        return line.recv(len(DONE)) == DONE
    except OSError:
        return False
    finally:
        line.settimeout(None)
