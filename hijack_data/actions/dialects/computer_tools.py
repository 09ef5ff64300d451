"""The computer tools of OpenAI and Anthropic: dicts as the two APIs return them.

An action stands alone, or in the item of its API: OpenAI's `computer_call` with an `action` or
several `actions`, Anthropic's `tool_use` block with the `input`.
"""

from collections.abc import Callable, Sequence
from typing import Any, cast

from ...errors import ActionError, ParameterError, short_repr
from ...types import Action, as_boxes
from ..scaling import Scaling
from .action_rules import PIXELS_PER_NOTCH, coordinates, with_coordinates
from .field_checks import (
    action_at,
    as_fields,
    click_type,
    key_combination,
    key_sequence,
    number,
    point,
    refuse_unknown_action,
    text,
)
from .unmapped_fields import check_fields

OPENAI = "openai"
ANTHROPIC = "anthropic"
OPENAI_NAMES = (
    "click",
    "double_click",
    "drag",
    "keypress",
    "move",
    "screenshot",
    "scroll",
    "type",
    "wait",
)
ANTHROPIC_NAMES = (
    "key",
    "hold_key",
    "type",
    "cursor_position",
    "mouse_move",
    "left_mouse_down",
    "left_mouse_up",
    "left_click",
    "left_click_drag",
    "right_click",
    "middle_click",
    "double_click",
    "triple_click",
    "scroll",
    "wait",
    "screenshot",
    "zoom",
    # Of Anthropic's browser tools.
    "hover",
    "scroll_to",
)

# OpenAI scrolls in pixels, and down is positive.
CALL = "computer_call"
_MODIFIERS = ("ctrl", "ctrlright", "shift", "shiftright", "alt", "altright", "win", "winright")
_CALL_FIELDS = ("type", "action", "actions", "id", "call_id", "status", "pending_safety_checks")
TOOL_USE = "tool_use"
_BLOCK_FIELDS = ("type", "id", "name", "input", "toolset_name", "caller", "cache_control")
_COMPUTER = "computer"
_OPENAI_POINT = ("click", "double_click", "move", "scroll")
_OPENAI_FIELDS = ("type", "button", "keys", "text", "scroll_x", "scroll_y")
_ANTHROPIC_FIELDS = (
    "action",
    "coordinate",
    "start_coordinate",
    "text",
    "duration",
    "scroll_direction",
    "scroll_amount",
)
_ANTHROPIC_POINT = ("mouse_move", "left_click_drag", "hover")
_ANTHROPIC_CLICKS = {
    "left_click": "click",
    "right_click": "right_click",
    "middle_click": "middle_click",
    "double_click": "double_click",
    "triple_click": "triple_click",
    "mouse_move": "move",
    "hover": "move",
    "left_mouse_down": "mouse_down",
    "left_mouse_up": "mouse_up",
}


def openai_actions(action: object) -> list[object]:
    """Return the actions of a `computer_call`, or the action itself.

    Raises:
        ActionError: the call has none, or has fields that may hold coordinates.
    """
    if not isinstance(action, dict) or cast("dict[str, Any]", action).get("type") != CALL:
        return [action]
    fields = as_fields(cast("object", action), OPENAI)
    check_fields(fields, _CALL_FIELDS, f"{OPENAI} {CALL}")
    several: object = fields.get("actions")
    if several is None:
        several = [fields.get("action")]
    if not isinstance(several, list | tuple) or not several:
        raise ActionError(
            f"{CALL} needs an action or a list of actions, got"
            f" {short_repr(cast('object', several))}"
        )
    return list(cast("list[object]", several))


def map_openai(action: object, scaling: Scaling) -> Any:
    """Return an OpenAI computer action, or the `computer_call` with one or several, scaled.

    `x, y` and `path` are scaled; `scroll_x, scroll_y` stay.

    Raises:
        ActionError: the name of the action is unknown, a coordinate is missing or not a number, or
            an unknown field may hold coordinates.
    """
    actions = openai_actions(action)
    if len(actions) == 1 and actions[0] is action:
        return _map_openai(action, scaling)
    fields = as_fields(action, OPENAI)
    mapped = [_map_openai(item, scaling) for item in actions]
    if fields.get("actions") is not None:
        fields["actions"] = mapped
    else:
        fields["action"] = mapped[0]
    return fields


