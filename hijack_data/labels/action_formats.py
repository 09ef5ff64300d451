"""Labels that are actions: the library's `Action`, or those of a dialect."""

import json
from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from typing import Any, cast

from ..actions import DICT_DIALECTS, RESIZED_DIALECTS, Scaling, map_typed, parse_actions
from ..coords import CoordMap
from ..errors import LabelError, short_repr
from ..smart_resize import smart_resize
from ..types import ACTION_TYPES, Action, Size, are_fractions
from .base import Format, Location, Move

ACTION_KEYS = tuple(field.name for field in fields(Action))


def is_own_action(value: object) -> bool:
    """Return whether a value is an `Action`, or the dictionary of one, as in a dataset row."""
    if isinstance(value, Action):
        return True
    if not isinstance(value, Mapping):
        return False
    entries = cast("Mapping[Any, Any]", value)
    return entries.get("type") in ACTION_TYPES and all(key in ACTION_KEYS for key in entries)


def own_action(value: object) -> Action:
    """Return an `Action`, or the dictionary of one, as an `Action`.

    Raises:
        LabelError: the value is neither an `Action` nor the dictionary of one.
    """
    if isinstance(value, Action):
        return value
    if not is_own_action(value):
        raise LabelError(
            f"must be an Action, or a dictionary of {', '.join(ACTION_KEYS)} with a type of"
            f" {', '.join(ACTION_TYPES)}; got {short_repr(value)}"
        )
    action_fields: dict[str, Any] = dict(cast("Mapping[str, Any]", value))
    keys = action_fields.pop("keys", None)
    return Action(**action_fields, keys=None if keys is None else tuple(keys))


def map_own_action(value: Any, move: Move) -> Any:
    """Return an `Action`, or several, with their points after a `Move`; `None` stays.

    Raises:
        LabelError: the value holds something else than actions, or their points are fractions.
    """
    if value is None:
        return None
    if isinstance(value, list | tuple):
        return _map_parts(value, lambda part: map_own_action(part, move))
    action = own_action(value)
    keys = [key for key in ("x", "y", "x2", "y2") if getattr(action, key) is not None]
    numbers = [getattr(action, key) for key in keys]
    if are_fractions(numbers):
        raise LabelError(f"points at {numbers}, which are fractions, not pixels")
    coordinates: dict[str, Any] = {}
    for key, number in zip(keys, numbers, strict=True):
        scale = move.scaling.x if key in ("x", "x2") else move.scaling.y
        coordinates[key] = scale(number)
    if isinstance(value, Action):
        return replace(value, **coordinates)
    return {**cast("Mapping[str, Any]", value), **coordinates}


def _map_parts(value: Any, change: Callable[[Any], Any]) -> Any:
    """Apply `change` to the parts of a list or tuple."""
    parts = [change(part) for part in cast("list[Any]", value)]
    return tuple(parts) if isinstance(value, tuple) else parts


def own_locations(value: Any, size: Size) -> list[Location]:
    """Return where an `Action`, or each of several, points."""
    if value is None:
        return []
    if isinstance(value, list | tuple):
        locations: list[Location] = []
        for part in cast("list[Any]", value):
            locations += own_locations(part, size)
        return locations
    action = own_action(value)
    if action.point is None:
        return []
    return [Location(action.point, action.end)]


def dialect_format(dialect: str) -> Format:
    """Return the label format for actions of a dialect of `hijack_data.actions`."""

    def dialect_scaling(move: Move) -> Scaling:
        # Its coordinates are pixels of the picture as the model receives it.
        if dialect in RESIZED_DIALECTS:
            return Scaling(smart_resize(*move.before), smart_resize(*move.after), bounded=True)
        return move.scaling

    def map_value(value: Any, move: Move) -> Any:
        scaling = dialect_scaling(move)
        return _each_action(value, dialect, lambda action: map_typed(action, dialect, scaling))

    def locate(value: Any, size: Size) -> list[Location]:
        locations: list[Location] = []

        def collect(action: Any) -> Any:
            model_size = smart_resize(*size) if dialect in RESIZED_DIALECTS else size
            for item in parse_actions(action, dialect, model_size):
                if item.point is None:
                    continue
                on_picture = CoordMap(model_size, size).action_to_screen(item)
                locations.append(
                    Location(cast("tuple[float, ...]", on_picture.point), on_picture.end)
                )
            return action

        _each_action(value, dialect, collect)
        return locations

    return Format(dialect, map_value, locate)


def _each_action(value: Any, dialect: str, change: Callable[[Any], Any]) -> Any:
    # Applies `change` to an action or to each of several; JSON text stays JSON text, bytes stay
    # bytes.
    if value is None:
        return None
    if isinstance(value, bytes):
        text: str = _each_action(value.decode("utf-8"), dialect, change)
        return text.encode("utf-8")
    if isinstance(value, list | tuple):
        return _map_parts(value, lambda part: _each_action(part, dialect, change))
    written_as_json = isinstance(value, str) and dialect in DICT_DIALECTS
    if not written_as_json or value.strip() in ("WAIT", "FAIL", "DONE"):
        return change(value)
    try:
        data = json.loads(value)
    except ValueError as error:
        problem = f"{short_repr(value)} is not JSON ({error})"
        raise LabelError(f"is not an action of {dialect}: {problem}") from None
    return json.dumps(_each_action(data, dialect, change), ensure_ascii=False)
