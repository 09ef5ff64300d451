"""An `Action` as pyautogui code: the way back from `pyautogui_parse`."""

from collections.abc import Callable, Mapping
from dataclasses import fields

from ..errors import ActionError
from ..types import Action

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
    """Return the code, or one of WAIT, DONE and FAIL. Raises `ActionError` for what pyautogui cannot say."""
    if action.type in _WORDS:
        return _WORDS[action.type]
    if action.type in _CODE:
        return _CODE[action.type](action)
    if action.type not in _POINTER:
        raise cannot_say(action, "pyautogui")
    held = action.keys or ()
    down = [f"pyautogui.keyDown({key!r})" for key in held]
    up = [f"pyautogui.keyUp({key!r})" for key in reversed(held)]
    return "\n".join([*down, _POINTER[action.type](action), *up])


def cannot_say(action: Action, dialect: str) -> ActionError:
    """The error for an action that a dialect has no words for."""
    names = [field.name for field in fields(action) if field.name != "type" and getattr(action, field.name) is not None]
    return ActionError(f"{dialect} cannot say {action.type!r} with {', '.join(names) or 'nothing else'}")


def _point(x: int | None, y: int | None) -> str:
    return "" if x is None or y is None else f"{x}, {y}"


def _drag(action: Action) -> str:
    start, end = _point(action.x, action.y), _point(action.x2, action.y2)
    if not end:
        raise cannot_say(action, "pyautogui")
    return (f"pyautogui.moveTo({start})\n" if start else "") + f"pyautogui.dragTo({end}, button='left')"


def _scroll(action: Action) -> str:
    place = _point(action.x, action.y)
    if action.amount is None:
        raise cannot_say(action, "pyautogui")
    return f"pyautogui.scroll({action.amount:g}{', ' + place if place else ''})"


def _type(action: Action) -> str:
    if action.text is None:
        raise cannot_say(action, "pyautogui")
    return f"pyautogui.write({action.text!r})"


def _keys(action: Action) -> tuple[str, ...]:
    if not action.keys:
        raise cannot_say(action, "pyautogui")
    return action.keys


def _hotkey(action: Action) -> str:
    keys = _keys(action)
    return f"pyautogui.{'press' if len(keys) == 1 else 'hotkey'}({', '.join(map(repr, keys))})"


def _held(name: str) -> Callable[[Action], str]:
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
    "key_down": _held("keyDown"),
    "key_up": _held("keyUp"),
}