def parse_openai(action: object, scaling: Scaling) -> list[Action]:
    """Read an OpenAI action, or those of a `computer_call`.

    A drag runs from the first to the last point of its path.

    Raises:
        ActionError: the name of the action is unknown, a coordinate is missing or not a number, or
            an unknown field may hold coordinates.
    """
    return [parse_openai_action(item, scaling) for item in openai_actions(action)]


def _map_openai(action: object, scaling: Scaling) -> dict[str, Any]:
    """Return one OpenAI computer action with `x, y` or `path` scaled.

    Raises:
        ActionError: the name of the action is unknown, a coordinate is missing or not a number, or
            an unknown field may hold coordinates.
    """
    fields, name = _openai(action)
    if name == "drag":
        path = [scaling.point(*p) for p in drag_points(fields)]
        points = cast("list[Any]", fields["path"])
        fields["path"] = [
            {**cast("dict[str, Any]", old), "x": x, "y": y} if isinstance(old, dict) else [x, y]
            for old, (x, y) in zip(points, path, strict=True)
        ]
    elif name in _OPENAI_POINT:
        fields["x"], fields["y"] = scaling.point(*_xy(fields, name))
    return fields


def parse_openai_action(action: object, scaling: Scaling) -> Action:
    """Read one OpenAI action.

    Raises:
        ActionError: the name of the action is unknown, a coordinate is missing or not a number, or
            an unknown field may hold coordinates.
    """
    fields, name = _openai(action)
    keys = key_combination(fields["keys"], f"{name} keys", "+") if fields.get("keys") else None
    match name:
        case "drag":
            path = [scaling.point(*p) for p in drag_points(fields)]
            if click_type(fields.get("button", "left"), 1) != "click":
                return Action("other", *path[0], keys=keys)
            return Action("drag", *path[0], *path[-1], keys=keys)
        case "keypress":
            return Action("hotkey", keys=key_combination(fields.get("keys"), "keypress keys", "+"))
        case "type":
            return Action("type", text=text(fields.get("text"), "type text"))
        case "screenshot":
            return Action("other")
        case "wait":
            return Action("wait")
        case _:
            point = scaling.point(*_xy(fields, name))
    if name == "scroll":
        across, down = (number(fields.get(f, 0), f"scroll {f}") for f in ("scroll_x", "scroll_y"))
        if across:  # an `Action` scrolls up or down only
            return action_at("other", point, keys=keys)
        return action_at("scroll", point, amount=-down / PIXELS_PER_NOTCH, keys=keys)
    button = fields.get("button", "left")
    clicks = {"click": 1, "double_click": 2}
    kind = click_type(button, clicks[name]) if name in clicks else name
    return action_at(kind, point, keys=keys)


def anthropic_action(action: object) -> tuple[object, Callable[[dict[str, Any]], dict[str, Any]]]:
    """Return the action of a `tool_use` block, and a function that returns the block with another.

    A call of the toolset has the name of its action; an action that stands alone is returned as it
    is.

    Raises:
        ActionError: the block has no input, or has fields that may hold coordinates.
    """
    if not isinstance(action, dict) or cast("dict[str, Any]", action).get("type") != TOOL_USE:
        return cast("object", action), lambda new_fields: new_fields
    block = as_fields(cast("object", action), ANTHROPIC)
    check_fields(block, _BLOCK_FIELDS, f"{ANTHROPIC} {TOOL_USE}")
    fields = as_fields(block.get("input"), f"{ANTHROPIC} {TOOL_USE}")
    if block.get("name") == _COMPUTER:
        return fields, lambda new_fields: {**block, "input": new_fields}

    def rebuild(new_fields: dict[str, Any]) -> dict[str, Any]:
        return {
            **block,
            "input": {key: part for key, part in new_fields.items() if key != "action"},
        }

    return {"action": block.get("name"), **fields}, rebuild


