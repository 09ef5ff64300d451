"""The part of pyautogui 0.9.54 that agents' code uses; the desktop's `import pyautogui` finds this.

The real one types `<` as `>` there, drops accents, cannot take screenshots on Xfce, needs tkinter,
and installs an old Xlib over ours. Names, argument names and defaults are those of pyautogui; the
parts that are left out (finding pictures on the screen, message boxes) raise an AttributeError with
the reason.
"""

import functools
import math
import sys
import time
from collections import namedtuple
from collections.abc import Sequence
from contextlib import contextmanager

from ah_input import (
    KEY_NAMES,
    KEYSYMS,
    Connection,
    Keyboard,
    Pointer,
    UnknownButtonError,
    UnknownKeyError,
)
from ah_input.keys import character_keysym
from ah_tweens import TWEENS, linear

__version__ = "0.9.54"
KEYBOARD_KEYS = KEY_NAMES
LEFT = "left"
MIDDLE = "middle"
RIGHT = "right"
PRIMARY = "primary"
SECONDARY = "secondary"
PAUSE = 0.1
MINIMUM_DURATION = 0.1
MINIMUM_SLEEP = 0.05
FAILSAFE = True
LOG_SCREENSHOTS = False
LOG_SCREENSHOTS_LIMIT = 10
globals().update(TWEENS)

Point = namedtuple("Point", "x y")
Size = namedtuple("Size", "width height")


class PyAutoGUIException(Exception):
    """A wrong argument."""


class FailSafeException(PyAutoGUIException):
    """The pointer is in a corner of the screen and `FAILSAFE` is on."""


class ImageNotFoundException(PyAutoGUIException):
    """Kept for `except` clauses; never raised here."""


def __getattr__(name):
    if name == "FAILSAFE_POINTS":
        width, height = size()
        return [(0, 0), (width - 1, 0), (0, height - 1), (width - 1, height - 1)]
    raise AttributeError(
        f"this desktop's pyautogui has no {name!r}: it moves, clicks, drags, scrolls, types and"
        " takes screenshots; find pictures and show messages by other means"
    )


@functools.cache
def _devices():
    connection = Connection()
    return connection, Pointer(connection), Keyboard(connection)


def _acts(function):
    """Check the fail-safe before a function, pause after it, and raise pyautogui's exception."""

    @functools.wraps(function)
    def wrapper(*args, **kwargs):
        failSafeCheck()
        try:
            value = function(*args, **kwargs)
        except (UnknownButtonError, UnknownKeyError) as error:
            raise PyAutoGUIException(str(error)) from None
        if kwargs.get("_pause", True) and PAUSE:
            time.sleep(PAUSE)
        return value

    return wrapper


def failSafeCheck():
    """Check that the pointer is not in a corner of the screen while `FAILSAFE` is on.

    Raises:
        FailSafeException: It is.
    """
    module = sys.modules[__name__]
    if FAILSAFE and tuple(position()) in [tuple(point) for point in module.FAILSAFE_POINTS]:
        raise FailSafeException(
            "the pointer is in a corner of the screen; set pyautogui.FAILSAFE = False to allow it"
        )


def position(x=None, y=None):
    """Where the pointer is; `x` and `y` replace what they are given for."""
    point = _devices()[1].position
    return Point(point[0] if x is None else int(x), point[1] if y is None else int(y))


def size():
    """The size of the screen in pixels."""
    return Size(*_devices()[0].size)


resolution = size


def onScreen(x, y=None):
    """Whether a point is on the screen."""
    x, y = _point(x, y)
    width, height = size()
    return 0 <= x < width and 0 <= y < height


def _point(x, y):
    """The point that two arguments mean.

    They are numbers, None for where the pointer is, a pair, or a box, which means its middle.

    Raises:
        PyAutoGUIException: They are something else.
    """
    if isinstance(x, str):
        raise PyAutoGUIException(
            f"finding the picture {x!r} on the screen is not possible here; give coordinates"
        )
    if isinstance(x, Sequence):
        if y is not None or len(x) not in (2, 4):
            raise PyAutoGUIException(
                f"a point is two numbers, a pair or (left, top, width, height), not {x!r}, {y!r}"
            )
        x, y = x if len(x) == 2 else (x[0] + x[2] / 2, x[1] + x[3] / 2)
    if x is None or y is None:
        current = position()
        x = current.x if x is None else x
        y = current.y if y is None else y
    return Point(int(x), int(y))


