"""Combine several calls into the one action that they form.

Examples are a move and a drag, a move and a click, text and Enter, or keys held together.
"""

from collections.abc import Sequence
from dataclasses import replace

from ...types import ACTION_TYPES, Action, Size
from ..scaling import Scaling

# Types of calls that get their meaning from the calls around them.
MOVE_BY = "move by"
DRAG_BY = "drag by"
DRAGGING = "dragging"
CLIPBOARD = "clipboard"

_CLICKS = ("click", "double_click", "triple_click", "right_click", "middle_click")
_POINTED = (*_CLICKS, "move", "drag", "mouse_down", "mouse_up", "scroll")
_WITH_KEYS = (*_CLICKS, "move", "drag", "scroll", "hotkey")
_PASTE = (("ctrl", "v"), ("command", "v"))
_ENTER = (("enter",), ("return",))


def combine(calls: Sequence[Action], size: Size | None) -> Action:
    """Return the one action that `calls` form.

    Args:
        calls: the calls, in order.
        size: `(height, width)` of the picture, which bounds the end of a relative move.

    Returns:
        The action. If the calls are several actions, its type is `"other"` and its point the first
        one known.
    """
    acting = [call for call in calls if call.type != "wait"]
    if not acting:
        return _waited(calls)
    if _is_held(acting):
        return _with_held_keys(acting[0], acting[1:-1], size)
    pixels = Scaling.pixels(size)
    action = acting[0]
    for call in acting[1:]:
        action = _merge(action, call, pixels)
    if action.type in ACTION_TYPES:
        return action
    point = action.point if action.type == DRAGGING else None
    return _other_action(point, text=action.text)


def _other_action(point: tuple[int, int] | None, text: str | None = None) -> Action:
    if point is None:
        return Action("other", text=text)
    return Action("other", point[0], point[1], text=text)


def _waited(waits: Sequence[Action]) -> Action:
    if not waits:
        return Action("other")
    seconds = [wait.amount for wait in waits if wait.amount is not None]
    return Action("wait", amount=sum(seconds) if seconds else None)


def _is_held(calls: Sequence[Action]) -> bool:
    first = calls[0]
    last = calls[-1]
    if len(calls) < 2 or first.keys != last.keys:
        return False
    return first.type == "key_down" and last.type == "key_up"


def _with_held_keys(key: Action, inner: Sequence[Action], size: Size | None) -> Action:
    if not inner:
        return replace(key, type="hotkey")
    action = combine(inner, size)
    if action.type not in _WITH_KEYS:
        return replace(action, type="other")
    return replace(action, keys=(key.keys or ()) + (action.keys or ()))


def _merge(a: Action, b: Action, pixels: Scaling) -> Action:
    """Return the action of two calls; `"other"` if they are two actions."""
    merged = None
    if a.type == "move":
        merged = _after_move(a, b, pixels)
    elif a.type in ("mouse_down", DRAGGING):
        merged = _after_press(a, b)
    elif a.type == "scroll" and b.type == "scroll" and b.point in (None, a.point):
        merged = replace(a, amount=(a.amount or 0) + (b.amount or 0))
    elif a.type == "type":
        merged = _after_text(a, b)
    elif a.type == CLIPBOARD and b.type == "hotkey" and b.keys in _PASTE:
        merged = replace(a, type="type")
    if merged is not None:
        return merged
    return _other_action(a.point or b.point)


def _after_move(move: Action, b: Action, pixels: Scaling) -> Action | None:
    if b.type in _POINTED:
        x = move.x if b.x is None else b.x
        y = move.y if b.y is None else b.y
        return replace(b, x=x, y=y)
    if b.type not in (MOVE_BY, DRAG_BY) or move.x is None or move.y is None:
        return None
    x = pixels.x(move.x + (b.x or 0))
    y = pixels.y(move.y + (b.y or 0))
    if b.type == MOVE_BY:
        return Action("move", x, y)
    return Action("drag", move.x, move.y, x, y)


def _after_press(press: Action, b: Action) -> Action | None:
    if b.type == "move":
        return Action(DRAGGING, press.x, press.y, b.x, b.y)
    if b.type != "mouse_up":
        return None
    if press.type == DRAGGING:
        x2 = press.x2 if b.x is None else b.x
        y2 = press.y2 if b.y is None else b.y
        return Action("drag", press.x, press.y, x2, y2)
    if b.point in (None, press.point):
        return replace(press, type="click")
    return Action("drag", press.x, press.y, b.x, b.y)


def _after_text(typed: Action, b: Action) -> Action | None:
    if b.type == "type":
        return replace(typed, text=f"{typed.text}{b.text}")
    if b.type == "hotkey" and b.keys in _ENTER:
        return replace(typed, text=f"{typed.text}\n")
    return None
