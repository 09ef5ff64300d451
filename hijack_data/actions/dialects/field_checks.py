"""Checks and names shared by the typed dialects (dicts from tools and models)."""

import math
from collections.abc import Iterable, Mapping
from numbers import Integral, Real
from typing import Any, NoReturn, cast

from ...errors import ActionError, ParameterTypeError, shown, suggest
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
            f"an action of dialect {dialect!r} must be a dict, got {shown(action)}"
        )
    items = cast("Mapping[Any, Any]", action).items()
    return {str(key): value for key, value in items}


def refuse_unknown_action(dialect: str, name: object, known: Iterable[str]) -> NoReturn:
    """Refuse an action name that the dialect does not have.

    Raises:
        ActionError: always, with the closest known name.
    """
    names = {each.lower(): each for each in known}
    wanted = ""
    if isinstance(name, str) and len(name) < 80:
        wanted = name.lower()
    guess = names.get(wanted)
    if guess is None:
        upper_case = all(each.isupper() for each in names.values())
        guess = wanted.upper() if upper_case else wanted
    hint = suggest(guess, names.values())
    raise ActionError(f"{dialect} has no action {shown(name)}{hint}")


def number(value: object, what: str) -> float:
    """Check a finite number.

    Raises:
        ActionError: it is anything else.
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        raise ActionError(f"{what} must be a number, got {shown(value)}; give pixels such as 100")
    try:
        finite = float(value)
    except OverflowError:
        finite = math.inf
    if not math.isfinite(finite):
        raise ActionError(
            f"{what} must be a finite number, got {shown(value)}; give pixels such as 100"
        )
    return int(value) if isinstance(value, Integral) else finite


def point(value: object, what: str) -> tuple[float, float]:
    """Check a pair of numbers `[x, y]`.

    Raises:
        ActionError: it is anything else.
    """
    if not isinstance(value, list | tuple) or len(cast("list[Any]", value)) != 2:
        raise ActionError(f"{what} must be [x, y], got {shown(cast('object', value))}")
    x, y = cast("list[Any]", value)
    return number(x, f"{what}[0]"), number(y, f"{what}[1]")


def text(value: object, what: str) -> str:
    """Check a string.

    Raises:
        ActionError: it is anything else.
    """
    if not isinstance(value, str):
        raise ActionError(f"{what} must be a string, got {shown(value)}")
    return value


def key_names(value: object, what: str, separators: str = "") -> tuple[str, ...]:
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
        raise ActionError(f"{what} must name keys, got {shown(value)}")
    keys = [text(part, what) for part in parts]
    if not keys or "" in keys:
        raise ActionError(f"{what} names no key; give keys such as ['ctrl', 'c']")
    return tuple(_key_name(key) for key in keys)


def key_combination(value: object, what: str, separators: str = "") -> tuple[str, ...]:
    """Return keys that are pressed together, as `key_names`; letters among them are lower case.

    Tools write `["CTRL", "S"]` for Ctrl+S; to pyautogui a capital `S` is Shift as well.
    """
    keys = key_names(value, what, separators)
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


def action_at(type: str, place: tuple[int, int] | None, **rest: Any) -> Action:
    """Return an action at a point, or, for `None`, at the pointer."""
    if place is None:
        return Action(type, **rest)
    x, y = place
    return Action(type, x, y, **rest)
