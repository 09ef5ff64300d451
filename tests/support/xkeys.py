"""An X display that is none: a keyboard and a pointer which do with XTEST events what a server does.

It stands in for the X server, so that what is typed is worked out here, independently of our code.
"""

from types import SimpleNamespace
from typing import Any

from Xlib import X

SHIFT, CAPS_LOCK, RETURN = 0xFFE1, 0xFFE5, 0xFF0D
SIZE = (400, 300)
_WIDTH = 4  # symbols of a key: two of each of two groups
FIRST = 8


def us_keyboard() -> list[list[int]]:
    """Rows of a US keyboard, and the same letters with z and y exchanged as a second group."""
    rows = [[0] * _WIDTH for _ in range(3)]  # three keys without a symbol
    rows += [[code] * 2 + [0, 0] for code in (SHIFT, CAPS_LOCK, RETURN, 0xFF09, 0xFF08, 0xFFE3)]
    for small in range(ord("a"), ord("z") + 1):
        second = {ord("z"): ord("y"), ord("y"): ord("z")}.get(small, small)
        rows.append([small, small - 32, second, second - 32])
    for pair in ("1!", "2@", ",<", ".>", "  ", "/?", "-_", ";:"):
        rows.append([ord(pair[0]), ord(pair[1]), 0, 0])
    return rows


class Server:
    """What `Xlib.display.Display` gives.

    Attributes:
        typed: the symbols that reached the application, by the map of the moment.
        events: all events: kind, detail, x, y.
        down: the codes of pressed keys, and the negative numbers of pressed buttons.
    """

    def __init__(self, rows: list[list[int]] | None = None, group: int = 0) -> None:
        self.rows = us_keyboard() if rows is None else rows
        self.group = group
        self.caps = False
        self.typed: list[int] = []
        self.events: list[tuple[int, int, int, int]] = []
        self.down: list[int] = []
        self.at = (10, 20)
        self.maps = 0
        last = FIRST + len(self.rows) - 1
        self.display = SimpleNamespace(info=SimpleNamespace(min_keycode=FIRST, max_keycode=last))
        self._root = _Root(self)

    def screen(self) -> Any:
        return SimpleNamespace(root=self._root, width_in_pixels=SIZE[0], height_in_pixels=SIZE[1])

    def get_keyboard_mapping(self, first: int, count: int) -> list[list[int]]:
        return [list(row) for row in self.rows[first - FIRST :][:count]]

    def change_keyboard_mapping(self, first: int, rows: list[list[int]]) -> None:
        self.maps += 1
        self.rows[first - FIRST : first - FIRST + len(rows)] = [list(row) for row in rows]

    def sync(self) -> None:
        """All is done at once."""

    def flush(self) -> None:
        """All is done at once."""

    def close(self) -> None:
        """Nothing is open."""

    def get_atom(self, name: str) -> int:
        return len(name)

    def get_input_focus(self) -> Any:
        return SimpleNamespace(focus=X.PointerRoot)  # no window: nobody to wait for

    def xfixes_query_version(self) -> None:
        """Any."""

    @property
    def mask(self) -> int:
        """The modifiers that are on."""
        shift = any(code > 0 and self.rows[code - FIRST][0] == SHIFT for code in self.down)
        return (X.ShiftMask * shift) | (X.LockMask * self.caps) | self.group << 13

    def fake(self, kind: int, detail: int, x: int, y: int) -> None:
        """Take one XTEST event."""
        self.events.append((kind, detail, x, y))
        if kind == X.MotionNotify:
            self.at = (x, y)
        elif kind == X.ButtonPress:
            self.down.append(-detail)
        elif kind == X.ButtonRelease:
            self.down.remove(-detail)
        elif kind == X.KeyPress:
            self.down = [*dict.fromkeys([*self.down, detail])]
            self._press(self.rows[detail - FIRST])
        else:
            self.down.remove(detail)

    def _press(self, row: list[int]) -> None:
        if row[0] == CAPS_LOCK:
            self.caps = not self.caps
            return
        if row[0] in (SHIFT, 0xFFE3):
            return
        columns = row[2 * self.group : 2 * self.group + 2]
        if not any(columns):
            columns = row[:2]
        shifted = bool(self.mask & X.ShiftMask)
        if self.caps and columns[0] != columns[1] and chr(columns[0]).isalpha():
            shifted = not shifted
        self.typed.append(columns[shifted])

    @property
    def text(self) -> str:
        """What the application got, as text."""
        return "".join(_letter(symbol) for symbol in self.typed)


class _Root:
    id = 1

    def __init__(self, server: Server) -> None:
        self._server = server

    def query_pointer(self) -> Any:
        x, y = self._server.at
        return SimpleNamespace(root_x=x, root_y=y, mask=self._server.mask)


def _letter(symbol: int) -> str:
    named = {RETURN: "\n", 0xFF09: "\t", 0xFF08: "\b"}
    if symbol in named:
        return named[symbol]
    return chr(symbol & 0xFFFFFF) if symbol >> 24 == 1 else chr(symbol)
