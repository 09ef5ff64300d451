"""The windows of the desktop: list, activate, close, minimise, place, show the desktop."""

import contextlib
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

from hijack_data.types import Box

from ...errors import DesktopError
from .display import SharedDisplay
from .inside.ewmh import GONE, MAXIMISED, Screen, describe


@dataclass(frozen=True, kw_only=True)
class Window:
    """A window that the window manager lists.

    Attributes:
        id: its number on the X server.
        pid: the process that opened it; 0 if it does not give one.
        class_name: WM_CLASS, as `instance.Class`.
        title: its title.
        box: its place without the frame, `xyxy` in pixels.
        type: `normal`, `dialog`, `dock`, `desktop` ...
        mapped: whether it is on the screen (not minimised).
        active: whether it has the focus.
    """

    id: int
    pid: int
    class_name: str
    title: str
    box: Box
    type: str
    mapped: bool
    active: bool

    def to_dict(self) -> dict[str, Any]:
        """Return the window as JSON."""
        row = asdict(self)
        row["class"] = row.pop("class_name")
        row["box"] = list(self.box)
        return row


@dataclass(frozen=True, kw_only=True)
class Surface:
    """A top-level window that covers a part of the screen.

    Attributes:
        frame: its place with its decoration.
        client: its place without it.
        pid: the process that opened it; 0 if it does not give one.
        popup: whether it is a menu or the like, which no window manager holds.
        title: its title; empty for a popup.
    """

    frame: Box
    client: Box
    pid: int
    popup: bool
    title: str


class Windows:
    """The windows of a display."""

    def __init__(self, display: SharedDisplay) -> None:
        self._display = display

    @contextlib.contextmanager
    def _screen(self) -> Iterator[Screen]:
        with self._display.use() as connection:
            yield Screen(connection.display)

    def all(self) -> list[Window]:
        """Return all managed windows, the oldest first."""
        with self._screen() as screen:
            active = screen.active()
            numbers = screen.numbers(screen.root, "_NET_CLIENT_LIST")
            windows = [describe(screen, number) for number in numbers]
        return [_window(row, row["id"] == active) for row in windows if row is not None]

    def surfaces(self) -> list[Surface]:
        """Return the windows on the screen, topmost first, menus and the like included."""
        with self._screen() as screen:
            tops = reversed(screen.root.query_tree().children)
            surfaces = [_surface(screen, window) for window in tops]
        return [surface for surface in surfaces if surface is not None]

    def screen_size(self) -> tuple[int, int]:
        """`(width, height)` of the screen in pixels, asked from the server now."""
        with self._screen() as screen:
            return screen.size()

    def workarea(self) -> Box:
        """Return the screen without its panels, as the window manager reports it."""
        with self._screen() as screen:
            corners = screen.numbers(screen.root, "_NET_WORKAREA")[:4]
            if len(corners) < 4:
                return 0, 0, *screen.size()
        x, y, width, height = corners
        return x, y, x + width, y + height

    def find(self, name: str, *, strict: bool = False, by_class: bool = False) -> Window | None:
        """Return the first window whose title (or class) contains `name`, in whatever case.

        With `strict` it must equal it, as in wmctrl.
        """
        for window in self.all():
            text = window.class_name if by_class else window.title
            matches = text == name if strict else name.lower() in text.lower()
            if matches:
                return window
        return None

    def activate(self, number: int) -> None:
        """Bring a window to the front, also if it is minimised."""
        with self._screen() as screen:
            screen.activate(screen.window(number))

    def close(self, number: int) -> None:
        """Ask a window to close, as its close button does; an application may ask back."""
        with self._screen() as screen:
            screen.ask_to_close(screen.window(number))

    def minimise(self, number: int) -> None:
        """Minimise a window."""
        with self._screen() as screen:
            screen.minimise(screen.window(number))

    def place(self, number: int, box: Box) -> None:
        """Give a window the place and size of `box`; it is no longer maximised.

        Args:
            number: its id.
            box: `xyxy` without its frame.
        """
        with self._screen() as screen:
            window = screen.window(number)
            screen.switch(window, MAXIMISED, False)
            screen.move_to(window, box)

    def show_desktop(self, on: bool = True) -> None:
        """Minimise all windows, or bring them back."""
        with self._screen() as screen:
            screen.show_desktop(on)

    @property
    def desktop_shown(self) -> bool:
        """Whether the window manager reports that it shows the desktop."""
        with self._screen() as screen:
            return screen.is_desktop_shown()

    def manager_is_there(self) -> bool:
        """Return whether a window manager runs."""
        with self._screen() as screen:
            return screen.has_manager()


def require(windows: Windows, number: int) -> Window:
    """Return the window of that id.

    Raises:
        DesktopError: There is none.
    """
    for window in windows.all():
        if window.id == number:
            return window
    raise DesktopError(f"there is no window {number:#x}; it may have been closed")


def _window(row: dict[str, Any], active: bool) -> Window:
    x1, y1, x2, y2 = row["box"]
    return Window(
        id=row["id"],
        pid=row["pid"],
        class_name=row["class"],
        title=row["title"],
        box=(x1, y1, x2, y2),
        type=row["type"],
        mapped=row["mapped"],
        active=active,
    )


def _surface(screen: Screen, top: Any) -> Surface | None:
    try:
        if not screen.is_drawn(top):
            return None
        client = screen.client(top, depth=1)
        if client is not None and screen.is_iconic(client):
            return None
        window = top if client is None else client
        return Surface(
            frame=_box(screen, top),
            client=_box(screen, window),
            pid=screen.number(window, "_NET_WM_PID"),
            popup=client is None,
            title="" if client is None else screen.title(client),
        )
    except GONE:
        return None


def _box(screen: Screen, window: Any) -> Box:
    x1, y1, x2, y2 = screen.box(window)
    return x1, y1, x2, y2
