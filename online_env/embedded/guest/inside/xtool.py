"""Windows and pointer of an X display, for effects."""

import contextlib
import json
import time
from collections.abc import Callable, Iterable
from typing import Any

from Xlib import X, Xutil
from Xlib.ext import xtest

from .ewmh import FULL_SCREEN, GONE, MAXIMISED, POLL_S, Screen, poll_until
from .ewmh import describe as describe_window

FIXED = ("desktop", "dock")  # window types that are part of the desktop itself
PAINT = 0x7B797D  # a colour that no application paints its windows with
PAINT_BYTES = PAINT.to_bytes(3, "little")
MIN_SIZE = slice(5, 7)  # of the numbers of WM_NORMAL_HINTS
SAMPLES = 6  # a window is looked at where this many parts of its width and height meet
PLACE_TIMEOUT_S = 3.0  # s for a window to get to its place
LIST_TIMEOUT_S = 2.0  # s for a window that has closed to leave the window manager's list
KEY_TIMEOUT_S = 0.2  # s in which a button would have changed
CLOSE_PAUSE = 0.4  # s between two requests to close
STABLE_POLLS = (
    20  # looks, `POLL_S` apart, at which a window that leaves the full screen must be the same
)

_Facts = dict[str, Any]


def describe(screen: Screen, number: int) -> _Facts | None:
    """A window as JSON data, with its frame, smallest size, states and whose dialog it is."""
    try:
        facts = describe_window(screen, number)
        if facts is None:
            return None
        window = screen.window(number)
        left, top, right, bottom = screen.margins(window)
        x1, y1, x2, y2 = facts["box"]
        states = [
            screen.display.get_atom_name(state) for state in screen.numbers(window, "_NET_WM_STATE")
        ]
        return {
            **facts,
            "for": screen.number(window, "WM_TRANSIENT_FOR"),
            "frame": [x1 - left, y1 - top, x2 + right, y2 + bottom],
            "least": _smallest_size(screen, window),
            "states": [state.replace("_NET_WM_STATE_", "").lower() for state in states],
        }
    except GONE:
        return None


def _smallest_size(screen: Screen, window: Any) -> list[int]:
    """Return the smallest width and height that a window allows; 0, 0 if it does not say."""
    # python-xlib's own reader of these hints fails in the release that OSWorld's server asks for.
    hints = screen.numbers(window, "WM_NORMAL_HINTS")
    has_size = len(hints) > MIN_SIZE.stop - 1 and hints[0] & Xutil.PMinSize
    return hints[MIN_SIZE] if has_size else [0, 0]


def listed(screen: Screen) -> list[_Facts]:
    """Return the managed windows, bottom to top.

    Raises:
        RuntimeError: The window manager lists windows, and python-xlib can describe none.
    """
    numbers = _managed(screen)
    windows = [describe(screen, number) for number in numbers]
    present = [window for window in windows if window is not None]
    if (
        numbers
        and not present
        and not poll_until(lambda: _managed(screen) != numbers, LIST_TIMEOUT_S)
    ):
        raise RuntimeError("the windows of this display cannot be read with this python-xlib")
    return present


def _managed(screen: Screen) -> list[int]:
    numbers = screen.numbers(screen.root, "_NET_CLIENT_LIST_STACKING")
    return numbers or screen.numbers(screen.root, "_NET_CLIENT_LIST")


def visible(screen: Screen) -> list[int]:
    """Return the application windows that are on the screen."""
    return [w["id"] for w in listed(screen) if w["mapped"] and w["type"] not in FIXED]


def state(screen: Screen) -> _Facts:
    """Return the windows bottom to top, and what else a plan for them needs."""
    width, height = screen.size()
    desk = screen.number(screen.root, "_NET_CURRENT_DESKTOP")
    areas = screen.numbers(screen.root, "_NET_WORKAREA")
    area = areas[4 * desk : 4 * desk + 4] or [0, 0, width, height]
    return {
        "windows": listed(screen),
        "active": screen.active(),
        "desktop_shown": screen.is_desktop_shown(),
        "size": [width, height],
        "area": [area[0], area[1], area[0] + area[2], area[1] + area[3]],
        "pointer": _pointer(screen),
        "managed": screen.has_manager(),
    }


def _pointer(screen: Screen) -> list[int]:
    pointer = screen.root.query_pointer()
    return [pointer.root_x, pointer.root_y]


