"""The server's connection to the X display, shared by its threads and renewed if it ends."""

import contextlib
import threading
from collections.abc import Iterator

from Xlib import error

from ...errors import DesktopError
from .shim.ah_input import Connection

BROKEN = (error.DisplayError, error.ConnectionClosedError, error.XauthError, OSError)


class SharedDisplay:
    """One connection that a thread at a time may use."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._lock = threading.RLock()
        self._connection: Connection | None = None

    @contextlib.contextmanager
    def use(self) -> Iterator[Connection]:
        """Lend the connection; it is dropped when it turns out to be broken.

        Raises:
            DesktopError: The display does not answer.
        """
        with self._lock:
            try:
                yield self._connection or self._open()
            except BROKEN as problem:
                self._connection = None
                raise DesktopError(
                    f"the display {self.name} does not answer: {problem}; has its X server ended?"
                ) from None

    def _open(self) -> Connection:
        connection = Connection(self.name)
        connection.display.xfixes_query_version()
        self._connection = connection
        return connection
