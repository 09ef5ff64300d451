"""Mouse and keyboard of one X display over XTEST, in pyautogui's names.

Used by the guest server and, under the system's Python, by the `pyautogui` module beside it: it
needs python-xlib only.
"""

from .connection import Connection
from .keyboard import MAX_TEXT, Keyboard, UnknownKeyError
from .keys import KEY_NAMES, KEYSYMS
from .pointer import BUTTONS, Pointer, UnknownButtonError

__all__ = [
    "BUTTONS",
    "KEYSYMS",
    "KEY_NAMES",
    "MAX_TEXT",
    "Connection",
    "Keyboard",
    "Pointer",
    "UnknownButtonError",
    "UnknownKeyError",
]
