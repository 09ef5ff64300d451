"""What the X server really shows, bottom to top: `python3 -c <this file> OPERATION JSON` prints JSON.

Stands alone, as it runs in the guest. Unlike the window manager's list it holds menus, bubbles and lockers, too.
"""

import json
import sys
import time
from collections.abc import Iterator
from typing import Any

from Xlib import X, display, error
from Xlib.ext import shape

GONE = (error.BadWindow, error.BadDrawable, error.BadMatch, AttributeError)  # the last: python-xlib's own word for it
DEEP = 12


class Screen:
    """The default display."""

    def __init__(self) -> None:
        self.display: Any = display.Display()
        self.display.set_error_handler(lambda *_: None)  # a window may close while it is asked
        self.root: Any = self.display.screen().root
        self.managed = self.display.intern_atom("WM_STATE")

    def box(self, window: Any) -> list[int]:
        size, corner = window.get_geometry(), self.root.translate_coords(window, 0, 0)
        x, y, line = corner.x, corner.y, size.border_width
        return [x - line, y - line, x + size.width + line, y + size.height + line]

    def client(self, top: Any, depth: int = 2) -> Any:
        """The application's own window below a frame, or None."""
        if top.get_full_property(self.managed, X.AnyPropertyType) is not None:
            return top
        for child in top.query_tree().children if depth else ():
            found = self.client(child, depth - 1)
            if found is not None:
                return found
        return None

    def holes(self, top: Any) -> list[list[int]]:
        """What of a window's rectangle is not window: rows [y, x1, x2] in its own pixels."""
        size = top.get_geometry()
        width, height = size.width, size.height
        rows: dict[int, list[tuple[int, int]]] = {}
        for part in top.shape_get_rectangles(shape.SK.Bounding).rectangles:
            for y in range(max(part.y, 0), min(part.y + part.height, height)):
                rows.setdefault(y, []).append((max(part.x, 0), min(part.x + part.width, width)))
        found: list[list[int]] = []
        for y in range(height):
            at = 0
            for x1, x2 in sorted(rows.get(y, [])):
                found += [[y, at, x1]] if x1 > at else []
                at = max(at, x2)
            found += [[y, at, width]] if at < width else []
        return found


def tops(screen: Screen) -> dict[str, Any]:
    """The windows that lie directly on the root and can be seen."""
    found: list[dict[str, Any]] = []
    for top in screen.root.query_tree().children:
        try:
            state = top.get_attributes()
            if state.map_state != X.IsViewable or state.win_class != X.InputOutput:
                continue
            client = screen.client(top)
            known = client or top
            found.append({
                "id": top.id, "client": client.id if client else 0, "class": ".".join(known.get_wm_class() or ()),
                "box": screen.box(top), "free": bool(state.override_redirect) and client is None,
            })  # fmt: skip
        except GONE:
            continue
    return {"tops": found}


def shaped(screen: Screen, number: int) -> dict[str, Any]:
    """The holes in the shape of a window."""
    return {"holes": screen.holes(screen.display.create_resource_object("window", number))}


def inner(screen: Screen, number: int) -> dict[str, Any]:
    """The boxes of the windows that are drawn inside window `number`, other programs' included."""
    top = screen.display.create_resource_object("window", number)
    return {"boxes": [screen.box(window) for window in _below(top, DEEP) if _drawn(window)]}


def _below(window: Any, depth: int) -> Iterator[Any]:
    for child in window.query_tree().children if depth else ():
        yield child
        yield from _below(child, depth - 1)


def _drawn(window: Any) -> bool:
    try:
        state = window.get_attributes()
        return state.map_state == X.IsViewable and state.win_class == X.InputOutput
    except GONE:
        return False


def gone(screen: Screen, number: int, patience: float) -> dict[str, Any]:
    """Whether a window goes away within `patience` seconds."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        try:
            window = screen.display.create_resource_object("window", number)
            if window.get_attributes().map_state != X.IsViewable:
                return {"gone": True}
        except GONE:
            return {"gone": True}
        time.sleep(0.02)
    return {"gone": False}


OPERATIONS = {"tops": tops, "shaped": shaped, "inner": inner, "gone": gone}

if __name__ == "__main__":
    print(json.dumps(OPERATIONS[sys.argv[1]](Screen(), **json.loads(sys.argv[2]))))
