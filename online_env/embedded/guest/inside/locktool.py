"""Keys and grabs of an X display, which a lock screen is about."""

import contextlib
import json
import time
from collections.abc import Callable
from typing import Any

from Xlib import XK, X
from Xlib.ext import xtest

from .ewmh import GONE, Screen, poll_until

KEY_TIMEOUT_S = 0.2  # s in which a typed key would have come
KEY_PAUSE = 0.03  # s between two keys
DIALOG = 0.1  # s that a locker takes to show the field for the password
LATIN_1 = 0x100  # characters below are their own keysyms
UNICODE = 0x1000000  # others are, plus this

_Facts = dict[str, Any]


def lock(screen: Screen, typed: bool) -> _Facts:
    """Return the owner of screen and input: the window on top, and both grabs.

    With `typed` also whether a key reaches a client of ours.
    """
    width, height = screen.size()
    top = _topmost(screen, width, height)
    return {
        "top": top,
        "covers": top is not None and covers(top["box"], width, height),
        "keyboard": _held(screen, "keyboard"),
        "pointer": _held(screen, "pointer"),
        "typed_reaches": typed and _typed_reaches(screen),
    }


def covers(box: list[int], width: int, height: int) -> bool:
    """Return whether a window, `xyxy`, leaves nothing of a screen of this size to be seen."""
    x1, y1, x2, y2 = box
    return x1 <= 0 and y1 <= 0 and x2 >= width and y2 >= height


def _topmost(screen: Screen, width: int, height: int) -> _Facts | None:
    """Return the window on top of all that can be seen."""
    for window in reversed(screen.root.query_tree().children):
        with contextlib.suppress(*GONE):
            x1, y1, x2, y2 = box = screen.box(window)
            is_inside = x2 > 0 and y2 > 0 and x1 < width and y1 < height
            if is_inside and screen.is_drawn(window):
                return {"class": screen.window_class(window), "box": box}
    return None


def _held(screen: Screen, device: str) -> bool:
    """Return whether another client holds the device; ours lets go at once."""
    if device == "keyboard":
        status = screen.root.grab_keyboard(False, X.GrabModeAsync, X.GrabModeAsync, X.CurrentTime)
        screen.display.ungrab_keyboard(X.CurrentTime)
    else:
        modes = (X.GrabModeAsync, X.GrabModeAsync, X.NONE, X.NONE, X.CurrentTime)
        status = screen.root.grab_pointer(False, X.ButtonPressMask, *modes)
        screen.display.ungrab_pointer(X.CurrentTime)
    screen.display.sync()
    return status == X.AlreadyGrabbed


def _typed_reaches(screen: Screen) -> bool:
    """Type a letter while a window of ours has the focus: it comes unless the keyboard is taken.

    No application gets it; a locker does, and is given a BackSpace.
    """
    before = screen.display.get_input_focus().focus
    window = screen.root.create_window(
        -5, -5, 2, 2, 0, X.CopyFromParent, override_redirect=True, event_mask=X.KeyPressMask
    )
    window.map()
    screen.display.sync()
    window.set_input_focus(X.RevertToParent, X.CurrentTime)
    _press(screen, "a")
    came = bool(poll_until(lambda: _key_came(screen), KEY_TIMEOUT_S))
    if not came:
        _press(screen, "BackSpace")
    with contextlib.suppress(*GONE):
        screen.display.set_input_focus(before, X.RevertToPointerRoot, X.CurrentTime)
    window.destroy()
    screen.display.sync()
    return came


def wake(screen: Screen) -> _Facts:
    """Press Shift: a locker that left the screen black shows its dialog."""
    _press(screen, "Shift_L")
    return {}


def enter(screen: Screen, text: str) -> _Facts:
    """Replace the content of the field that has the focus by `text`, then press Return.

    `typed` is False, and nothing was pressed, if the keyboard lacks one of the characters.
    """
    keys = [_find_key(screen, letter) for letter in text]
    if None in keys:
        return {"typed": False}
    wake(screen)
    time.sleep(DIALOG)
    _press(screen, "a", "Control_L")
    _press(screen, "BackSpace")
    shift = _keycode(screen, "Shift_L")
    for code, shifted in filter(None, keys):
        _strike(screen, code, [shift] if shifted else [])
    _press(screen, "Return")
    return {"typed": True}


def _find_key(screen: Screen, letter: str) -> "tuple[int, bool] | None":
    """The key of a letter, and whether Shift goes with it; `None` if the keyboard has none."""
    symbol = ord(letter)
    if symbol >= LATIN_1:
        symbol |= UNICODE
    for code, level in sorted(screen.display.keysym_to_keycodes(symbol), key=lambda pair: pair[1]):
        if level < 2:  # the higher ones need other keys
            return code, level == 1
    return None


def _keycode(screen: Screen, name: str) -> int:
    return screen.display.keysym_to_keycode(XK.string_to_keysym(name))


def _press(screen: Screen, name: str, *modifiers: str) -> None:
    _strike(screen, _keycode(screen, name), [_keycode(screen, modifier) for modifier in modifiers])


def _strike(screen: Screen, code: int, modifiers: list[int]) -> None:
    for keycode in [*modifiers, code]:
        xtest.fake_input(screen.display, X.KeyPress, keycode)
    for keycode in [code, *reversed(modifiers)]:
        xtest.fake_input(screen.display, X.KeyRelease, keycode)
    screen.display.sync()
    time.sleep(KEY_PAUSE)


def _key_came(screen: Screen) -> bool:
    for _ in range(screen.display.pending_events()):
        if screen.display.next_event().type == X.KeyPress:
            return True
    return False


OPERATIONS: dict[str, Callable[..., _Facts]] = {"lock": lock, "wake": wake, "enter": enter}


def main(operation: str, fields: str) -> None:
    """Carry out an operation with JSON `fields` on the default display, and print JSON."""
    print(json.dumps(OPERATIONS[operation](Screen.open(), **json.loads(fields))))
