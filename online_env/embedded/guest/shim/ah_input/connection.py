"""One connection to an X display, and waiting until an application has read its events."""

import contextlib
import os
import select
import sys
import time
from typing import Any, cast

from Xlib import X, display, error
from Xlib.ext import xtest
from Xlib.protocol import event

# s to wait for an application that says it answers: Chromium takes up to one on a busy machine
PING_TIMEOUT_S = 3.0
DEAF_PAUSE = 0.15  # s to give one that does not


class Connection:
    """A connection to `name` (by default `$DISPLAY`); one thread at a time may use it.

    Making it raises `Xlib.error.DisplayError` if there is no such display, using it
    `Xlib.error.ConnectionClosedError` if the display has ended.
    """

    def __init__(self, name: str | None = None) -> None:
        place = name or os.environ.get("DISPLAY", "")
        try:
            self.display: Any = display.Display(place)
        except error.XauthError:
            # python-xlib 0.15 fails where the file does not exist, though none may be needed, and
            # prints a warning where it is empty.
            os.environ["XAUTHORITY"] = os.devnull
            with contextlib.redirect_stdout(sys.stderr):
                self.display = display.Display(place)
        self.screen: Any = self.display.screen()
        self.root: Any = self.screen.root
        self._pings = 0

    @property
    def size(self) -> tuple[int, int]:
        """`(width, height)` of the screen in pixels."""
        return self.screen.width_in_pixels, self.screen.height_in_pixels

    def fake(self, kind: int, detail: int = 0, x: int = 0, y: int = 0) -> None:
        """Send one XTEST event; `flush` or `sync` delivers it."""
        cast(Any, xtest).fake_input(self.display, kind, detail, x=x, y=y)

    def sync(self) -> None:
        """Return when the server has handled all that was sent."""
        self.display.sync()

    def close(self) -> None:
        """Close the connection."""
        self.display.close()

    def settle(self) -> None:
        """Wait until the application that has the focus has read all events up to now.

        It is asked by a `_NET_WM_PING` (EWMH), which it reads after them and answers. One that does
        not speak that protocol is given `DEAF_PAUSE`.
        """
        self.sync()
        window = self._focused()
        if window is None:
            time.sleep(DEAF_PAUSE)
            return
        self._pings += 1
        protocols, ping = (
            self.display.get_atom("WM_PROTOCOLS"),
            self.display.get_atom("_NET_WM_PING"),
        )
        message = event.ClientMessage(
            window=window, client_type=protocols, data=(32, [ping, self._pings, window.id, 0, 0])
        )
        self.root.change_attributes(event_mask=X.SubstructureNotifyMask)
        try:
            window.send_event(message)
            self.display.flush()
            self._await_answer(ping)
        except error.BadWindow:
            time.sleep(DEAF_PAUSE)
        finally:
            self.root.change_attributes(event_mask=X.NoEventMask)
            self.sync()
            while self.display.pending_events():
                self.display.next_event()

    def _await_answer(self, ping: int) -> None:
        deadline = time.monotonic() + PING_TIMEOUT_S
        while (remaining_s := deadline - time.monotonic()) > 0:
            if (
                not self.display.pending_events()
                and not select.select([self.display.fileno()], [], [], remaining_s)[0]
            ):
                return
            while self.display.pending_events():
                event = self.display.next_event()
                if event.type == X.ClientMessage and list(event.data[1][:2]) == [ping, self._pings]:
                    return

    def _focused(self) -> Any:
        """The window that has the focus, or its nearest parent that answers pings, or None."""
        ping = self.display.get_atom("_NET_WM_PING")
        window = self.display.get_input_focus().focus
        try:
            while not isinstance(window, int) and window.id != self.root.id:
                if ping in (window.get_wm_protocols() or ()):
                    return window
                window = window.query_tree().parent
        except (error.BadWindow, error.BadDrawable):
            return None  # closed while we looked
        return None
