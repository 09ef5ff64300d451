"""The computer tools of OpenAI and Anthropic: dicts as the two APIs return them."""

from collections.abc import Sequence
from typing import Any, cast

from ...errors import ActionError, ParameterError, shown
from ...types import Action, as_boxes
from ..scaling import Scaling
from .fields import as_fields, at, click_type, combination, number, point, text, unknown
from .unmapped import check_fields

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
)

# OpenAI scrolls in pixels, and down is positive; a notch of the wheel scrolls most programs by
# about this many.
PIXELS_PER_NOTCH = 100
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
_ANTHROPIC_POINT = ("mouse_move", "left_click_drag")
_ANTHROPIC_CLICKS = {
    "left_click": "click",
    "right_click": "right_click",
    "middle_click": "middle_click",
    "double_click": "double_click",
    "triple_click": "triple_click",
    "mouse_move": "move",
    "left_mouse_down": "mouse_down",
    "left_mouse_up": "mouse_up",
}


def map_openai(action: object, scaling: Scaling) -> dict[str, Any]:
    """Return an OpenAI computer action with `x, y` or `path` scaled; `scroll_x, scroll_y` stay.

    Raises `ActionError` for an unknown `type`, for coordinates that are missing or not numbers, and
    for unknown fields that may hold coordinates.
    """
    fields, name = _openai(action)
    if name == "drag":
        path = [scaling.point(*p) for p in drag_points(fields)]
        given = cast("list[Any]", fields["path"])
        fields["path"] = [
            {**cast("dict[str, Any]", old), "x": x, "y": y} if isinstance(old, dict) else [x, y]
            for old, (x, y) in zip(given, path, strict=True)
        ]
    elif name in _OPENAI_POINT:
        fields["x"], fields["y"] = scaling.point(*_xy(fields, name))
    return fields


def parse_openai(action: object, scaling: Scaling) -> Action:
    """Read an OpenAI action; a drag runs from the first to the last point of its path.

    Raises `ActionError` as `map_openai`.
    """
    fields, name = _openai(action)
    held = combination(fields["keys"], f"{name} keys") if fields.get("keys") else None
    match name:
        case "drag":
            path = [scaling.point(*p) for p in drag_points(fields)]
            return Action("drag", *path[0], *path[-1], keys=held)
        case "keypress":
            return Action("hotkey", keys=combination(fields.get("keys"), "keypress keys"))
        case "type":
            return Action("type", text=text(fields.get("text"), "type text"))
        case "screenshot":
            return Action("other")
        case "wait":
            return Action("wait")
        case _:
            place = scaling.point(*_xy(fields, name))
    if name == "scroll":
        across, down = (number(fields.get(f, 0), f"scroll {f}") for f in ("scroll_x", "scroll_y"))
        return (
            at("scroll", place, amount=-down / PIXELS_PER_NOTCH, keys=held)
            if down or not across
            else at("other", place)
        )
    types = {"click": click_type(fields.get("button", "left"), 1), "move": "move"}
    return at(types.get(name, name), place, keys=held)


def map_anthropic(action: object, scaling: Scaling) -> dict[str, Any]:
    """Return an Anthropic computer action with its coordinates and `region` scaled.

    Raises `ActionError` for an unknown `action`, for coordinates that are missing or not numbers,
    and for unknown fields that may hold coordinates.
    """
    fields, name = _anthropic(action)
    for field in ("coordinate", "start_coordinate"):
        place = _coordinate(fields, name, field, scaling)
        if place is not None:
            fields[field] = list(place)
    if name == "zoom":
        fields["region"] = _region(fields.get("region"), scaling)
    return fields


