"""Structured tool calls of cua-lite's data sets: 0..1000 of the picture, or chosen."""

from collections.abc import Iterator
from typing import TypeAlias

from hijack_data.actions import Scaling
from hijack_data.actions.dialects.field_checks import at, click_type, key_names, number, point, text
from hijack_data.errors import ActionError, HijackError
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
    found: list[NamedCall] = []
    for call in fields.listed(calls):
        function = fields.mapping(call, "tool_calls").get("function")
        found += _read_calls(fields.mapping(function, "tool_calls.function"))
    return [(name, given) for name, given in found if name not in LOOKING_CALLS]


def _read_calls(function: JsonObject) -> Iterator[NamedCall]:
    name = fields.text(function, "name", "tool_calls.function.name")
    given = call_arguments(function)
    if name not in BATCHES:
        yield name, given
        return
    for one in fields.mappings(fields.items(given, "actions"), "tool_calls.actions"):
        yield fields.text(one, "action", "tool_calls.actions.action"), one


def parse_call(name: str, given: JsonObject, size: Size, scaling: Scaling) -> Action:
    """Return one action in pixels of a picture.

    Args:
        name: name of the call.
        given: its arguments.
        size: (height, width) of the picture.
        scaling: from the space of the arguments to the picture.

    Raises:
        FieldError: the call is unknown or broken, or points outside the picture.
    """
    field = f"tool_calls.{name}"
    try:
        action = _action(name, given, scaling)
    except HijackError as error:
        raise FieldError(field, str(error)) from None
    return fields.check_on_screen(action, size, field)


def call_arguments(function: JsonObject) -> JsonObject:
    """Return the arguments of a call, an object or JSON text; others are a `FieldError`."""
    given: object = function.get("arguments")
    if given is None:
        return {}
    field = "tool_calls.function.arguments"
    return fields.mapping(parse_embedded(given, field), field)


def _action(name: str, given: JsonObject, scaling: Scaling) -> Action:
    place = _place(given, "coordinate", scaling)
    button = given.get("button") or "left"
    if name in _POINTERS:
        return at(_POINTERS[name], place)
    if name in _KEYS:
        return _key(name, given)
    match name:
        case "click" | "tap":
            return at(click_type(button, _clicks(given)), place)
        case "mouse_down" | "mouse_up":
            return Action(name if button == "left" else "other")
        case "drag" | "swipe" if place is not None:
            start = _place(given, "start_coordinate", scaling)
            return at("drag", start, x2=place[0], y2=place[1])
        case "scroll":
            return _scroll(given, place)
        case "type":
            return Action("type", text=text(given.get("text"), "text"))
        case "wait":
            return Action("wait", amount=number(given.get("duration", 0), "duration"))
        case "terminate":
            return Action("fail" if given.get("status") == "failure" else "done")
        case _:
            raise ActionError(f"{fields.shown(name)} is not an action that is known")


def _place(given: JsonObject, key: str, scaling: Scaling) -> tuple[int, int] | None:
    # Parquet stores null for arguments that an action does not have.
    if given.get(key) is None:
        return None
    x, y = point(given[key], key)
    return scaling.point(x, y)


def _key(name: str, given: JsonObject) -> Action:
    held = None
    if name == "hold_key":
        held = number(given.get("duration"), "duration")
    keys = key_names(given.get("keys"), "keys", "+")
    return Action(_KEYS[name], keys=keys, amount=held)


def _clicks(given: JsonObject) -> int:
    if given.get("clicks") is None:
        return 1
    clicks = number(given["clicks"], "clicks")
    return int(clicks) if 0 < clicks < 10 else 0


def _scroll(given: JsonObject, place: tuple[int, int] | None) -> Action:
    amount = number(given.get("amount"), "amount")
    direction = given.get("direction")
    if direction in ("left", "right"):
        return at("other", place)
    if direction == "down":
        amount = -amount
    elif direction != "up":
        got = fields.shown(direction)
        raise ActionError(f"direction must be up, down, left or right, got {got}")
    return at("scroll", place, amount=amount)