def minimise(screen: Screen, timeout: float) -> _Facts:
    """Show the desktop; if the window manager cannot, minimise window by window."""
    before = visible(screen)
    active = screen.active()
    if not screen.has_manager():
        return {"managed": False}
    already = screen.is_desktop_shown() and not before
    supported = screen.numbers(screen.root, "_NET_SUPPORTED")
    able = screen.atom("_NET_SHOWING_DESKTOP") in supported
    if able:
        screen.show_desktop(True)
    else:
        for number in before:
            screen.minimise(screen.window(number))

    def done() -> bool:
        return not visible(screen) and (screen.is_desktop_shown() or not able)

    poll_until(done, timeout)
    return {
        "managed": True,
        "hidden": before,
        "active": active,
        "by": "show_desktop" if able else "each",
        "already": already,
    }


def restore(screen: Screen, ids: "list[int] | None", active: int, timeout: float) -> _Facts:
    """Bring windows back, whatever hid them (`None`: all that are minimised).

    Those that were closed since are left out.
    """
    if ids is None:
        ids = [window["id"] for window in listed(screen) if _is_minimised(window)]
    if screen.is_desktop_shown():
        screen.show_desktop(False)
    requested = set(ids)
    minimised = [window["id"] for window in listed(screen) if window["id"] in requested]

    def left() -> set[int]:
        return set(minimised) - set(visible(screen))

    poll_until(lambda: not left(), timeout / 2)
    hidden = left()
    again = [number for number in ids if number in hidden]
    if active in minimised:
        again.append(active)
    for number in again:
        screen.activate(screen.window(number))
    poll_until(lambda: not left(), timeout / 2)
    return {"restored": minimised, "left": sorted(left())}


def _is_minimised(window: _Facts) -> bool:
    return "hidden" in window["states"] and window["type"] not in FIXED


def await_window(screen: Screen, before: list[int], classes: list[str], timeout: float) -> _Facts:
    """Wait for a new application window that stays.

    Args:
        screen: where to look.
        before: ids of the windows that are not new.
        classes: the window's WM_CLASS contains one of these, in lower case.
        timeout: in seconds.
    """

    def is_wanted(window: _Facts) -> bool:
        if not window["mapped"] or window["type"] != "normal" or window["id"] in before:
            return False
        return any(name in window["class"].lower() for name in classes)

    def newest() -> _Facts | None:
        return next((window for window in reversed(listed(screen)) if is_wanted(window)), None)

    end = time.monotonic() + timeout
    while time.monotonic() < end:
        window = poll_until(newest, end - time.monotonic())
        time.sleep(5 * POLL_S)  # a window that is only passing by has gone by then
        again = describe(screen, window["id"]) if window else None
        if again and again["mapped"]:
            return {"window": again}
    return {"window": None}


def drawn(screen: Screen, number: int, frames: dict[str, list[int]], timeout: float) -> _Facts:
    """Give windows their places; tell whether new window `number` then draws itself.

    Otherwise it only shows what was there: it is painted over and told to draw, and whatever hangs
    or still loads leaves the paint where it is. `under` is what lay under each window that filled
    the screen: its frame and its states without that.
    """
    under = place(screen, frames)["under"]
    window = screen.window(number)
    with contextlib.suppress(*GONE):
        size = window.get_geometry()
        pen = window.create_gc(foreground=PAINT, subwindow_mode=X.IncludeInferiors)
        window.fill_rectangle(pen, 0, 0, size.width, size.height)
        pen.free()
    _expose(window)
    screen.display.sync()
    return {"drawn": bool(poll_until(lambda: not _painted(window), timeout)), "under": under}


def _expose(window: Any) -> None:
    with contextlib.suppress(*GONE):
        window.clear_area(exposures=True)
        for child in window.query_tree().children:
            _expose(child)


def _painted(window: Any) -> bool:
    """Return whether our paint is left on most of some points of a window."""
    painted = 0
    parts = range(1, SAMPLES)
    try:
        size = window.get_geometry()
        for i in parts:
            for j in parts:
                x = size.width * i // SAMPLES
                y = size.height * j // SAMPLES
                pixel = window.get_image(x, y, 1, 1, X.ZPixmap, 0xFFFFFF).data
                # Old releases of python-xlib decode what happens to be UTF-8.
                data = pixel.encode() if isinstance(pixel, str) else bytes(pixel)
                painted += data[:3] == PAINT_BYTES
    except GONE:
        return False
    return 2 * painted > len(parts) ** 2


def place(screen: Screen, frames: dict[str, list[int]], timeout: float = PLACE_TIMEOUT_S) -> _Facts:
    """Give windows (by number) their places; none stays maximised or full-screen.

    A place is what a person sees of the window, xyxy.
    """
    under: _Facts = {}
    for number, frame in frames.items():
        with contextlib.suppress(*GONE):
            window = screen.window(int(number))
            if screen.has(window, FULL_SCREEN):
                under[number] = _leave_full_screen(screen, int(number), timeout)
            _place(screen, window, frame, timeout)
    return {"under": under}


