"""Windows of an X display by EWMH 1.5 and ICCCM, over python-xlib.

The guest server, the tools beside this file and the recorder share it. It needs Python 3.10 and
python-xlib only, because it also runs in guests where nothing else of ours is installed.
"""

import time
from collections.abc import Callable, Sequence
from typing import Any

from Xlib import X, error
from Xlib import display as xdisplay
from Xlib.protocol import event

USER = 2  # EWMH source indication: a person's tool, which the window manager obeys
ICONIC = 3  # ICCCM, WM_CHANGE_STATE and WM_STATE
STATIC = 10  # the place asked for is that of the window's content, not of its frame
ALL_GIVEN = 0b1111 << 8  # _NET_MOVERESIZE_WINDOW: x, y, width and height are all given
MAXIMISED = ("_NET_WM_STATE_MAXIMIZED_HORZ", "_NET_WM_STATE_MAXIMIZED_VERT")
FULL_SCREEN = ("_NET_WM_STATE_FULLSCREEN",)
# What a question about a window that has closed meanwhile raises; the last is python-xlib's own.
GONE = (error.BadWindow, error.BadDrawable, error.BadMatch, AttributeError)
POLL_S = 0.01
_TYPE = "_NET_WM_WINDOW_TYPE_"
_WORD = 0xFFFFFFFF  # a client message carries unsigned 32-bit numbers
_MESSAGE_WORDS = 5
_PROPERTY_WORDS = 256  # of a property in one answer; the rest of a longer one takes a second


