"""Typing and pressing keys."""

import contextlib
import time
from collections.abc import Iterator, Sequence

from Xlib import X

from .connection import Connection
from .keys import CAPS_LOCK, NAMED, SHIFT, character_keysym
from .layout import KeyboardLayout, KeyStroke, typing_lock

MAX_TEXT = 100_000  # characters in one call
BURST = 250  # characters before the application is waited for


class UnknownKeyError(ValueError):
    """A key that does not exist, or a character or an amount of text that can't be typed."""


class Keyboard:
    """The keyboard of a display. Key names are those of pyautogui, or any one character."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._held: list[int] = []

    def down(self, name: str) -> None:
        """Press a key and leave it down.

        A character that the keyboard lacks is typed instead, as it cannot be held.
        """
        self._change(name, True)

    def up(self, name: str) -> None:
        """Release a key."""
        self._change(name, False)

    def press(self, name: str) -> None:
        """Press and release a key."""
        self.down(name)
        self.up(name)

    def hotkey(self, names: Sequence[str], interval: float = 0.0) -> None:
        """Press keys in order and release them in reverse.

        They are released, too, if one of them does not exist.
        """
        pressed: list[str] = []
        try:
            for name in names:
                self.down(name)
                pressed.append(name)
                time.sleep(interval)
        finally:
            for name in reversed(pressed):
                self.up(name)
                time.sleep(interval)

    def type(self, text: str, interval: float = 0.0) -> None:
        """Type `text` exactly, whatever the keyboard's layout and Caps Lock.

        A line break is Return (one of two characters, too), a tab is Tab. Modifiers that are held
        stay held. Another control character, or more than `MAX_TEXT` characters, is an
        `UnknownKeyError` before anything is typed.

        Args:
            text: to type.
            interval: seconds a character.
        """
        symbols = text_keysyms(text)
        layout = KeyboardLayout(self._connection)
        with contextlib.ExitStack() as stack:
            if any(symbol not in layout.keys for symbol in symbols):
                stack.enter_context(typing_lock())
                layout = KeyboardLayout(self._connection)
            stack.enter_context(self._without_caps_lock(layout))
            for run, lacking in layout.chunks(symbols):
                with layout.borrow_keys(lacking) as keys:
                    self._type_run([keys[symbol] for symbol in run], layout, interval)

    def release_all(self) -> None:
        """Release every key that was pressed here and is still down."""
        for code in self._held:
            self._connection.fake(X.KeyRelease, code)
        self._held.clear()
        self._connection.sync()

    def _type_run(self, keys: Sequence[KeyStroke], layout: KeyboardLayout, interval: float) -> None:
        shift_down = self._connection.root.query_pointer().mask & X.ShiftMask
        shift = layout.keys[SHIFT][0]
        for position, (code, shifted) in enumerate(keys, 1):
            lift = shifted and not shift_down
            if lift:
                self._connection.fake(X.KeyPress, shift)
            self._connection.fake(X.KeyPress, code)
            self._connection.fake(X.KeyRelease, code)
            if lift:
                self._connection.fake(X.KeyRelease, shift)
            if interval > 0:
                self._connection.sync()
                time.sleep(interval)
            elif position % BURST == 0:
                self._connection.settle()
        self._connection.sync()

    @contextlib.contextmanager
    def _without_caps_lock(self, layout: KeyboardLayout) -> Iterator[None]:
        on = (
            bool(self._connection.root.query_pointer().mask & X.LockMask)
            and CAPS_LOCK in layout.keys
        )
        if on:
            self._toggle(layout.keys[CAPS_LOCK][0])
        try:
            yield
        finally:
            if on:
                self._toggle(layout.keys[CAPS_LOCK][0])

    def _toggle(self, code: int) -> None:
        self._connection.fake(X.KeyPress, code)
        self._connection.fake(X.KeyRelease, code)
        self._connection.sync()

    def _change(self, name: str, down: bool) -> None:
        symbol = NAMED.get(name.lower(), -1) if len(name) != 1 else character_keysym(name)
        if symbol == -1 or (symbol == 0 and len(name) == 1):
            raise UnknownKeyError(
                f"there is no key {name!r}; keys are pyautogui's KEYBOARD_KEYS or one character"
            )
        layout = KeyboardLayout(self._connection)
        if symbol in layout.keys:
            self._send(*layout.keys[symbol], layout, down)
        elif symbol and down:
            with typing_lock():
                layout = KeyboardLayout(self._connection)
                with layout.borrow_keys([symbol]) as keys:
                    self._type_run([keys[symbol]], layout, 0.0)

    def _send(self, code: int, shifted: bool, layout: KeyboardLayout, down: bool) -> None:
        # As pyautogui does, Shift goes down for the moment of the press only.
        lift = shifted and down and not self._connection.root.query_pointer().mask & X.ShiftMask
        if lift:
            self._connection.fake(X.KeyPress, layout.keys[SHIFT][0])
        self._connection.fake(X.KeyPress if down else X.KeyRelease, code)
        if lift:
            self._connection.fake(X.KeyRelease, layout.keys[SHIFT][0])
        self._connection.sync()
        if down:
            self._held.append(code)
        elif code in self._held:
            self._held.remove(code)


def text_keysyms(text: str) -> list[int]:
    """Return the keysyms that type `text`.

    Raises:
        UnknownKeyError: A character has none, or there are too many.
    """
    if len(text) > MAX_TEXT:
        raise UnknownKeyError(
            f"{len(text)} characters are more than {MAX_TEXT} in one call; write a file or use the"
            " clipboard for these"
        )
    symbols = [character_keysym(character) for character in text.replace("\r\n", "\n")]
    if 0 in symbols:
        character = text.replace("\r\n", "\n")[symbols.index(0)]
        raise UnknownKeyError(
            f"no key types {character!r} (character {symbols.index(0)}); take it out of the text"
        )
    return symbols
