"""Write an `Action` as pyautogui code: the inverse of `pyautogui_parse`."""

import math
from collections.abc import Callable, Mapping
from dataclasses import fields

from ...errors import ActionError
from ...types import Action

_WORDS = {"wait": "WAIT", "done": "DONE", "fail": "FAIL"}
_CLICKS = {
    "click": "click",
    "double_click": "doubleClick",
    "triple_click": "tripleClick",
    "right_click": "rightClick",
    "middle_click": "middleClick",
    "move": "moveTo",
    "mouse_down": "mouseDown",
    "mouse_up": "mouseUp",
}


def write_pyautogui(action: Action) -> str:
    """Return the code, or one of WAIT, DONE and FAIL.

    Raises:
        ActionError: pyautogui cannot express the action.
    """
    if action.type in _WORDS:
        return _WORDS[action.type]
    if action.type in _CODE:
        return _CODE[action.type](action)
    if action.type not in _POINTER:
        problem = unsupported_action_error(action, "pyautogui")
        raise problem
    pointed = _POINTER[action.type](action)
    keys = action.keys or ()
    down = [f"pyautogui.keyDown({key!r})" for key in keys]
    up = [f"pyautogui.keyUp({key!r})" for key in reversed(keys)]
    return "\n".join([*down, pointed, *up])


def unsupported_action_error(action: Action, dialect: str) -> ActionError:
    """Return the error for an action that a dialect cannot express."""
    field_names = [
        field.name for field in fields(action) if getattr(action, field.name) is not None
    ]
    field_names.remove("type")
    names = ", ".join(field_names) or "nothing else"
    return ActionError(f"{dialect} cannot say {action.type!r} with {names}")


def whole_notches(amount: float) -> int:
    """Return the nearest whole number of notches, at least one if the wheel turns at all.

    A wheel has no half notches: pyautogui drops fractions, so 0.4 notches would scroll nothing.
    """
    if amount == 0:
        return 0
    turned = max(1, math.floor(abs(amount) + 0.5))
    return turned if amount > 0 else -turned


def hscroll_code(notches: float, point: tuple[int, int] | None) -> str:
    """Return code that scrolls sideways, at the pointer if `point` is `None`; right is positive."""
    amount = whole_notches(notches)
    if point is None:
        return f"pyautogui.hscroll({amount})"
    return f"pyautogui.hscroll({amount}, {point[0]}, {point[1]})"


def _point(x: int | None, y: int | None) -> str:
    if x is None or y is None:
        return ""
    return f"{x}, {y}"


def _drag(action: Action) -> str:
    start = _point(action.x, action.y)
    end = _point(action.x2, action.y2)
    if not end:
        raise unsupported_action_error(action, "pyautogui")
    drag = f"pyautogui.dragTo({end}, button='left')"
    if not start:
        return drag
    return f"pyautogui.moveTo({start})\n{drag}"


def _scroll(action: Action) -> str:
    coordinates = _point(action.x, action.y)
    if action.amount is None:
        raise unsupported_action_error(action, "pyautogui")
    notches = whole_notches(action.amount)
    if not coordinates:
        return f"pyautogui.scroll({notches})"
    return f"pyautogui.scroll({notches}, {coordinates})"


def _type(action: Action) -> str:
    if action.text is None:
        raise unsupported_action_error(action, "pyautogui")
    return f"pyautogui.write({action.text!r})"


def _keys(action: Action) -> tuple[str, ...]:
    if not action.keys:
        raise unsupported_action_error(action, "pyautogui")
    return action.keys


def _hotkey(action: Action) -> str:
    keys = _keys(action)
    if action.amount and action.amount > 0:  # seconds for which they are held
        down = [f"pyautogui.keyDown({key!r})" for key in keys]
        up = [f"pyautogui.keyUp({key!r})" for key in reversed(keys)]
        return "\n".join([*down, f"pyautogui.sleep({action.amount:g})", *up])
    function = "press" if len(keys) == 1 else "hotkey"
    return f"pyautogui.{function}({', '.join(map(repr, keys))})"


def _call_for_each_key(name: str) -> Callable[[Action], str]:
    return lambda action: "\n".join(f"pyautogui.{name}({key!r})" for key in _keys(action))


def _call(name: str) -> Callable[[Action], str]:
    return lambda action: f"pyautogui.{name}({_point(action.x, action.y)})"


_POINTER: Mapping[str, Callable[[Action], str]] = {
    **{kind: _call(name) for kind, name in _CLICKS.items()},
    "drag": _drag,
    "scroll": _scroll,
}
_CODE: Mapping[str, Callable[[Action], str]] = {
    "type": _type,
    "hotkey": _hotkey,
    "key_down": _call_for_each_key("keyDown"),
    "key_up": _call_for_each_key("keyUp"),
}
