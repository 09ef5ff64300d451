"""How to draw an action on the picture: clicks, drags, scrolls, and typed text."""

import ast
import contextlib
from dataclasses import replace
from typing import Any

from hijack_data.actions import parse_pyautogui, read_action
from hijack_data.errors import HijackError
from hijack_data.types import Action, Size

from ..source import action_text
from .listing import number

MOST = 40  # the most strokes of one action, since an agent can write any number
LONGEST = 20_000  # the most characters of code that is parsed


def parse_strokes(code: str, size: Size | None) -> tuple[str, list[dict[str, Any]]]:
    """Return an action in words, and what to draw, in order.

    A stroke has `type`, `at` and `to` (points in pixels of the picture), `text` and `amount`, as
    far as it has them. Typed text has no place.

    Args:
        code: as the agent wrote it, in pixels of its picture.
        size: (height, width) of that picture, to which points are clamped; `None` if the size is
            unknown.
    """
    if len(code) > LONGEST:
        return "code that is too long to be drawn", []
    with contextlib.suppress(HijackError, RecursionError):  # refused code may still be drawn
        request = read_action(code, allow_code=True)
        if request.kind == "reinit":
            return "asks for the desktop to be put in order", []
        code = request.code if request.kind == "code" else code
    try:
        whole = parse_pyautogui(code, size)
    except (HijackError, RecursionError):
        return "not a pyautogui action", []
    if whole.type != "other":
        return action_text(vars(whole)), _strokes([whole])
    parts = _parts(code, size)
    if not parts:
        return action_text(vars(whole)), _strokes([whole])
    return ", then ".join(action_text(vars(part)) for part in parts), _strokes(parts)


def _parts(code: str, size: Size | None) -> list[Action]:
    """Return the actions of a program of several statements that are actions by themselves."""
    try:
        statements = ast.parse(code).body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return []
    found: list[Action] = []
    pointer: Action | None = None
    for statement in statements[: 2 * MOST]:
        try:
            action = parse_pyautogui(ast.unparse(statement), size)
        except (HijackError, RecursionError):
            continue
        if action.type == "other":
            continue
        if action.type == "drag" and action.point is None and pointer is not None:
            action = replace(action, x=pointer.x, y=pointer.y)
        if action.point is not None:
            pointer = action
        found.append(action)
        if len(found) == MOST:
            break
    return found


def _strokes(actions: list[Action]) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    for action in actions:
        stroke: dict[str, Any] = {"type": action.type}
        if action.point is not None:
            stroke["at"] = action.point
        if action.end is not None:
            stroke["to"] = action.end
        if action.text is not None:
            stroke["text"] = action.text[:200]
        elif action.keys:
            stroke["text"] = "+".join(action.keys)
        amount = number(action.amount)
        if amount is not None:
            stroke["amount"] = amount
        if len(stroke) > 1:
            found.append(stroke)
    return found