def _leave_full_screen(screen: Screen, number: int, timeout: float) -> _Facts | None:
    """Return what a window is like without filling the screen.

    Chromium first takes back the place that it had before, and may maximise itself a little later.
    """
    window = screen.window(number)
    screen.switch(window, FULL_SCREEN, False)
    poll_until(lambda: not screen.has(window, FULL_SCREEN), timeout / 2)
    last: list[Any] = []

    def rests() -> bool:
        last.append([screen.box(window), screen.has(window, MAXIMISED)])
        return len(last) > STABLE_POLLS and all(box == last[-1] for box in last[-STABLE_POLLS:])

    poll_until(rests, timeout / 2)
    facts = describe(screen, number)
    if facts is None:
        return None
    return {"frame": facts["frame"], "states": facts["states"]}


def _place(screen: Screen, window: Any, frame: list[int], timeout: float) -> None:
    if screen.has(window, MAXIMISED):
        screen.switch(window, MAXIMISED, False)
        poll_until(lambda: not screen.has(window, MAXIMISED), timeout / 2)
    left, top, right, bottom = screen.margins(window)
    box = [frame[0] + left, frame[1] + top, frame[2] - right, frame[3] - bottom]
    screen.move_to(window, box)
    poll_until(lambda: screen.box(window) == box, timeout / 2)


def maximise(screen: Screen, number: int) -> _Facts:
    """Maximise a window."""
    screen.switch(screen.window(number), MAXIMISED, True)
    return {}


def fill(screen: Screen, number: int, timeout: float = PLACE_TIMEOUT_S) -> _Facts:
    """Let a window fill the screen."""
    window = screen.window(number)
    screen.switch(window, FULL_SCREEN, True)
    return {"filled": bool(poll_until(lambda: screen.has(window, FULL_SCREEN), timeout))}


def activate(screen: Screen, number: int, timeout: float = PLACE_TIMEOUT_S) -> _Facts:
    """Give a window the focus, if it is still there."""

    def has_it() -> bool:
        return screen.numbers(screen.root, "_NET_ACTIVE_WINDOW")[:1] == [number]

    if number and not has_it() and number in (window["id"] for window in listed(screen)):
        screen.activate(screen.window(number))
        poll_until(has_it, timeout)
    return {"active": has_it()}


def close(screen: Screen, ids: Iterable[int], timeout: float) -> _Facts:
    """Ask windows and the dialogs before them to close; tell which are still there."""
    requested = set(ids)
    end = time.monotonic() + timeout

    def left() -> list[int]:
        return [
            window["id"] for window in listed(screen) if {window["id"], window["for"]} & requested
        ]

    numbers = left()
    while numbers and time.monotonic() < end:
        for number in reversed(numbers):
            screen.ask_to_close(screen.window(number))
        poll_until(lambda: not left(), CLOSE_PAUSE)
        numbers = left()
    return {"left": left()}


def move(screen: Screen, x: int, y: int) -> _Facts:
    """Move the pointer to a point."""
    xtest.fake_input(screen.display, X.MotionNotify, x=x, y=y)
    screen.display.sync()
    return {"pointer": _pointer(screen)}


def click(screen: Screen, number: int, frame: list[int]) -> _Facts:
    """Click where the pointer is, if window `number` is still at `frame` (0: no matter).

    `delivered` is the server's own account of the button before, during and after.
    """
    window = describe(screen, number) if number else None
    if number and (window is None or window["frame"] != frame):
        return {"moved": True}

    def is_down() -> bool:
        return bool(screen.root.query_pointer().mask & X.Button1Mask)

    changes = [not is_down()]
    for kind, down in ((X.ButtonPress, True), (X.ButtonRelease, False)):
        xtest.fake_input(screen.display, kind, 1)
        screen.display.sync()
        # A window manager that raises on click holds the event back until it has done so.
        changes.append(bool(poll_until(lambda down=down: is_down() == down, KEY_TIMEOUT_S)))
    return {"moved": False, "pointer": _pointer(screen), "delivered": all(changes)}


OPERATIONS: dict[str, Callable[..., _Facts]] = {
    "state": state,
    "minimise": minimise,
    "restore": restore,
    "await_window": await_window,
    "drawn": drawn,
    "place": place,
    "maximise": maximise,
    "fill": fill,
    "activate": activate,
    "close": close,
    "move": move,
    "click": click,
}


def main(operation: str, fields: str) -> None:
    """Carry out an operation with JSON `fields` on the default display, and print JSON."""
    print(json.dumps(OPERATIONS[operation](Screen.open(), **json.loads(fields))))
