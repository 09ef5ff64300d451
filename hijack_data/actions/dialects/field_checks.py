"""Checks and names shared by the typed dialects (dicts from tools and models)."""

import math
from collections.abc import Iterable, Mapping
from numbers import Integral, Real
from typing import Any, NoReturn, cast

from ...errors import ActionError, ParameterTypeError, short_repr, suggest
from ...types import Action
from ..pyautogui_functions import KEY_NAMES

# pyautogui's names of keys by those of others, in lower case: of X, which xdotool and Anthropic
# use, and of browsers.
_KEYS = {
    "return": "enter",
    "kp_enter": "enter",
    "escape": "esc",
    "back_space": "backspace",
    "del": "delete",
    "spacebar": "space",
    "caps_lock": "capslock",
    "num_lock": "numlock",
    "scroll_lock": "scrolllock",
    "print_screen": "printscreen",
    "menu": "apps",
    "contextmenu": "apps",
    "control": "ctrl",
    "control_l": "ctrl",
    "control_r": "ctrlright",
    "shift_l": "shift",
    "shift_r": "shiftright",
    "alt_l": "alt",
    "alt_r": "altright",
    "option": "alt",
    "super": "win",
    "super_l": "win",
    "super_r": "winright",
    "windows": "win",
    "meta": "win",
    "cmd": "win",
    "command": "win",
    "page_up": "pageup",
    "prior": "pageup",
    "page_down": "pagedown",
    "next": "pagedown",
    **{f"arrow{way}": way for way in ("up", "down", "left", "right")},
    **{f"arrow_{way}": way for way in ("up", "down", "left", "right")},
    **{f"kp_{digit}": f"num{digit}" for digit in range(10)},
    **{f"kp_{name}": name for name in ("add", "subtract", "multiply", "divide", "decimal")},
    "exclam": "!",
    "quotedbl": '"',
    "numbersign": "#",
    "dollar": "$",
    "percent": "%",
    "ampersand": "&",
    "apostrophe": "'",
    "parenleft": "(",
    "parenright": ")",
    "asterisk": "*",
    "plus": "+",
    "comma": ",",
    "minus": "-",
    "period": ".",
    "slash": "/",
    "colon": ":",
    "semicolon": ";",
    "less": "<",
    "equal": "=",
    "greater": ">",
    "question": "?",
    "at": "@",
    "bracketleft": "[",
    "backslash": "\\",
    "bracketright": "]",
    "asciicircum": "^",
    "underscore": "_",
    "grave": "`",
    "braceleft": "{",
    "bar": "|",
    "braceright": "}",
    "asciitilde": "~",
}
_OTHER_BUTTONS = {
    "right": "right_click",
    "secondary": "right_click",
    "middle": "middle_click",
    "wheel": "middle_click",
}
_REPEATED = {1: "click", 2: "double_click", 3: "triple_click"}


def as_fields(action: object, dialect: str) -> dict[str, Any]:
    """Return a copy of an action given as a mapping with string keys.

    Raises:
        ParameterTypeError: the action is not a mapping with string keys.
    """
    if not isinstance(action, Mapping):
        raise ParameterTypeError(
            f"an action of dialect {dialect!r} must be a dict, got {short_repr(action)}"
        )
    items = cast("Mapping[Any, Any]", action).items()
    return {str(key): value for key, value in items}


def refuse_unknown_action(dialect: str, name: object, valid_names: Iterable[str]) -> NoReturn:
    """Refuse an action name that the dialect does not have.

    Raises:
        ActionError: always, with the closest known name.
    """
    names = {valid_name.lower(): valid_name for valid_name in valid_names}
    lower_name = ""
    if isinstance(name, str) and len(name) < 80:
        lower_name = name.lower()
    guess = names.get(lower_name)
    if guess is None:
        upper_case = all(valid_name.isupper() for valid_name in names.values())
        guess = lower_name.upper() if upper_case else lower_name
    hint = suggest(guess, names.values())
    raise ActionError(f"{dialect} has no action {short_repr(name)}{hint}")