def map_anthropic(action: object, scaling: Scaling) -> dict[str, Any]:
    """Return an Anthropic computer action, or its `tool_use` block, scaled.

    Its coordinates and `region` are scaled.

    Raises:
        ActionError: the name of the action is unknown, a coordinate is missing or not a number, or
            an unknown field may hold coordinates.
    """
    inner, rebuild = anthropic_action(action)
    fields, name = _anthropic(inner)
    for field in ("coordinate", "start_coordinate"):
        point = _coordinate(fields, name, field, scaling)
        if point is not None:
            old = fields[field]
            fields[field] = with_coordinates(old, point) if isinstance(old, str) else list(point)
    if name == "zoom":
        fields["region"] = _region(fields.get("region"), scaling)
    return rebuild(fields)


def parse_anthropic(action: object, scaling: Scaling) -> list[Action]:
    """Read an Anthropic computer action, or its block.

    Raises:
        ActionError: the name of the action is unknown, a coordinate is missing or not a number, or
            an unknown field may hold coordinates.
    """
    return [parse_anthropic_action(anthropic_action(action)[0], scaling)]


def parse_anthropic_action(action: object, scaling: Scaling) -> Action:
    """Read one Anthropic computer action.

    The `text` of a click names the keys held; `hold_key` becomes a hotkey whose `amount` is in
    seconds; sideways scrolling, `screenshot`, `zoom` and `cursor_position` become `"other"`, and so
    do several presses or clicks in one action. A click without a `coordinate` is at the pointer.

    Raises:
        ActionError: the name of the action is unknown, a coordinate is missing or not a number, or
            an unknown field may hold coordinates.
    """
    fields, name = _anthropic(action)
    point = _coordinate(fields, name, "coordinate", scaling)
    if fields.get("repeat") not in (None, 1) and name in (*_ANTHROPIC_CLICKS, "key"):
        return action_at("other", point)
    if name in _ANTHROPIC_CLICKS:
        keys = key_combination(fields["text"], f"{name} text", "+") if fields.get("text") else None
        return action_at(_ANTHROPIC_CLICKS[name], point, keys=keys)
    match name:
        case "left_click_drag" if point is not None:
            return action_at(
                "drag",
                _coordinate(fields, name, "start_coordinate", scaling),
                x2=point[0],
                y2=point[1],
            )
        case "scroll":
            return _anthropic_scroll(fields, point)
        case "type":
            typed = text(fields.get("text"), "type text")
            presses_enter = fields.get("press_enter") or False
            if presses_enter not in (True, False):
                raise ActionError(
                    f"type press_enter must be true or false, got {short_repr(presses_enter)}"
                )
            if point is not None:  # it is clicked first
                return action_at("other", point, text=typed)
            return Action("type", text=f"{typed}\n" if presses_enter else typed)
        case "key" if len(key_presses(fields)) > 1:
            return Action("other")
        case "key" | "hold_key":
            seconds = (
                number(fields.get("duration", 0), "hold_key duration")
                if name == "hold_key"
                else None
            )
            return Action(
                "hotkey",
                keys=key_combination(fields.get("text"), f"{name} text", "+"),
                amount=seconds,
            )
        case "wait":
            return Action(
                "wait",
                amount=(
                    number(fields["duration"], "wait duration") if "duration" in fields else None
                ),
            )
        case _:
            return Action("other")


def key_presses(fields: dict[str, Any]) -> list[tuple[str, ...]]:
    """Return the keys that a `key` action presses, one combination after the other.

    As for xdotool, spaces separate presses, `Down Down Down`; but `ctrl c` is one combination.

    Raises:
        ActionError: the action names no keys, or one twice in a combination.
    """
    label = "key text"
    keys = key_sequence(fields.get("text"), label, "+")
    words = str(fields["text"]).split()
    is_combination = "+" in words or (keys[0] in _MODIFIERS and "+" not in words[0])
    if len(words) < 2 or is_combination:
        return [key_combination(fields["text"], label, "+")]
    return [key_combination(word, label, "+") for word in words]