def _offset(x, y):
    if isinstance(x, Sequence) and not isinstance(x, str):
        x, y = x
    return int(x or 0), int(y or 0)


def _go(x, y, duration, tween):
    if x is not None or y is not None:
        _devices()[1].move(*_point(x, y), duration if duration > MINIMUM_DURATION else 0.0, tween)


@_acts
def moveTo(x=None, y=None, duration=0.0, tween=linear, logScreenshot=False, _pause=True):
    """Move the pointer to a point in `duration` seconds."""
    _go(x, y, duration, tween)


@_acts
def moveRel(
    xOffset=None, yOffset=None, duration=0.0, tween=linear, logScreenshot=False, _pause=True
):
    """Move the pointer by an offset in `duration` seconds."""
    (x, y), (dx, dy) = position(), _offset(xOffset, yOffset)
    _go(x + dx, y + dy, duration, tween)


move = moveRel


@_acts
def mouseDown(
    x=None, y=None, button=PRIMARY, duration=0.0, tween=linear, logScreenshot=None, _pause=True
):
    """Press a button at a point."""
    _go(x, y, duration, tween)
    _devices()[1].down(button)


@_acts
def mouseUp(
    x=None, y=None, button=PRIMARY, duration=0.0, tween=linear, logScreenshot=None, _pause=True
):
    """Release a button at a point."""
    _go(x, y, duration, tween)
    _devices()[1].up(button)


@_acts
def click(
    x=None,
    y=None,
    clicks=1,
    interval=0.0,
    button=PRIMARY,
    duration=0.0,
    tween=linear,
    logScreenshot=None,
    _pause=True,
):
    """Click `clicks` times at a point."""
    _go(x, y, duration, tween)
    _devices()[1].click(button, clicks, interval)


@_acts
def leftClick(
    x=None, y=None, interval=0.0, duration=0.0, tween=linear, logScreenshot=None, _pause=True
):
    """Click the left button."""
    click(x, y, 1, interval, LEFT, duration, tween, _pause=False)


@_acts
def rightClick(
    x=None, y=None, interval=0.0, duration=0.0, tween=linear, logScreenshot=None, _pause=True
):
    """Click the right button."""
    click(x, y, 1, interval, RIGHT, duration, tween, _pause=False)


@_acts
def middleClick(
    x=None, y=None, interval=0.0, duration=0.0, tween=linear, logScreenshot=None, _pause=True
):
    """Click the middle button."""
    click(x, y, 1, interval, MIDDLE, duration, tween, _pause=False)


@_acts
def doubleClick(
    x=None,
    y=None,
    interval=0.0,
    button=LEFT,
    duration=0.0,
    tween=linear,
    logScreenshot=None,
    _pause=True,
):
    """Click twice."""
    click(x, y, 2, interval, button, duration, tween, _pause=False)


@_acts
def tripleClick(
    x=None,
    y=None,
    interval=0.0,
    button=LEFT,
    duration=0.0,
    tween=linear,
    logScreenshot=None,
    _pause=True,
):
    """Click three times."""
    click(x, y, 3, interval, button, duration, tween, _pause=False)


@_acts
def scroll(clicks, x=None, y=None, logScreenshot=None, _pause=True):
    """Turn the wheel up by `clicks` at a point; down where negative."""
    _go(x, y, 0.0, None)
    _devices()[1].scroll(int(clicks))


vscroll = scroll


@_acts
def hscroll(clicks, x=None, y=None, logScreenshot=None, _pause=True):
    """Turn the wheel right by `clicks` at a point; left where negative."""
    _go(x, y, 0.0, None)
    _devices()[1].scroll(int(clicks), horizontal=True)


def _drag(x, y, duration, tween, button, path):
    pointer = _devices()[1]
    if path:
        pointer.drag(x, y, button, duration, tween)
    else:
        pointer.drag_move(x, y, duration, tween)


