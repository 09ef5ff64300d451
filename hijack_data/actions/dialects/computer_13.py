"""OSWorld's `computer_13` action space: dicts with `action_type` and `parameters`.

The parameters may also be top-level fields, next to the type.
"""

from typing import Any

from ...errors import ActionError, short_repr
from ...types import Action
from ..pyautogui_functions import SPECIAL_WORDS
from ..scaling import Scaling
from .field_checks import (
    action_at,
    as_fields,
    click_type,
    key_names,
    number,
    refuse_unknown_action,
    text,
)
from .unmapped_fields import check_fields

DIALECT = "computer_13"
NAMES = (
    "MOVE_TO",
    "CLICK",
    "MOUSE_DOWN",
    "MOUSE_UP",
    "RIGHT_CLICK",
    "DOUBLE_CLICK",
    "DRAG_TO",
    "SCROLL",
    "TYPING",
    "PRESS",
    "KEY_DOWN",
    "KEY_UP",
    "HOTKEY",
    *SPECIAL_WORDS,
)
_NEED_POINT = ("MOVE_TO", "DRAG_TO")
# A point is allowed in every action, and is mapped.
_FIELDS = ("x", "y", "button", "num_clicks", "dx", "dy", "text", "key", "keys")
_KEYS = {"PRESS": "hotkey", "KEY_DOWN": "key_down", "KEY_UP": "key_up"}


def map_computer_13(action: object, scaling: Scaling) -> Any:
    """Return the action with `x, y` scaled, in the same form.

    The form is nested, flat, or one of the words WAIT, FAIL and DONE.

    Raises:
        ActionError: the name of the action is unknown, a coordinate is missing or not a number, or
            an unknown field may hold coordinates.
    """
    fields = _fields(action)
    name, parameters = _read(fields)
    point = _point(name, parameters)
    if point is not None:
        parameters["x"], parameters["y"] = scaling.point(*point)
    if isinstance(action, str):
        return action
    if "parameters" not in fields:
        return parameters
    return {**fields, "parameters": parameters}


def parse_computer_13(action: object, scaling: Scaling) -> Action:
    """Read the action.

    `SCROLL` counts `dy`, and is `"other"` when it scrolls sideways.

    Raises:
        ActionError: the action cannot be read.
    """
    name, parameters = _read(_fields(action))
    raw = _point(name, parameters)
    point = None if raw is None else scaling.point(*raw)
    match name:
        case "MOVE_TO":
            return action_at("move", point)
        case "DRAG_TO":
            x2, y2 = point or (None, None)
            return Action("drag", x2=x2, y2=y2)
        case "CLICK":
            clicks = parameters.get("num_clicks", 1)
            return action_at(click_type(parameters.get("button", "left"), clicks), point)
        case "RIGHT_CLICK" | "DOUBLE_CLICK":
            return action_at(name.lower(), point)
        case "MOUSE_DOWN" | "MOUSE_UP":
            is_left = click_type(parameters.get("button", "left"), 1) == "click"
            return action_at(name.lower() if is_left else "other", point)
        case "SCROLL":
            dx = number(parameters.get("dx", 0), "SCROLL dx")
            dy = number(parameters.get("dy", 0), "SCROLL dy")
            if dx:  # an `Action` scrolls up or down only
                return action_at("other", point)
            return action_at("scroll", point, amount=dy)
        case "TYPING":
            return Action("type", text=text(parameters.get("text"), "TYPING text"))
        case "HOTKEY":
            return Action("hotkey", keys=key_names(parameters.get("keys"), "HOTKEY keys"))
        case "PRESS" | "KEY_DOWN" | "KEY_UP":
            return Action(_KEYS[name], keys=key_names(parameters.get("key"), f"{name} key"))
        case _:
            return Action(SPECIAL_WORDS[name])


def _fields(action: object) -> dict[str, Any]:
    if isinstance(action, str) and action in SPECIAL_WORDS:
        return {"action_type": action}
    return as_fields(action, DIALECT)


def _read(fields: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    name = fields.get("action_type")
    if name not in NAMES:
        refuse_unknown_action(DIALECT, name, NAMES)
    label = f"{DIALECT} {name}"
    if "parameters" not in fields:
        check_fields(fields, ("action_type", *_FIELDS), label)
        return str(name), fields
    check_fields(fields, ("action_type", "parameters"), label)
    nested = fields["parameters"]
    parameters = {} if nested is None else as_fields(nested, f"{DIALECT}, {name}, parameters")
    check_fields(parameters, _FIELDS, label)
    return str(name), parameters


def _point(name: str, parameters: dict[str, Any]) -> tuple[float, float] | None:
    x = parameters.get("x")
    y = parameters.get("y")
    if x is None and y is None and name not in _NEED_POINT:
        return None
    if x is None or y is None:
        raise ActionError(
            f"{DIALECT} {name} needs both x and y, got x={short_repr(x)}, y={short_repr(y)}"
        )
    return number(x, f"{name} x"), number(y, f"{name} y")
