"""Freezes the screen while the machine copies it from the X server's own memory.

The machine asks over a socket that it made itself; while X is grabbed no application draws, so the
copy is one frame and not halves of two. A machine that takes too long loses its hold.
"""

import socket
import threading
import time
from contextlib import suppress

from ...errors import DesktopError
from .display import SharedDisplay
from .frame_format import ASK, DONE, FrozenScreen
from .screen import ScreenCapture, read_pointer
from .shim.ah_input import Connection

MAX_FREEZE_S = 0.2  # s for which the screen is frozen at most


class Freezer:
    """Answers the machine on the listening socket `listener`, in threads of its own.

    Args:
        listener: a listening socket (`SOCK_SEQPACKET`).
        name: the display.
        screen: counts the frames.
    """

    def __init__(self, listener: socket.socket, name: str, screen: ScreenCapture) -> None:
        self._listener = listener
        self._screen = screen
        # of its own: while it has X grabbed, the others must wait
        self._display = SharedDisplay(name)
        self._bare: Connection | None = None

    def start(self) -> None:
        """Answer from now on."""
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        while True:
            caller, _ = self._listener.accept()
            threading.Thread(target=self._attend, args=(caller,), daemon=True).start()

    def _attend(self, caller: socket.socket) -> None:
        # If the display or the machine is gone, the machine sees the connection close and asks by
        # other means.
        with caller, suppress(DesktopError, OSError):
            while caller.recv(len(ASK)) == ASK:
                if not self._freeze_for(caller):
                    return

    def _freeze_for(self, caller: socket.socket) -> bool:
        with self._display.use() as connection:
            connection.display.grab_server()
            try:
                return _show(caller, self._describe(connection))
            finally:
                connection.display.ungrab_server()
                connection.sync()  # python-xlib's flush may return before it has sent anything

    def _describe(self, connection: Connection) -> bytes:
        if connection is not self._bare:
            # Otherwise X, too, draws the pointer into its memory, or has not drawn it again where
            # something was drawn below it.
            connection.root.xfixes_hide_cursor()
            self._bare = connection
        pointer = read_pointer(connection)
        screen = connection.root.get_geometry()
        self._screen.count()
        end = time.monotonic() + MAX_FREEZE_S
        return FrozenScreen(screen.width, screen.height, end, pointer).pack()


def _show(caller: socket.socket, message: bytes) -> bool:
    """Describe the frozen screen and wait for the copy; return whether the machine is there."""
    try:
        caller.settimeout(MAX_FREEZE_S)
        caller.send(message)
        return caller.recv(len(DONE)) == DONE
    except OSError:
        return False
    finally:
        caller.settimeout(None)
