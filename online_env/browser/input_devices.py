"""Pointer and keyboard of a browser: pyautogui calls become input events of the DevTools protocol.

The code of an agent is read by the grammar of `hijack_data.actions` and never run.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeAlias, cast

from hijack_data.actions.pyautogui_functions import KEYBOARD, POINTER
from hijack_data.actions.pyautogui_grammar import PyautoguiCall
from hijack_data.errors import ActionError
from hijack_data.types import Point, Size

# An input event: a method, such as `Input.insertText`, and its parameters.
InputEvent: TypeAlias = tuple[str, dict[str, Any]]
# Sends events, and waits until the page has handled them all.
SendInput: TypeAlias = Callable[[Sequence[InputEvent]], None]
Shortcut: TypeAlias = Callable[[frozenset[str], str], bool]

MAX_SLEEP_S = 60.0
WHEEL_PIXELS = 53  # CSS pixels of one click of the wheel, as in Chromium on Linux
MAX_EVENTS = 32  # of characters, sent at once: a page that opens another one gets them all
DRAG_MOVES = 10  # moves of the pointer between the ends of a drag
_BUTTONS = {"left": 1, "primary": 1, "right": 2, "secondary": 2, "middle": 4}
_NAMES = {1: "left", 2: "right", 4: "middle"}
_CLICKS = {"doubleClick": 2, "tripleClick": 3}
_CLICK_BUTTONS = {"rightClick": "right", "middleClick": "middle"}
_MODIFIERS = {"alt": 1, "ctrl": 2, "meta": 4, "shift": 8}
_ALIASES = {
    "altleft": "alt",
    "altright": "alt",
    "option": "alt",
    "ctrlleft": "ctrl",
    "ctrlright": "ctrl",
    "control": "ctrl",
    "win": "meta",
    "winleft": "meta",
    "winright": "meta",
    "command": "meta",
    "shiftleft": "shift",
    "shiftright": "shift",
    "return": "enter",
    "\n": "enter",
    "\r": "enter",
    "\t": "tab",
    "escape": "esc",
    "del": "delete",
    "pgup": "pageup",
    "pgdn": "pagedown",
    " ": "space",
}
# Of each key by pyautogui's name: the DOM's key and code, the virtual key code, and what it types.
_KEYS: dict[str, tuple[str, str, int, str]] = {
    "alt": ("Alt", "AltLeft", 18, ""),
    "ctrl": ("Control", "ControlLeft", 17, ""),
    "meta": ("Meta", "MetaLeft", 91, ""),
    "shift": ("Shift", "ShiftLeft", 16, ""),
    "enter": ("Enter", "Enter", 13, "\r"),
    "tab": ("Tab", "Tab", 9, ""),
    "space": (" ", "Space", 32, " "),
    "backspace": ("Backspace", "Backspace", 8, ""),
    "delete": ("Delete", "Delete", 46, ""),
    "insert": ("Insert", "Insert", 45, ""),
    "esc": ("Escape", "Escape", 27, ""),
    "home": ("Home", "Home", 36, ""),
    "end": ("End", "End", 35, ""),
    "pageup": ("PageUp", "PageUp", 33, ""),
    "pagedown": ("PageDown", "PageDown", 34, ""),
    "left": ("ArrowLeft", "ArrowLeft", 37, ""),
    "up": ("ArrowUp", "ArrowUp", 38, ""),
    "right": ("ArrowRight", "ArrowRight", 39, ""),
    "down": ("ArrowDown", "ArrowDown", 40, ""),
    **{f"f{number}": (f"F{number}", f"F{number}", 111 + number, "") for number in range(1, 13)},
}
# The US keyboard: which key types a character with Shift, and the codes of keys that are no letters
# or digits.
_SHIFTED = dict(zip('~!@#$%^&*()_+{}|:"<>?', "`1234567890-=[]\\;',./", strict=True))
_PUNCTUATION = {
    ";": ("Semicolon", 186),
    "=": ("Equal", 187),
    ",": ("Comma", 188),
    "-": ("Minus", 189),
    ".": ("Period", 190),
    "/": ("Slash", 191),
    "`": ("Backquote", 192),
    "[": ("BracketLeft", 219),
    "\\": ("Backslash", 220),
    "]": ("BracketRight", 221),
    "'": ("Quote", 222),
}


class InputDevices:
    """The pointer and the keyboard of one browser; buttons and keys stay down between actions.

    Args:
        send: Sends events to the page in front.
        shortcut: Carries out a shortcut of the browser itself; whether there is one for these keys.
        size: `(height, width)` of the screen in pixels.
        scale: Pixels of the screen for each CSS pixel.
    """

    def __init__(self, send: SendInput, shortcut: Shortcut, size: Size, scale: int) -> None:
        self._send = send
        self._shortcut = shortcut
        self._size = size
        self._scale = scale
        self._down = 0  # a bit for each mouse button
        self._modifiers: set[str] = set()
        self.position: Point = (size[1] // 2, size[0] // 2)

    def perform(self, call: PyautoguiCall) -> None:
        """Carry out one call.

        Raises:
            ActionError: An argument is wrong, or there is no such key or button.
            DesktopError: The page does not answer.
        """
        name = call.function
        if name == "sleep":
            seconds = _number(call, {**call.bind(("seconds",))}, "seconds", 0.0)
            if not 0 <= seconds <= MAX_SLEEP_S:
                raise ActionError(f"sleep takes 0 to {MAX_SLEEP_S:g} seconds, got {seconds:g}")
            time.sleep(seconds)
        elif name in KEYBOARD:
            self._use_keyboard(call)
        else:
            self._use_pointer(call)

    # Pointer

    def move(self, point: Point) -> None:
        """Move the pointer to a point of the screen, in pixels."""
        height, width = self._size
        self.position = (min(max(point[0], 0), width - 1), min(max(point[1], 0), height - 1))
        self._mouse("mouseMoved", button=_NAMES.get(self._down, "none"))

    def click(self, button: str = "left", count: int = 1) -> None:
        """Click where the pointer is, `count` times in quick succession."""
        for number in range(1, count + 1):
            self._press(button, number)
            self._release(button, number)

    def _use_pointer(self, call: PyautoguiCall) -> None:
        name = call.function
        values = {key: argument.value for key, argument in call.bind(POINTER[name]).items()}
        x, y = _pair(values, "xOffset", "yOffset")
        if name in ("move", "moveRel", "drag", "dragRel"):
            target = self.position[0] + int(x or 0), self.position[1] + int(y or 0)
        else:
            x, y = _pair(values, "x", "y")
            target = (
                self.position[0] if x is None else int(x),
                self.position[1] if y is None else int(y),
            )
        button = str(values.get("button") or _CLICK_BUTTONS.get(name, "left"))
        if button not in _BUTTONS:
            raise ActionError(f"no mouse button {button!r}; known: {', '.join(_BUTTONS)}")
        if name.startswith("drag"):
            self._drag(target, button)
            return
        if target != self.position or x is not None:
            self.move(target)
        if name.endswith("scroll"):
            self._scroll(int(_number(call, call.bind(POINTER[name]), "clicks", 0)), name)
        elif name == "mouseDown":
            self._press(button, 1)
        elif name == "mouseUp":
            self._release(button, 1)
        elif "click" in name.lower():
            count = _CLICKS.get(name, 0) or int(
                _number(call, call.bind(POINTER[name]), "clicks", 1)
            )
            self.click(button, count)

    def _drag(self, target: Point, button: str) -> None:
        (x1, y1), (x2, y2) = self.position, target
        self._press(button, 1)
        for i in range(1, DRAG_MOVES + 1):
            share = i / DRAG_MOVES
            self.move((round(x1 + (x2 - x1) * share), round(y1 + (y2 - y1) * share)))
        self._release(button, 1)

    def _scroll(self, clicks: int, name: str) -> None:
        pixels = clicks * WHEEL_PIXELS
        horizontal = name == "hscroll"
        self._mouse(
            "mouseWheel", deltaX=pixels if horizontal else 0, deltaY=0 if horizontal else -pixels
        )

    def _press(self, button: str, count: int) -> None:
        self._down |= _BUTTONS[button]
        self._mouse("mousePressed", button=_NAMES[_BUTTONS[button]], clickCount=count)

    def _release(self, button: str, count: int) -> None:
        self._down &= ~_BUTTONS[button]
        self._mouse("mouseReleased", button=_NAMES[_BUTTONS[button]], clickCount=count)

    def _mouse(self, kind: str, **fields: Any) -> None:
        x, y = ((value + 0.5) / self._scale for value in self.position)
        fields |= {"x": x, "y": y, "buttons": self._down, "modifiers": self._modifier_bits()}
        self._send([("Input.dispatchMouseEvent", {"type": kind, **fields})])

    # Keyboard

    def type(self, text: str) -> None:
        """Type a text where the focus is; what no key of a US keyboard types is inserted."""
        events: list[InputEvent] = []
        for character in text:
            is_held = bool(self._modifiers - {"shift"})
            is_key = character.isascii() and (is_held or not character.isprintable())
            if not is_key:
                events += self._typing_events(character)
            if is_key or len(events) >= MAX_EVENTS:
                self._send(events)
                events = []
            if is_key:
                self.press(character)
        self._send(events)

    def press(self, name: str) -> None:
        """Press and release a key."""
        if self._key_down(name):
            self._key_up(name)

    def _use_keyboard(self, call: PyautoguiCall) -> None:
        name = call.function
        if name == "hotkey":
            keys = [key for argument in call.positional for key in _texts(argument.value)]
            pressed = [key for key in keys if self._key_down(key)]
            for key in reversed(pressed):
                self._key_up(key)
            return
        bound = call.bind(KEYBOARD[name])
        values = {key: argument.value for key, argument in bound.items()}
        argument = next(iter(values.values()), None)
        if name in ("write", "typewrite") and isinstance(argument, str):
            self.type(argument)
        elif name in ("keyDown", "keyUp"):
            for key in _texts(argument):
                (self._key_down if name == "keyDown" else self._key_up)(key)
        else:
            for _ in range(int(_number(call, bound, "presses", 1))):
                for key in _texts(argument):
                    self.press(key)

    def _key_down(self, name: str) -> bool:
        """Press a key; return whether the page got it, and not the browser as a shortcut.

        Raises:
            ActionError: There is no such key.
        """
        fields, text, key = self._key(name)
        if key in _MODIFIERS:
            self._modifiers.add(key)
        elif self._shortcut(frozenset(self._modifiers), key):
            return False
        self._send([_down_event(fields, "" if self._modifiers - {"shift"} else text)])
        return True

    def _key_up(self, name: str) -> None:
        fields, _, key = self._key(name)
        self._modifiers.discard(key)
        self._send([_up_event(fields, self._modifier_bits())])

    def _typing_events(self, character: str) -> list[InputEvent]:
        if not character.isascii():
            return [("Input.insertText", {"text": character})]
        fields, text, _ = self._key(character)
        return [_down_event(fields, text), _up_event(fields, self._modifier_bits())]

    def _key(self, name: str) -> tuple[dict[str, Any], str, str]:
        """Return the fields of a key's event, what it types, and its one name.

        Raises:
            ActionError: There is no such key.
        """
        key = name if len(name) == 1 and name not in _ALIASES else name.lower()
        key = _ALIASES.get(key, key)
        modifiers = self._modifier_bits()
        if key in _KEYS:
            dom_key, code, number, text = _KEYS[key]
        elif len(key) == 1:
            base = _SHIFTED.get(key, key.lower())
            if base != key:
                modifiers |= _MODIFIERS["shift"]
            elif "shift" in self._modifiers and key.isalpha():
                key = key.upper()
            dom_key = text = key
            if base.isascii() and base.isalnum():
                code, number = (
                    f"{'Digit' if base.isdigit() else 'Key'}{base.upper()}",
                    ord(base.upper()),
                )
            else:
                code, number = _PUNCTUATION.get(base, ("", 0))
            key = base
        else:
            raise ActionError(f"there is no key {name!r}")
        if key in _MODIFIERS:
            modifiers |= _MODIFIERS[key]
        fields = {"key": dom_key, "code": code, "windowsVirtualKeyCode": number}
        return {**fields, "modifiers": modifiers}, text, key

    def _modifier_bits(self) -> int:
        return sum(_MODIFIERS[name] for name in self._modifiers)


def _down_event(fields: dict[str, Any], text: str) -> InputEvent:
    typed = {"type": "keyDown", "text": text} if text else {"type": "rawKeyDown"}
    return "Input.dispatchKeyEvent", {**typed, **fields}


def _up_event(fields: dict[str, Any], modifiers: int) -> InputEvent:
    return "Input.dispatchKeyEvent", {**fields, "type": "keyUp", "modifiers": modifiers}


def _pair(values: dict[str, Any], first: str, second: str) -> tuple[Any, Any]:
    """Return the two coordinates of a call, of which the first may be a pair.

    Raises:
        ActionError: One of them is no number.
    """
    x, y = values.get(first), values.get(second)
    if isinstance(x, tuple):
        x, y = cast("tuple[Any, Any]", (*x, None, None)[:2])
    for value in (x, y):
        if value is not None and not isinstance(value, int | float):
            raise ActionError(f"a coordinate is a number, got {value!r:.80}")
    return x, y


def _number(call: PyautoguiCall, bound: Any, name: str, default: float) -> float:
    argument = bound.get(name)
    value = default if argument is None else argument.value
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ActionError(f"{call.function}: {name} is a number, got {value!r:.80}")
    return value


def _texts(value: object) -> Iterator[str]:
    """Yield the names of keys, of one text or a sequence of texts.

    Raises:
        ActionError: One of them is no text.
    """
    names = value if isinstance(value, tuple) else (value,)
    for name in cast("tuple[object, ...]", names):
        if not isinstance(name, str):
            raise ActionError(f"a key is a text, got {name!r:.80}")
        yield name
