"""Write typed actions as pyautogui code, including details for which `Action` has no field.

These details are sideways scrolling, a key pressed several times or held for a while, the inner
points of a drag, text that is typed at a place, and the mouse buttons "back" and "forward". Actions
that only look at the screen (`screenshot`, `zoom`, `cursor_position`) become `WAIT`, because the
next picture comes anyway.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from ...errors import ActionError, short_repr
from ...types import Action
from ..scaling import Scaling
from .action_rules import PIXELS_PER_NOTCH
from .computer_13 import parse_computer_13
from .computer_tools import (
    anthropic_action,
    drag_points,
    key_presses,
    openai_actions,
    parse_anthropic_action,
    parse_openai_action,
)
from .field_checks import as_fields, key_names, number
from .pyautogui_write import hscroll_code, write_pyautogui
from .unmapped_fields import check_carried_out

MAX_REPEATS = 100
MAX_HOLD_S = 60.0  # s
_SCREEN_READING_ACTIONS = ("screenshot", "zoom", "cursor_position")
# The keys that do in browsers and file managers what these mouse buttons do.
_SIDE_BUTTONS = {"back": "left", "forward": "right"}
_WAIT = "WAIT"
# The fields that each action carries out; others would be ignored.
_OPENAI_FIELDS = {
    "click": ("x", "y", "button", "keys"),
    "double_click": ("x", "y", "button", "keys"),
    "drag": ("path", "button", "keys"),
    "keypress": ("keys",),
    "move": ("x", "y", "keys"),
    "scroll": ("x", "y", "scroll_x", "scroll_y", "keys"),
    "type": ("text",),
}
_CLICK_FIELDS = ("coordinate", "text", "repeat")
_ANTHROPIC_FIELDS = {
    **dict.fromkeys(
        ("left_click", "right_click", "middle_click", "double_click", "triple_click"), _CLICK_FIELDS
    ),
    **dict.fromkeys(("mouse_move", "hover", "left_mouse_down", "left_mouse_up"), _CLICK_FIELDS),
    "key": ("text", "repeat"),
    "hold_key": ("text", "duration"),
    "left_click_drag": ("coordinate", "start_coordinate", "text"),
    "scroll": ("coordinate", "scroll_direction", "scroll_amount", "text"),
    "type": ("coordinate", "text", "press_enter"),
}


def openai_code(action: object, scaling: Scaling) -> list[str]:
    """Return the actions of OpenAI as code.

    Raises:
        ActionError: an action cannot be read.
    """
    return [_openai_code(item, scaling) for item in openai_actions(action)]


def _openai_code(action: object, scaling: Scaling) -> str:
    parsed = parse_openai_action(action, scaling)
    fields = as_fields(action, "openai")
    name = fields["type"]
    if name in _SCREEN_READING_ACTIONS:
        return _WAIT
    if name in _OPENAI_FIELDS:
        check_carried_out(fields, ("type", *_OPENAI_FIELDS[name]), f"openai {name}")
    arrow = _SIDE_BUTTONS.get(str(fields.get("button")))
    if name == "click" and arrow is not None:
        return _with_keys(parsed.keys, [f"pyautogui.hotkey('alt', {arrow!r})"])
    if name == "drag" and parsed.type == "drag":
        points = [scaling.point(*point) for point in drag_points(fields)]
        if len(points) > 2:
            return _with_keys(parsed.keys, _through(points))
    if name == "scroll":
        return _openai_scroll(fields, parsed)
    return write_pyautogui(parsed)


def anthropic_code(action: object, scaling: Scaling) -> list[str]:
    """Return an Anthropic action as code.

    Raises:
        ActionError: the action cannot be read, or is `scroll_to`.
    """
    action, _ = anthropic_action(action)
    fields = as_fields(action, "anthropic")
    parsed = parse_anthropic_action({**fields, "repeat": None}, scaling)
    name = str(fields["action"])
    if name in _ANTHROPIC_FIELDS:
        check_carried_out(fields, ("action", *_ANTHROPIC_FIELDS[name]), f"anthropic {name}")
    match name:
        case "screenshot" | "zoom" | "cursor_position":
            return [_WAIT]
        case "scroll_to":
            raise ActionError(
                "anthropic scroll_to names an element of a page, which a desktop does not know; use"
                " scroll"
            )
        case "scroll":
            return [_anthropic_scroll(fields, parsed)]
        case "key":
            presses = [Action("hotkey", keys=keys) for keys in key_presses(fields)]
            return [_repeated("\n".join(map(write_pyautogui, presses)), fields)]
        case "hold_key":
            return [_held_for(parsed)]
        case "type":
            return [_typed(fields, scaling)]
        case "left_click_drag":
            return [write_pyautogui(replace(parsed, keys=_held_keys(fields)))]
        case _:
            return [_repeated(write_pyautogui(parsed), fields)]


def computer_13_code(action: object, scaling: Scaling) -> list[str]:
    """Return a `computer_13` action as code.

    Raises:
        ActionError: the action cannot be read.
    """
    parsed = parse_computer_13(action, scaling)
    if isinstance(action, str):
        return [write_pyautogui(parsed)]
    fields = as_fields(action, "computer_13")
    parameters = fields.get("parameters", fields)
    if fields["action_type"] != "SCROLL" or not parameters.get("dx"):
        return [write_pyautogui(parsed)]
    notches = number(parameters["dx"], "SCROLL dx")
    sideways = hscroll_code(notches, parsed.point)
    down = number(parameters.get("dy", 0), "SCROLL dy")
    if not down:
        return [sideways]
    upright = replace(parsed, type="scroll", amount=down)
    return [f"{write_pyautogui(upright)}\n{sideways}"]


def _openai_scroll(fields: dict[str, Any], parsed: Action) -> str:
    across = number(fields.get("scroll_x", 0), "scroll scroll_x")
    down = number(fields.get("scroll_y", 0), "scroll scroll_y")
    lines: list[str] = []
    if down or not across:
        upright = replace(parsed, type="scroll", amount=-down / PIXELS_PER_NOTCH, keys=None)
        lines.append(write_pyautogui(upright))
    if across:
        sideways = across / PIXELS_PER_NOTCH
        lines.append(hscroll_code(sideways, parsed.point))
    return _with_keys(parsed.keys, lines)


def _anthropic_scroll(fields: dict[str, Any], parsed: Action) -> str:
    direction = fields["scroll_direction"]
    amount = number(fields["scroll_amount"], "scroll scroll_amount")
    if direction == "left":
        line = hscroll_code(-amount, parsed.point)
    elif direction == "right":
        line = hscroll_code(amount, parsed.point)
    else:
        line = write_pyautogui(parsed)
    return _with_keys(_held_keys(fields), [line])


def _held_keys(fields: dict[str, Any]) -> tuple[str, ...] | None:
    if not fields.get("text"):
        return None
    return key_names(fields["text"], f"{fields['action']} text", "+")


def _repeated(line: str, fields: dict[str, Any]) -> str:
    """Return the code repeated as often as the field `repeat` asks.

    Raises:
        ActionError: `repeat` is not a whole number of times in the allowed range.
    """
    times = fields.get("repeat")
    if times is None:
        return line
    if type(times) is not int or not 1 <= times <= MAX_REPEATS:
        raise ActionError(
            f"{fields['action']} repeat must be a whole number from 1 to {MAX_REPEATS},"
            f" got {short_repr(times)}"
        )
    return "\n".join([line] * times)


def _held_for(action: Action) -> str:
    """Return code that holds keys down for a while.

    Raises:
        ActionError: the duration is negative, too long or not a number.
    """
    seconds = action.amount or 0
    if not 0 <= seconds <= MAX_HOLD_S:
        raise ActionError(
            f"hold_key duration must be 0 to {MAX_HOLD_S:g} seconds, got {short_repr(seconds)}"
        )
    return _with_keys(action.keys, [f"pyautogui.sleep({seconds:g})"])


def _typed(fields: dict[str, Any], scaling: Scaling) -> str:
    """Return code that types a text, clicking a place first and pressing Enter last if asked to."""
    typed = parse_anthropic_action({**fields, "coordinate": None}, scaling)
    line = write_pyautogui(typed)
    if fields.get("coordinate") is None:
        return line
    click = {"action": "left_click", "coordinate": fields["coordinate"]}
    first = write_pyautogui(parse_anthropic_action(click, scaling))
    return f"{first}\n{line}"


def _through(points: Sequence[tuple[int, int]]) -> list[str]:
    """Return code that drags through all points."""
    first, *moves = [f"pyautogui.moveTo({x}, {y})" for x, y in points]
    return [first, "pyautogui.mouseDown()", *moves, "pyautogui.mouseUp()"]


def _with_keys(keys: Sequence[str] | None, lines: Sequence[str]) -> str:
    held_keys = keys or ()
    down = [f"pyautogui.keyDown({key!r})" for key in held_keys]
    up = [f"pyautogui.keyUp({key!r})" for key in reversed(held_keys)]
    return "\n".join([*down, *lines, *up])