def number(value: object, label: str) -> float:
    """Check a finite number.

    Raises:
        ActionError: it is anything else.
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        raise ActionError(
            f"{label} must be a number, got {short_repr(value)}; give pixels such as 100"
        )
    try:
        finite = float(value)
    except OverflowError:
        finite = math.inf
    if not math.isfinite(finite):
        raise ActionError(
            f"{label} must be a finite number, got {short_repr(value)}; give pixels such as 100"
        )
    return int(value) if isinstance(value, Integral) else finite


def point(value: object, label: str) -> tuple[float, float]:
    """Check a pair of numbers `[x, y]`.

    Raises:
        ActionError: it is anything else.
    """
    if not isinstance(value, list | tuple) or len(cast("list[Any]", value)) != 2:
        raise ActionError(f"{label} must be [x, y], got {short_repr(cast('object', value))}")
    x, y = cast("list[Any]", value)
    return number(x, f"{label}[0]"), number(y, f"{label}[1]")


def text(value: object, label: str) -> str:
    """Check a string.

    Raises:
        ActionError: it is anything else.
    """
    if not isinstance(value, str):
        raise ActionError(f"{label} must be a string, got {short_repr(value)}")
    return value


def key_names(value: object, label: str, separators: str = "") -> tuple[str, ...]:
    """Return keys under pyautogui's names in lower case, from a list or a separated string.

    A separator that stands last and follows another one or a space is a key: `ctrl++`.

    Raises:
        ActionError: a key is not a string or pyautogui does not know it, or there is none; or one
            is there twice: no dialect says what that does, and a model may mean two presses.
    """
    keys = key_sequence(value, label, separators)
    lower_keys = [key.lower() for key in keys]
    twice = next((key for key in lower_keys if lower_keys.count(key) > 1), None)
    if twice is not None:
        raise ActionError(
            f"{label} names {twice!r} more than once, and its keys are pressed together; give an"
            " action for each press"
        )
    return keys


def key_sequence(value: object, label: str, separators: str = "") -> tuple[str, ...]:
    """Return keys as `key_names`, which may be pressed one after the other.

    Raises:
        ActionError: a key is not a string or pyautogui does not know it, or there is none.
    """
    if isinstance(value, str):
        parts = _separated(value, separators) if value.strip() else [value]
    elif isinstance(value, list | tuple):
        texts = [text(part, label) for part in cast("list[Any]", value)]
        parts = [
            name
            for part in texts
            for name in (_separated(part, separators) if part.strip() else [part])
        ]
    else:
        raise ActionError(f"{label} must name keys, got {short_repr(value)}")
    if not parts or "" in parts:
        raise ActionError(f"{label} names no key; give keys such as ['ctrl', 'c']")
    keys = tuple(key_name(key) for key in parts)
    for key, part in zip(keys, parts, strict=True):
        if len(key) > 1 and key not in KEY_NAMES:
            raise ActionError(
                f"{label}: {short_repr(part)} is not the name of a key in pyautogui"
                f"{suggest(key, KEY_NAMES)}; give keys such as ['ctrl', 'c']"
            )
    return keys


def _separated(keys: str, separators: str) -> list[str]:
    """Return the keys that a text names, or the text if nothing separates them."""
    if not separators or len(keys) == 1:
        return [keys]
    before, last = keys.rstrip()[:-1], keys.rstrip()[-1]
    is_key = last in separators and before[-1:] in (*separators, " ")
    if is_key:
        keys = before
    for separator in separators:
        keys = keys.replace(separator, " ")
    return [*keys.split(), *([last] if is_key else [])]


def key_combination(value: object, label: str, separators: str = "") -> tuple[str, ...]:
    """Return keys that are pressed together, as `key_names`; letters among them are lower case.

    Tools write `["CTRL", "S"]` for Ctrl+S; to pyautogui a capital `S` is Shift as well.
    """
    keys = key_names(value, label, separators)
    if len(keys) == 1:
        return keys
    return tuple(key.lower() for key in keys)


def key_name(key: str) -> str:
    """Return pyautogui's name of a key, or the given one in lower case if it has none."""
    lower = key.lower()
    if lower in _KEYS:
        return _KEYS[lower]
    return lower if len(key) > 1 else key


def click_type(button: object, clicks: object) -> str:
    """Return the action type of so many clicks of a button; `"other"` if there is none."""
    if not isinstance(button, str) or not isinstance(clicks, int):
        return "other"
    if button.lower() in ("left", "primary"):
        return _REPEATED.get(clicks, "other")
    if clicks != 1:
        return "other"
    return _OTHER_BUTTONS.get(button.lower(), "other")


def action_at(type: str, point: tuple[int, int] | None, **fields: Any) -> Action:
    """Return an action at a point, or, for `None`, at the pointer."""
    if point is None:
        return Action(type, **fields)
    x, y = point
    return Action(type, x, y, **fields)