class Screen:
    """The screen of an open display, with questions and requests to its window manager.

    Args:
        display: a `Xlib.display.Display`.
    """

    def __init__(self, display: Any) -> None:
        self.display: Any = display
        self.root: Any = display.screen().root

    @classmethod
    def open(cls, name: str | None = None) -> "Screen":
        """Open the display `name`, or the default one."""
        display = xdisplay.Display(name)
        display.set_error_handler(lambda *_: None)  # a window may close while it is asked
        return cls(display)

    def close(self) -> None:
        """Close the display."""
        self.display.close()

    def atom(self, name: str) -> int:
        """Return the number of a name."""
        return self.display.get_atom(name)  # asks once; intern_atom asks each time

    def window(self, number: int) -> Any:
        """Return the window with that id."""
        return self.display.create_resource_object("window", number)

    def size(self) -> tuple[int, int]:
        """`(width, height)` in pixels, asked from the server now."""
        geometry = self.root.get_geometry()
        return geometry.width, geometry.height

    def _property(self, window: Any, name: str) -> Any:
        return window.get_full_property(self.atom(name), X.AnyPropertyType, _PROPERTY_WORDS)

    def numbers(self, window: Any, name: str) -> list[int]:
        """Return a property that is a list of numbers; empty if the window does not have it."""
        prop = self._property(window, name)
        if not prop or prop.format != 32:
            return []
        return [int(value) for value in prop.value]

    def number(self, window: Any, name: str) -> int:
        """Return the first number of a property; 0 if the window does not have it."""
        values = self.numbers(window, name)
        return values[0] if values else 0

    def text(self, window: Any, name: str) -> str:
        """Return a property that is a text; empty if the window does not have it."""
        prop = self._property(window, name)
        value = prop.value if prop else b""
        if isinstance(value, bytes):
            return value.decode("utf-8", "replace")
        return str(value)

    def title(self, window: Any) -> str:
        """Return the title of a window."""
        return self.text(window, "_NET_WM_NAME") or self.text(window, "WM_NAME")

    def window_class(self, window: Any) -> str:
        """WM_CLASS of a window, as `instance.Class`."""
        return ".".join(window.get_wm_class() or ())

    def box(self, window: Any) -> list[int]:
        """Return the place of a window without its border and frame, xyxy."""
        size = window.get_geometry()
        corner = self.root.translate_coords(window, 0, 0)
        return [corner.x, corner.y, corner.x + size.width, corner.y + size.height]

    def is_mapped(self, window: Any) -> bool:
        """Return whether a window is on the screen (not minimised)."""
        return window.get_attributes().map_state == X.IsViewable and not self.is_iconic(window)

    def is_iconic(self, window: Any) -> bool:
        """Return whether the window manager says that it has minimised a window.

        GNOME Shell keeps minimised windows mapped, for their pictures in its overview.
        """
        return self.number(window, "WM_STATE") == ICONIC

    def is_drawn(self, window: Any) -> bool:
        """Whether a window is on the screen and can be seen; a window for input only cannot."""
        attributes = window.get_attributes()
        return attributes.map_state == X.IsViewable and attributes.win_class == X.InputOutput

    def client(self, top: Any, depth: int = 2) -> Any:
        """Return the application's own window, at most `depth` levels below a frame, or None.

        Menus, bubbles and lockers have none: no window manager holds them.
        """
        if self.numbers(top, "WM_STATE"):
            return top
        if depth == 0:
            return None
        for child in top.query_tree().children:
            client = self.client(child, depth - 1)
            if client is not None:
                return client
        return None

    def has(self, window: Any, states: Sequence[str]) -> bool:
        """Return whether a window is in any of these states."""
        atoms = {self.atom(name) for name in states}
        return not atoms.isdisjoint(self.numbers(window, "_NET_WM_STATE"))

    def margins(self, window: Any) -> list[int]:
        """Return the visible decoration around a window's content: left, top, right, bottom.

        Shadows count as less.
        """
        extents = self.numbers(window, "_NET_FRAME_EXTENTS")[:4] or [0] * 4
        shadow = self.numbers(window, "_GTK_FRAME_EXTENTS")[:4] or [0] * 4
        left, right, top, bottom = (a - b for a, b in zip(extents, shadow, strict=False))
        return [left, top, right, bottom]

    def has_manager(self) -> bool:
        """Return whether a window manager runs."""
        return bool(self.numbers(self.root, "_NET_SUPPORTING_WM_CHECK"))

    def has_settings(self) -> bool:
        """Return whether a daemon publishes fonts, themes and hinting for the first screen."""
        atom = self.display.get_atom("_XSETTINGS_S0")
        return bool(self.display.get_selection_owner(atom))

    def active(self) -> int:
        """Return the id of the window that has the focus; 0 if none has."""
        return self.number(self.root, "_NET_ACTIVE_WINDOW")

    def is_desktop_shown(self) -> bool:
        """Return whether the window manager reports that it shows the desktop."""
        return self.numbers(self.root, "_NET_SHOWING_DESKTOP")[:1] == [1]

    def send(self, window: Any, kind: str, data: Sequence[int]) -> None:
        """Send the window manager a request about a window."""
        words = [*data, *[0] * _MESSAGE_WORDS][:_MESSAGE_WORDS]
        message = event.ClientMessage(window=window, client_type=self.atom(kind), data=(32, words))
        mask = X.SubstructureRedirectMask | X.SubstructureNotifyMask
        self.root.send_event(message, event_mask=mask)
        self.display.sync()

    def switch(self, window: Any, states: Sequence[str], on: bool) -> None:
        """Put a window into one or two states, or take it out of them."""
        first = self.atom(states[0])
        second = self.atom(states[1]) if len(states) > 1 else 0
        self.send(window, "_NET_WM_STATE", [int(on), first, second, USER])

    def show_desktop(self, on: bool) -> None:
        """Minimise all windows, or bring them back."""
        self.send(self.root, "_NET_SHOWING_DESKTOP", [int(on)])

    def minimise(self, window: Any) -> None:
        """Minimise a window."""
        self.send(window, "WM_CHANGE_STATE", [ICONIC])

    def activate(self, window: Any) -> None:
        """Bring a window to the front and give it the focus, also if it is minimised."""
        self.send(window, "_NET_ACTIVE_WINDOW", [USER, X.CurrentTime, 0])

    def ask_to_close(self, window: Any) -> None:
        """Ask a window to close, as its close button does; an application may ask back."""
        self.send(window, "_NET_CLOSE_WINDOW", [X.CurrentTime, USER])

    def move_to(self, window: Any, box: Sequence[int]) -> None:
        """Give a window's content the place and size of `box`, xyxy."""
        x1, y1, x2, y2 = box
        flags = STATIC | ALL_GIVEN | USER << 12
        place = [x1 & _WORD, y1 & _WORD, max(x2 - x1, 1), max(y2 - y1, 1)]
        self.send(window, "_NET_MOVERESIZE_WINDOW", [flags, *place])


def describe(screen: Screen, number: int) -> dict[str, Any] | None:
    """Return a managed window as JSON data; None if it has closed.

    Its `type` is `normal`, `dialog`, `dock`, `desktop` ...; its `box` is without the frame, xyxy.
    """
    window = screen.window(number)
    try:
        kinds = screen.numbers(window, "_NET_WM_WINDOW_TYPE")
        kind = screen.display.get_atom_name(kinds[0]) if kinds else f"{_TYPE}NORMAL"
        return {
            "id": number,
            "pid": screen.number(window, "_NET_WM_PID"),
            "class": screen.window_class(window),
            "title": screen.title(window),
            "box": screen.box(window),
            "type": kind.removeprefix(_TYPE).lower(),
            "mapped": screen.is_mapped(window),
        }
    except GONE:
        return None


def poll_until(condition: Callable[[], Any], timeout: float) -> Any:
    """Return the first true value of `condition` within `timeout` seconds, or its last value."""
    end = time.monotonic() + timeout
    while True:
        value = condition()
        if value or time.monotonic() >= end:
            return value
        time.sleep(POLL_S)