@_acts
def dragTo(
    x=None,
    y=None,
    duration=0.0,
    tween=linear,
    button=PRIMARY,
    logScreenshot=None,
    _pause=True,
    mouseDownUp=True,
):
    """Drag to a point; the button stays as it is where `mouseDownUp` is False."""
    _drag(*_point(x, y), duration, tween, button, mouseDownUp)


@_acts
def dragRel(
    xOffset=0,
    yOffset=0,
    duration=0.0,
    tween=linear,
    button=PRIMARY,
    logScreenshot=None,
    _pause=True,
    mouseDownUp=True,
):
    """Drag by an offset."""
    (x, y), (dx, dy) = position(), _offset(xOffset, yOffset)
    if dx or dy:
        _drag(x + dx, y + dy, duration, tween, button, mouseDownUp)


drag = dragRel


def isValidKey(key):
    """Whether a key of that name can be pressed."""
    return bool(character_keysym(key) if len(key) == 1 else KEYSYMS.get(key.lower()))


def _known(key):
    """Whether to go on with a key.

    As in pyautogui an unknown one does nothing, but here a message says so.
    """
    if not isValidKey(key):
        print(f"pyautogui: there is no key {key!r}; nothing was pressed", file=sys.stderr)
    return isValidKey(key)


def _list(keys):
    return [keys] if isinstance(keys, str) else list(keys)


@_acts
def keyDown(key, logScreenshot=None, _pause=True):
    """Press a key and leave it down."""
    if _known(key):
        _devices()[2].down(key)


@_acts
def keyUp(key, logScreenshot=None, _pause=True):
    """Release a key."""
    if _known(key):
        _devices()[2].up(key)


@_acts
def press(keys, presses=1, interval=0.0, logScreenshot=None, _pause=True):
    """Press and release a key, or each of a list of keys, `presses` times."""
    for _ in range(presses):
        for key in filter(_known, _list(keys)):
            _devices()[2].press(key)
        time.sleep(float(interval))


@contextmanager
def hold(keys, logScreenshot=None, _pause=True):
    """Hold keys while the `with` block runs."""
    keys = _list(keys)
    for key in keys:
        keyDown(key, _pause=False)
    try:
        yield
    finally:
        for key in keys:
            keyUp(key, _pause=False)


@_acts
def typewrite(message, interval=0.0, logScreenshot=None, _pause=True):
    """Type a text exactly, or press each of a list of keys."""
    if isinstance(message, str):
        _devices()[2].type(message, float(interval))
    else:
        press(list(message), interval=0.0, _pause=False)


write = typewrite


@_acts
def hotkey(*args, **kwargs):
    """Press keys in order and release them in reverse; also a list of keys."""
    keys = _list(args[0]) if len(args) == 1 else list(args)
    _devices()[2].hotkey([key for key in keys if _known(key)], float(kwargs.get("interval", 0.0)))


shortcut = hotkey


def screenshot(imageFilename=None, region=None):
    """The screen as a PIL image (needs python3-pil); saved as `imageFilename` where given."""
    from ah_screen import grab

    return grab(_devices()[0], imageFilename, region)


def sleep(seconds):
    """Wait."""
    time.sleep(seconds)


def center(box):
    """The middle of `(left, top, width, height)`."""
    return Point(math.floor(box[0] + box[2] / 2), math.floor(box[1] + box[3] / 2))


# Agents' code may use these as well: they are part of pyautogui's interface.
DARWIN_CATCH_UP_TIME = 0.01
_SHIFTED = '~!@#$%^&*()_+{}|:"<>?'


def countdown(seconds):
    """Count down on standard output."""
    for seconds_left in range(seconds, 0, -1):
        print(seconds_left, end=" ", flush=True)
        time.sleep(1)
    print()


def isShiftCharacter(character):
    """Whether a character needs Shift on a US keyboard."""
    return character.isupper() or character in _SHIFTED


def getPointOnLine(x1, y1, x2, y2, n):
    """The point a share `n` of the way along a line."""
    return (x2 - x1) * n + x1, (y2 - y1) * n + y1
