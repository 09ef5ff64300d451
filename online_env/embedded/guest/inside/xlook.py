"""The windows that the X server really shows, bottom to top, for the recorder.

Unlike the window manager's list they include menus, bubbles and lockers.
"""

import json
import time
from collections.abc import Callable, Iterator
from typing import Any

from Xlib import X
from Xlib.ext import shape

from .ewmh import GONE, Screen

DEEP = 12  # levels of windows inside windows
POLL_S = 0.02

_Facts = dict[str, Any]
_Span = tuple[int, int]  # of columns in a row


def _outline(screen: Screen, window: Any) -> list[int]:
    """Return the place of a window with its border, xyxy."""
    x1, y1, x2, y2 = screen.box(window)
    line = window.get_geometry().border_width
    return [x1 - line, y1 - line, x2 + line, y2 + line]


def tops(screen: Screen) -> _Facts:
    """Return the windows that lie directly on the root and can be seen."""
    windows: list[_Facts] = []
    for top in screen.root.query_tree().children:
        try:
            if screen.is_drawn(top):
                windows.append(_top(screen, top))
        except GONE:
            continue
    return {"tops": windows}


def _top(screen: Screen, top: Any) -> _Facts:
    client = screen.client(top)
    attributes = top.get_attributes()
    return {
        "id": top.id,
        "client": client.id if client else 0,
        "class": screen.window_class(client or top),
        "box": _outline(screen, top),
        "free": bool(attributes.override_redirect) and client is None,
    }


def shaped(screen: Screen, number: int) -> _Facts:
    """Return the holes in the shape of a window: rows `[y, x1, x2]` in its own pixels."""
    top = screen.window(number)
    size = top.get_geometry()
    rows: dict[int, list[_Span]] = {}
    for part in top.shape_get_rectangles(shape.SK.Bounding).rectangles:
        span = (max(part.x, 0), min(part.x + part.width, size.width))
        for y in range(max(part.y, 0), min(part.y + part.height, size.height)):
            rows.setdefault(y, []).append(span)
    holes: list[list[int]] = []
    for y in range(size.height):
        holes += [[y, x1, x2] for x1, x2 in _gaps(rows.get(y, []), size.width)]
    return {"holes": holes}


def _gaps(spans: list[_Span], width: int) -> Iterator[_Span]:
    """Yield the parts of a row of `width` pixels that no span covers."""
    at = 0
    for x1, x2 in sorted(spans):
        if x1 > at:
            yield at, x1
        at = max(at, x2)
    if at < width:
        yield at, width


def inner(screen: Screen, number: int) -> _Facts:
    """The boxes of the windows that are drawn inside window `number`, other programs' included."""
    windows = [window for window in _below(screen.window(number), DEEP) if _drawn(screen, window)]
    return {"boxes": [_outline(screen, window) for window in windows]}


def _below(window: Any, depth: int) -> Iterator[Any]:
    if depth == 0:
        return
    for child in window.query_tree().children:
        yield child
        yield from _below(child, depth - 1)


def _drawn(screen: Screen, window: Any) -> bool:
    try:
        return screen.is_drawn(window)
    except GONE:
        return False


def gone(screen: Screen, number: int, timeout: float) -> _Facts:
    """Return whether a window goes away within `timeout` seconds."""
    window = screen.window(number)
    end = time.monotonic() + timeout
    while time.monotonic() < end:
        try:
            if window.get_attributes().map_state != X.IsViewable:
                return {"gone": True}
        except GONE:
            return {"gone": True}
        time.sleep(POLL_S)
    return {"gone": False}


OPERATIONS: dict[str, Callable[..., _Facts]] = {
    "tops": tops,
    "shaped": shaped,
    "inner": inner,
    "gone": gone,
}


def main(operation: str, fields: str) -> None:
    """Carry out an operation with JSON `fields` on the default display, and print JSON."""
    print(json.dumps(OPERATIONS[operation](Screen.open(), **json.loads(fields))))
