"""Checks and names shared by the typed dialects (dicts from tools and models)."""

import math
from collections.abc import Iterable, Mapping
from numbers import Integral, Real
from typing import Any, NoReturn, cast

from ...errors import ActionError, ParameterTypeError, short_repr, suggest
from ...types import Action

_KEYS = {
    "return": "enter",
    "escape": "esc",
    "back_space": "backspace",
    "del": "delete",
    "caps_lock": "capslock",
    "control": "ctrl",
    "control_l": "ctrl",
    "shift_l": "shift",
    "alt_l": "alt",
    "option": "alt",
    "super": "win",
    "super_l": "win",
    "meta": "win",
    "cmd": "win",
    "command": "win",
    "page_up": "pageup",
    "page_down": "pagedown",
    "arrowup": "up",
    "arrowdown": "down",
    "arrowleft": "left",
    "arrowright": "right",
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

    Raises:
        ActionError: a key is not a string, or there is none.
    """
    if isinstance(value, str):
        for separator in separators:
            if len(value) > 1:
                value = value.replace(separator, " ")
        parts: list[Any] = [value]
        if separators and value.strip():
            parts = value.split()
    elif isinstance(value, list | tuple):
        parts = list(cast("list[Any]", value))
    else:
        raise ActionError(f"{label} must name keys, got {short_repr(value)}")
    keys = [text(part, label) for part in parts]
    if not keys or "" in keys:
        raise ActionError(f"{label} names no key; give keys such as ['ctrl', 'c']")
    return tuple(_key_name(key) for key in keys)


def key_combination(value: object, label: str, separators: str = "") -> tuple[str, ...]:
    """Return keys that are pressed together, as `key_names`; letters among them are lower case.

    Tools write `["CTRL", "S"]` for Ctrl+S; to pyautogui a capital `S` is Shift as well.
    """
    keys = key_names(value, label, separators)
    if len(keys) == 1:
        return keys
    return tuple(key.lower() for key in keys)


def _key_name(key: str) -> str:
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
