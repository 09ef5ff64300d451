"""Checked access to the fields of a parsed record; every error names its field.

The checks are our own because msgspec and pydantic convert before they check, and because the tests
with hostile input rely on our messages and limits.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias, cast

from hijack_data.elements.recorded_boxes import boxes_from_labels
from hijack_data.errors import HijackError, short_repr, suggest
from hijack_data.platforms import as_platform
from hijack_data.surrogates import has_half
from hijack_data.types import (
    ACTION_TYPES,
    AIMING,
    Action,
    Box,
    Platform,
    Size,
    Trajectory,
    are_fractions,
    clip_boxes,
    size_text,
)

from ..errors import SourceError
from .key_names import key_problem

LONE_SURROGATE = "holds half of a surrogate pair, which is not text"
MAX_TEXT_CHARS = 1 << 20
MAX_STEP = 2**31 - 1
MAX_PIXEL = 2**24
MAX_AMOUNT = 1e15
ACTION_FIELDS = ("type", "x", "y", "x2", "y2", "text", "keys", "amount")
_POINTS = (("x", "y"), ("x2", "y2"))
MAX_ELEMENTS = 10_000
# The fields without which an action of a type says nothing. Other fields of a type are optional:
# the place of a scroll, the seconds of a wait, the answer of `done`.
REQUIRED: Mapping[str, tuple[str, ...]] = {
    **{kind: ("x", "y") for kind in ACTION_TYPES if kind in AIMING},
    "drag": ("x", "y", "x2", "y2"),
    "scroll": ("amount",),
    "type": ("text",),
    "hotkey": ("keys",),
    "key_down": ("keys",),
    "key_up": ("keys",),
}
# The types that have a place, the end of a drag, or a text; code of other types would lose these.
_TYPES_WITH: Mapping[str, tuple[str, ...]] = {
    "x": (*(kind for kind in ACTION_TYPES if kind in AIMING), "scroll", "other"),
    "x2": ("drag", "other"),
    "text": ("type", "done", "fail", "other"),
}
# What other formats call the fields of an action.
_OTHER_FIELDS = {
    **dict.fromkeys(("point", "position", "coordinate", "coordinates", "location"), "x and y"),
    **dict.fromkeys(("start", "from", "start_box", "startcoordinate"), "x and y"),
    **dict.fromkeys(("end", "to", "end_box", "destination"), "x2 and y2"),
    **dict.fromkeys(("key", "hotkey", "shortcut"), "keys"),
    **dict.fromkeys(("value", "content", "string", "input"), "text"),
    **dict.fromkeys(("clicks", "seconds", "duration", "time", "dy", "scroll", "delta"), "amount"),
    **dict.fromkeys(("action", "name", "action_type", "button"), "type"),
}
# One parsed record, or an object inside one.
JsonObject: TypeAlias = Mapping[str, Any]


class FieldError(SourceError):
    """One field of one record is missing or wrong; readers turn it into a `Rejected`."""

    def __init__(self, field: str, reason: str) -> None:
        self.field = field
        self.reason = reason
        super().__init__(f"{field}: {reason}" if field else reason)


class FieldTypeError(FieldError):
    """A field has a value of the wrong kind, which the message shows."""

    def __init__(self, field: str, expected: str, value: object) -> None:
        super().__init__(field, f"must be {expected}, got {short_repr(value)}")


def mapping(value: object, field: str) -> JsonObject:
    """Return `value` if it is a JSON object.

    Raises:
        FieldTypeError: the value is of another kind.
    """
    if not isinstance(value, dict):
        raise FieldTypeError(field, "an object", value)
    return cast("dict[str, Any]", value)


def mappings(values: Iterable[object], field: str) -> list[JsonObject]:
    """Check that all values are JSON objects and return them, or raise `FieldTypeError`."""
    return [mapping(value, field) for value in values]


def items(record: JsonObject, key: str) -> list[Any]:
    """Return a required list.

    Raises:
        FieldTypeError: the value is of another kind; a missing one is a `FieldError`.
    """
    value = _required(record, key, key)
    if not isinstance(value, list):
        raise FieldTypeError(key, "a list", value)
    return cast("list[Any]", value)


def listed(value: object) -> list[object]:
    """Return the items of an optional list; empty if the value is not a list."""
    return cast("list[object]", value) if isinstance(value, list) else []


def objects(value: object) -> list[JsonObject]:
    """Return the JSON objects of an optional list; other items are left out."""
    return [cast("dict[str, Any]", item) for item in listed(value) if isinstance(item, dict)]


def text(
    record: JsonObject, key: str, field: str | None = None, *, default: str | None = None
) -> str:
    """Return a string; without a `default` it is required and must not be empty.

    Raises:
        FieldError: the field is missing, empty, or a text that a dataset cannot store.
        FieldTypeError: the value is of another kind.
    """
    field = field or key
    if default is not None and record.get(key) is None:
        return default
    value = _required(record, key, field)
    if not isinstance(value, str):
        raise FieldTypeError(field, "a string", value)
    if default is None and not value.strip():
        raise FieldError(field, "is empty")
    return storable(value, field)


def strings(value: object) -> tuple[str, ...]:
    """Return the strings of an optional list; other items, and unstorable strings, are left out."""
    return tuple(name for name in listed(value) if isinstance(name, str) and not has_half(name))


def platform(value: object, field: str) -> Platform | None:
    """Return an optional platform.

    Raises:
        FieldError: the value is not the name of a platform.
    """
    if value is None:
        return None
    try:
        return as_platform(value, field)
    except HijackError as error:
        raise FieldError(field, str(error).removeprefix(f"{field}: ")) from None


def step_number(record: JsonObject, key: str) -> int:
    """Return a required step, an integer in 0..`MAX_STEP`.

    Raises:
        FieldTypeError: the value is of another kind; a missing one is a `FieldError`.
    """
    value = _required(record, key, key)
    is_integer = isinstance(value, int) and not isinstance(value, bool)
    if not is_integer or not 0 <= cast("int", value) <= MAX_STEP:
        raise FieldTypeError(key, f"an integer in 0..{MAX_STEP}", value)
    return cast("int", value)


def action(value: object, size: Size) -> Action:
    """Return an action given in pixels of a picture of `size`, (height, width).

    Raises:
        FieldError: a field is unknown, broken, outside the picture, or missing though the type
            requires it, see `REQUIRED`; or half a point is given.
    """
    data = mapping(value, "action")
    for key in data:
        if key not in ACTION_FIELDS:
            field_name = _OTHER_FIELDS.get(key.lower())
            hint = f"; write {field_name}" if field_name else suggest(key, ACTION_FIELDS)
            raise FieldError(f"action.{key}", f"is not a field of an action{hint}")
    kind = text(data, "type", "action.type")
    if kind not in ACTION_TYPES:
        reason = f"{kind!r} is not a type of action{suggest(kind, ACTION_TYPES)}"
        raise FieldError("action.type", reason)
    pixels = _points(data, size)
    typed = None
    if data.get("text") is not None:
        typed = text(data, "text", "action.text", default="")
    keys = _keys(data.get("keys"))
    amount = _amount(data.get("amount"), kind)
    _check_required(data, kind)
    return Action(kind, **pixels, text=typed, keys=keys, amount=amount)


def check_action_fields(data: JsonObject) -> None:
    """Check that an action of a known type has no place, end or text that the type does not have.

    Raises:
        FieldError: it has one, which would be lost.
    """
    kind = data["type"]
    for name, kinds in _TYPES_WITH.items():
        if kind not in kinds and data.get(name) not in (None, ""):
            raise FieldError(
                f"action.{name}",
                f"does not belong to type {kind!r}, only to {', '.join(kinds)}; write the type"
                " that was done, or leave the field out",
            )


def _check_required(data: JsonObject, kind: str) -> None:
    for name in REQUIRED.get(kind, ()):
        if data.get(name) is None or data[name] == "":
            needs = " and ".join(", ".join(REQUIRED[kind]).rsplit(", ", 1))
            raise FieldError(
                f"action.{name}",
                f"is missing: {kind} needs {needs}; if that was not recorded, write type 'other'",
            )


def boxes(labels: object, size: Size, field: str) -> tuple[Box, ...]:
    """Return recorded boxes clipped to a picture of `size`, (height, width).

    Raises:
        FieldError: the labels are not boxes, or the field is `target_box` and a box is invisible.
    """
    count = len(listed(labels))
    if count > MAX_ELEMENTS:
        raise FieldError(
            field, f"has {count} boxes; the limit is {MAX_ELEMENTS}: leave out what does not show"
        )
    try:
        clipped = clip_boxes(boxes_from_labels(labels, size=size).boxes, size)
    except HijackError as error:
        raise FieldError(field, str(error)) from None
    is_empty = (clipped[:, 2] <= clipped[:, 0]) | (clipped[:, 3] <= clipped[:, 1])
    if field == "target_box" and is_empty.any():
        screen = f"{size[1]}x{size[0]} screenshot"
        raise FieldError(field, f"{short_repr(labels)} is empty or outside the {screen}")
    return tuple((x1, y1, x2, y2) for x1, y1, x2, y2 in clipped.tolist())


def storable(value: str, field: str) -> str:
    """Return text that a dataset can store.

    Raises:
        FieldError: the text is too long, or contains half of a surrogate pair.
    """
    if len(value) > MAX_TEXT_CHARS:
        raise FieldError(field, f"has {len(value)} characters; the limit is {MAX_TEXT_CHARS}")
    if has_half(value):
        raise FieldError(field, LONE_SURROGATE)
    return value


def check_stated_size(record: JsonObject, size: Size) -> None:
    """Check that a record which states a `width` and a `height` states those of its picture.

    Raises:
        FieldError: it states others, as a browser's viewport has whose pictures have more pixels.
    """
    stated_size = record.get("height"), record.get("width")
    if all(isinstance(side, int | float) for side in stated_size) and stated_size != size:
        raise FieldError(
            "width",
            f"and height state {stated_size[1]:g}x{stated_size[0]:g}, but the picture is"
            f" {size_text(size)}, so it is unknown what the coordinates count; correct them, or"
            " leave the two out",
        )


def check_on_screen(action: Action, size: Size, field: str) -> Action:
    """Return an action whose points lie in a picture of `size`, (height, width).

    Raises:
        FieldError: a point is outside, or a value cannot be stored. Points are never clamped, since
            they may be in another space or on another screen.
    """
    height, width = size
    for x, y in ((action.x, action.y), (action.x2, action.y2)):
        across = x is None or 0 <= x < width
        down = y is None or 0 <= y < height
        if not (across and down):
            raise FieldError(field, f"({x}, {y}) is outside the {width}x{height} screenshot")
    for text_value in (action.text or "", *(action.keys or ())):
        storable(text_value, field)
    if action.amount is not None:
        _number(action.amount, field, MAX_AMOUNT)
    return action


def unique_id(name: str, source_name: str, used_ids: set[str]) -> str:
    """Return the id of a trajectory, after the name of its file or folder if the id is taken.

    Args:
        name: the id in its file.
        source_name: the name of the file or folder.
        used_ids: the ids of the files so far; the new one is added.
    """
    candidate = name if name not in used_ids else f"{source_name}/{name}"
    number = 1
    while candidate in used_ids:
        number += 1
        candidate = f"{source_name}/{name}~{number}"
    used_ids.add(candidate)
    return candidate


@dataclass
class RowIds:
    """Makes the ids of the rows of several files unique.

    An id is that of one row of its file. The same id in a later file is qualified by that file.
    """

    used_ids: set[str] = field(default_factory=set[str])
    source_name: str = ""
    row_ids: set[str] = field(default_factory=set[str])

    def open(self, source_name: str) -> None:
        """Begin a file, named `source_name` in ids."""
        self.source_name = source_name
        self.row_ids = set()

    def unique(self, items: Iterable[Trajectory | FieldError]) -> Iterator[Trajectory | FieldError]:
        """Yield the trajectories of a row with unique ids.

        A trajectory whose id an earlier row of the file has, and an error that ends the reading,
        are yielded as rejections; reading stops after either.
        """
        try:
            for item in items:
                if not isinstance(item, Trajectory):
                    yield item
                    continue
                if item.id in self.row_ids:
                    reason = f"{item.id!r} is the id of an earlier row of this file; number them"
                    yield FieldError("id", f"{reason} anew, or leave the ids out")
                    return
                self.row_ids.add(item.id)
                yield replace(item, id=unique_id(item.id, self.source_name, self.used_ids))
        except FieldError as error:
            yield error


def _required(record: JsonObject, key: str, field: str) -> object:
    if record.get(key) is None:
        raise FieldError(field, "is missing")
    return record[key]


def _number(value: object, field: str, limit: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise FieldTypeError(field, "a number", value)
    # the first is false for NaN, and safe for giant integers
    if not (abs(value) <= limit and math.isfinite(value)):
        raise FieldTypeError(field, f"a finite number, at most {limit:g}", value)
    return float(value)


def _points(data: JsonObject, size: Size) -> dict[str, int | None]:
    # A point needs both coordinates, or neither.
    height, width = size
    pixels: dict[str, int | None] = {}
    for x, y in _POINTS:
        pixels[x] = _pixel(data.get(x), f"action.{x}", width)
        pixels[y] = _pixel(data.get(y), f"action.{y}", height)
    for x, y in _POINTS:
        _check_space(data, x, y)
    for x, y in _POINTS:
        for key, partner in ((x, y), (y, x)):
            if pixels[key] is None and pixels[partner] is not None:
                raise FieldError(f"action.{key}", f"is missing, though {partner} is given")
    return pixels


def _check_space(data: JsonObject, x: str, y: str) -> None:
    # Taken as pixels, a point in fractions would be the corner of the picture.
    point = [data[side] for side in (x, y) if data.get(side) is not None]
    if point and are_fractions(point):
        raise FieldError(
            f"action.{x}",
            f"{short_repr(point)} are fractions of the picture, not pixels; multiply x by its"
            " width and y by its height",
        )


def _pixel(value: object, field: str, side: int) -> int | None:
    if value is None:
        return None
    pixel = math.floor(_number(value, field, MAX_PIXEL) + 0.5)
    if not 0 <= pixel < side:
        reason = f"{short_repr(value)} is outside the screenshot, whose side is {side} pixels"
        raise FieldError(field, reason)
    return pixel


def _keys(value: object) -> tuple[str, ...] | None:
    if value is None:
        return None
    keys = [key for key in listed(value) if isinstance(key, str)]
    if not isinstance(value, list) or len(keys) != len(listed(value)):
        raise FieldTypeError("action.keys", "a list of strings", value)
    problem = key_problem(keys)
    if problem:
        raise FieldError("action.keys", problem)
    return tuple(storable(key, "action.keys") for key in keys)


def _amount(value: object, kind: str) -> float | None:
    if value is None:
        return None
    amount = _number(value, "action.amount", MAX_AMOUNT)
    if kind == "wait" and amount < 0:
        raise FieldError("action.amount", f"{amount:g} is below 0; write the seconds of the wait")
    return amount