def _anthropic_scroll(fields: dict[str, Any], point: tuple[int, int] | None) -> Action:
    amount = number(fields.get("scroll_amount"), "scroll scroll_amount")
    direction = fields.get("scroll_direction")
    if direction not in ("up", "down", "left", "right"):
        raise ActionError(
            f"scroll scroll_direction must be up, down, left or right, got {short_repr(direction)}"
        )
    if direction in ("left", "right"):
        return action_at("other", point)
    return action_at("scroll", point, amount=amount if direction == "up" else -amount)


def _openai(action: object) -> tuple[dict[str, Any], str]:
    fields = as_fields(action, OPENAI)
    name = _name(fields, "type", OPENAI, OPENAI_NAMES)
    field_names = (*_OPENAI_FIELDS, *(("x", "y") if name in _OPENAI_POINT else ()))
    check_fields(
        fields, (*field_names, "path") if name == "drag" else field_names, f"{OPENAI} {name}"
    )
    return fields, name


def _anthropic(action: object) -> tuple[dict[str, Any], str]:
    fields = as_fields(action, ANTHROPIC)
    name = _name(fields, "action", ANTHROPIC, ANTHROPIC_NAMES)
    field_names = (*_ANTHROPIC_FIELDS, "region") if name == "zoom" else _ANTHROPIC_FIELDS
    check_fields(fields, field_names, f"{ANTHROPIC} {name}")
    return fields, name


def _name(fields: dict[str, Any], field: str, dialect: str, valid_names: Sequence[str]) -> str:
    name = fields.get(field)
    if name not in valid_names:
        refuse_unknown_action(dialect, name, valid_names)
    return str(name)


def _xy(fields: dict[str, Any], label: str) -> tuple[float, float]:
    return number(fields.get("x"), f"{label} x"), number(fields.get("y"), f"{label} y")


def drag_points(fields: dict[str, Any]) -> list[tuple[float, float]]:
    """Return the points of an OpenAI drag.

    Raises:
        ActionError: its `path` is not a list of points.
    """
    path = fields.get("path")
    if not isinstance(path, list | tuple) or not path:
        raise ActionError(
            f"drag path must be a list of points, got {short_repr(cast('object', path))}"
        )
    points: list[tuple[float, float]] = []
    for index, item in enumerate(cast("list[Any]", path)):
        label = f"drag path[{index}]"
        if isinstance(item, dict):
            corner = cast("dict[str, Any]", item)
            check_fields(corner, ("x", "y"), label)
            points.append(_xy(corner, label))
        else:
            points.append(point(item, label))
    return points


def _coordinate(
    fields: dict[str, Any], name: str, field: str, scaling: Scaling
) -> tuple[int, int] | None:
    value = fields.get(field)
    if value is None and not (field == "coordinate" and name in _ANTHROPIC_POINT):
        return None
    label = f"{name} {field}"
    if not isinstance(value, str):
        return scaling.point(*point(value, label))
    numbers = coordinates(value, label)
    if len(numbers) != 2:
        raise ActionError(f"{label} must be [x, y], got {short_repr(value)}")
    return scaling.point(*numbers)


def _region(value: object, scaling: Scaling) -> list[int]:
    if not isinstance(value, list | tuple) or len(cast("list[Any]", value)) != 4:
        raise ActionError(
            f"zoom region must be [x1, y1, x2, y2], got {short_repr(cast('object', value))}"
        )
    corners = [number(v, f"zoom region[{i}]") for i, v in enumerate(cast("list[Any]", value))]
    try:
        boxes = as_boxes([corners], "zoom region")
    except ParameterError as error:
        raise ActionError(str(error)) from None
    return scaling.boxes(boxes)[0].tolist()