def parse_anthropic(action: object, scaling: Scaling) -> Action:
    """Read an Anthropic computer action. Raises `ActionError` as `map_anthropic`.

    The `text` of a click names the keys held; `hold_key` becomes a hotkey whose `amount` is in
    seconds; sideways scrolling, `screenshot`, `zoom` and `cursor_position` become `"other"`. A
    click without a `coordinate` is at the pointer.
    """
    fields, name = _anthropic(action)
    place = _coordinate(fields, name, "coordinate", scaling)
    if name in _ANTHROPIC_CLICKS:
        held = combination(fields["text"], f"{name} text", "+") if fields.get("text") else None
        return at(_ANTHROPIC_CLICKS[name], place, keys=held)
    match name:
        case "left_click_drag" if place is not None:
            return at(
                "drag",
                _coordinate(fields, name, "start_coordinate", scaling),
                x2=place[0],
                y2=place[1],
            )
        case "scroll":
            return _anthropic_scroll(fields, place)
        case "type":
            return Action("type", text=text(fields.get("text"), "type text"))
        case "key" | "hold_key":
            seconds = (
                number(fields.get("duration", 0), "hold_key duration")
                if name == "hold_key"
                else None
            )
            return Action(
                "hotkey", keys=combination(fields.get("text"), f"{name} text", "+"), amount=seconds
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


def _anthropic_scroll(fields: dict[str, Any], place: tuple[int, int] | None) -> Action:
    amount = number(fields.get("scroll_amount"), "scroll scroll_amount")
    direction = fields.get("scroll_direction")
    if direction not in ("up", "down", "left", "right"):
        raise ActionError(
            f"scroll scroll_direction must be up, down, left or right, got {shown(direction)}"
        )
    if direction in ("left", "right"):
        return at("other", place)
    return at("scroll", place, amount=amount if direction == "up" else -amount)


def _openai(action: object) -> tuple[dict[str, Any], str]:
    fields = as_fields(action, OPENAI)
    name = _name(fields, "type", OPENAI, OPENAI_NAMES)
    known = (*_OPENAI_FIELDS, *(("x", "y") if name in _OPENAI_POINT else ()))
    check_fields(fields, (*known, "path") if name == "drag" else known, f"{OPENAI} {name}")
    return fields, name


def _anthropic(action: object) -> tuple[dict[str, Any], str]:
    fields = as_fields(action, ANTHROPIC)
    name = _name(fields, "action", ANTHROPIC, ANTHROPIC_NAMES)
    known = (*_ANTHROPIC_FIELDS, "region") if name == "zoom" else _ANTHROPIC_FIELDS
    check_fields(fields, known, f"{ANTHROPIC} {name}")
    return fields, name


def _name(fields: dict[str, Any], field: str, dialect: str, known: Sequence[str]) -> str:
    name = fields.get(field)
    if name not in known:
        unknown(dialect, name, known)
    return str(name)


def _xy(fields: dict[str, Any], what: str) -> tuple[float, float]:
    return number(fields.get("x"), f"{what} x"), number(fields.get("y"), f"{what} y")


def drag_points(fields: dict[str, Any]) -> list[tuple[float, float]]:
    """Return the points of an OpenAI drag.

    Raises:
        ActionError: its `path` is not a list of points.
    """
    path = fields.get("path")
    if not isinstance(path, list | tuple) or not path:
        raise ActionError(f"drag path must be a list of points, got {shown(cast('object', path))}")
    points: list[tuple[float, float]] = []
    for index, item in enumerate(cast("list[Any]", path)):
        what = f"drag path[{index}]"
        if isinstance(item, dict):
            corner = cast("dict[str, Any]", item)
            check_fields(corner, ("x", "y"), what)
            points.append(_xy(corner, what))
        else:
            points.append(point(item, what))
    return points


def _coordinate(
    fields: dict[str, Any], name: str, field: str, scaling: Scaling
) -> tuple[int, int] | None:
    value = fields.get(field)
    if value is None and not (field == "coordinate" and name in _ANTHROPIC_POINT):
        return None
    return scaling.point(*point(value, f"{name} {field}"))


def _region(value: object, scaling: Scaling) -> list[int]:
    if not isinstance(value, list | tuple) or len(cast("list[Any]", value)) != 4:
        raise ActionError(
            f"zoom region must be [x1, y1, x2, y2], got {shown(cast('object', value))}"
        )
    corners = [number(v, f"zoom region[{i}]") for i, v in enumerate(cast("list[Any]", value))]
    try:
        boxes = as_boxes([corners], "zoom region")
    except ParameterError as error:
        raise ActionError(str(error)) from None
    return scaling.boxes(boxes)[0].tolist()
