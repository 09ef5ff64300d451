"""Structured tool calls of cua-lite's data sets: 0..1000 of the picture, or chosen."""

from collections.abc import Iterator
from typing import TypeAlias

from hijack_data.actions import Scaling
from hijack_data.actions.dialects.field_checks import (
    action_at,
    click_type,
    key_names,
    number,
    point,
    text,
)
from hijack_data.errors import ActionError, HijackError, short_repr
from hijack_data.types import Action, Size

from . import fields
from .fields import FieldError, JsonObject
from .safe_files import parse_embedded

# A call of one of these holds a list of actions; any other call is one action itself.
BATCHES = ("computer", "mobile")
LOOKING_CALLS = ("screenshot", "cursor_position")
NamedCall: TypeAlias = tuple[str, JsonObject]
_KEYS = {"key": "hotkey", "hold_key": "hotkey", "key_down": "key_down", "key_up": "key_up"}
_POINTERS = {"mouse_move": "move", "long_press": "other", "point": "other"}


def acting_calls(calls: object) -> list[NamedCall]:
    """Return the actions in `tool_calls` (names and arguments) that do more than look.

    A call that is broken is a `FieldError`.
    """
    named_calls: list[NamedCall] = []
    for call in fields.listed(calls):
        function = fields.mapping(call, "tool_calls").get("function")
        named_calls += _read_calls(fields.mapping(function, "tool_calls.function"))
    return [(name, arguments) for name, arguments in named_calls if name not in LOOKING_CALLS]


def _read_calls(function: JsonObject) -> Iterator[NamedCall]:
    name = fields.text(function, "name", "tool_calls.function.name")
    arguments = call_arguments(function)
    if name not in BATCHES:
        yield name, arguments
        return
    for action in fields.mappings(fields.items(arguments, "actions"), "tool_calls.actions"):
        yield fields.text(action, "action", "tool_calls.actions.action"), action


def parse_call(name: str, arguments: JsonObject, size: Size, scaling: Scaling) -> Action:
    """Return one action in pixels of a picture.

    Args:
        name: name of the call.
        arguments: those of the call.
        size: (height, width) of the picture.
        scaling: from the space of the arguments to the picture.

    Raises:
        FieldError: the call is unknown or broken, or points outside the picture.
    """
    field = f"tool_calls.{name}"
    try:
        action = _action(name, arguments, scaling)
    except HijackError as error:
        raise FieldError(field, str(error)) from None
    return fields.check_on_screen(action, size, field)


def call_arguments(function: JsonObject) -> JsonObject:
    """Return the arguments of a call, an object or JSON text; others are a `FieldError`."""
    arguments: object = function.get("arguments")
    if arguments is None:
        return {}
    field = "tool_calls.function.arguments"
    return fields.mapping(parse_embedded(arguments, field), field)


def _action(name: str, arguments: JsonObject, scaling: Scaling) -> Action:
    point = _point(arguments, "coordinate", scaling)
    button = arguments.get("button") or "left"
    if name in _POINTERS:
        return action_at(_POINTERS[name], point)
    if name in _KEYS:
        return _key(name, arguments)
    match name:
        case "click" | "tap":
            return action_at(click_type(button, _clicks(arguments)), point)
        case "mouse_down" | "mouse_up":
            return Action(name if button == "left" else "other")
        case "drag" | "swipe" if point is not None:
            start = _point(arguments, "start_coordinate", scaling)
            return action_at("drag", start, x2=point[0], y2=point[1])
        case "scroll":
            return _scroll(arguments, point)
        case "type":
            return Action("type", text=text(arguments.get("text"), "text"))
        case "wait":
            return Action("wait", amount=number(arguments.get("duration", 0), "duration"))
        case "terminate":
            return Action("fail" if arguments.get("status") == "failure" else "done")
        case _:
            raise ActionError(f"{short_repr(name)} is not an action that is known")


def _point(arguments: JsonObject, key: str, scaling: Scaling) -> tuple[int, int] | None:
    # Parquet stores null for arguments that an action does not have.
    if arguments.get(key) is None:
        return None
    x, y = point(arguments[key], key)
    return scaling.point(x, y)


def _key(name: str, arguments: JsonObject) -> Action:
    seconds = None
    if name == "hold_key":
        seconds = number(arguments.get("duration"), "duration")
    keys = key_names(arguments.get("keys"), "keys", "+")
    return Action(_KEYS[name], keys=keys, amount=seconds)


def _clicks(arguments: JsonObject) -> int:
    if arguments.get("clicks") is None:
        return 1
    clicks = number(arguments["clicks"], "clicks")
    return int(clicks) if 0 < clicks < 10 else 0


def _scroll(arguments: JsonObject, point: tuple[int, int] | None) -> Action:
    amount = number(arguments.get("amount"), "amount")
    direction = arguments.get("direction")
    if direction in ("left", "right"):
        return action_at("other", point)
    if direction == "down":
        amount = -amount
    elif direction != "up":
        excerpt = short_repr(direction)
        raise ActionError(f"direction must be up, down, left or right, got {excerpt}")
    return action_at("scroll", point, amount=amount)
