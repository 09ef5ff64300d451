"""Elements from recorded labels: plain boxes, dictionaries, fractions, AgentNetBench's metadata."""

import math
import reprlib
from collections.abc import Mapping, Sequence
from itertools import chain
from numbers import Real
from typing import Any, TypeAlias, cast

import numpy as np
import numpy.typing as npt

from ..errors import ElementsError
from ..types import Size, are_fractions, as_boxes, as_size
from .base import Elements

# Keys of a dictionary with labels; keys of one label: its box (x1, y1, x2, y2), name and role.
LIST_KEYS = ("metadata", "bboxes", "boxes", "elements", "labels")
BOX_KEYS = ("bbox", "box")
SIDE_KEYS = ("x", "y", "width", "height")
NAME_KEYS = ("name", "text", "label")
ROLE_KEYS = ("role", "type")
# Annotated fractions may overshoot the edge of the screen a little; larger numbers must be pixels.
OVERSHOOT = 0.01
LARGEST = 2**29  # within this limit, the sum of two numbers still fits into a box
_NUMBERS = {int, float}

_Dict: TypeAlias = Mapping[str, Any]


def boxes_from_labels(data: object, normalized: bool = False, size: Size | None = None) -> Elements:
    """Read recorded labels; all labels keep their order, so indices stay valid.

    Args:
        data: a list (or an array `[N, 4]`) of labels, or a dictionary that holds one under a key of
            `LIST_KEYS`. A label is `[x1, y1, x2, y2]`, a dictionary with such a `"bbox"` or
            `"box"`, one with `x`, `y`, `width`, `height`, or AgentNetBench's `"rel_bbox"`: x, y,
            width, height as fractions of the screen.
        normalized: the numbers are fractions of the screen, 0 to 1, instead of pixels (`rel_bbox`
            always is).
        size: `(height, width)` of the screen in pixels; needed for fractions only.

    Returns:
        int32 boxes rounded to whole pixels, with the names and roles that the dictionaries give.

    Raises:
        ElementsError: the labels have another structure, a number is not finite or out of range, or
            a box ends before it starts; the message names index and field.
    """
    screen = None if size is None else as_size(size)
    items = _list(data)
    plain = None if normalized else _plain_boxes(items)
    if plain is not None:
        return Elements(as_boxes(plain, "labels"), ("",) * len(plain), ("",) * len(plain), "labels")
    rows = [_label(item, f"labels[{i}]", normalized, screen) for i, item in enumerate(items)]
    names = tuple(_text(item, NAME_KEYS) for item in items)
    roles = tuple(_text(item, ROLE_KEYS) for item in items)
    return Elements(as_boxes(rows, "labels"), names, roles, "labels")


def _list(data: object) -> Sequence[object]:
    for key in LIST_KEYS:
        if isinstance(data, Mapping):
            data = cast("_Dict", data).get(key, cast("object", data))
    if isinstance(data, Mapping) and not data:  # the metadata of a key press in AgentNetBench
        return ()
    keys = ", ".join(LIST_KEYS)
    rule = f"labels must be a list of boxes, or a dictionary with one under {keys}"
    return _sequence(cast("object", data), rule)


def _plain_boxes(items: Sequence[object]) -> npt.NDArray[np.float64] | None:
    """Return labels that are all lists of four pixels, `[N, 4]`, checked at once.

    It takes a tenth of the time of looking at each. `None` for labels of any other form, and for
    wrong ones, whose error names the index and the number.
    """
    if set(map(type, items)) != {list}:
        return None
    lists = cast("Sequence[list[object]]", items)
    if set(map(len, lists)) != {4} or not set(map(type, chain.from_iterable(lists))) <= _NUMBERS:
        return None
    try:
        rows = np.array(lists, np.float64)
    except OverflowError:
        return None
    in_range = bool((np.abs(rows) <= LARGEST).all())  # false for NaN, too
    maybe_fractions = bool((rows <= 1).all(axis=1).any())
    ends_late = bool((rows[:, 2:] >= rows[:, :2]).all())
    return rows if in_range and ends_late and not maybe_fractions else None


def _sequence(value: object, rule: str) -> Sequence[object]:
    if hasattr(value, "tolist"):  # NumPy and torch
        value = cast("Any", value).tolist()
    if not isinstance(value, Sequence) or isinstance(value, str | bytes | bytearray):
        raise ElementsError(f"{rule}; got {_short(value)}")
    return cast("Sequence[object]", value)


def _label(item: object, field: str, normalized: bool, screen: Size | None) -> list[float]:
    # Returns the box of a label as x1, y1, x2, y2 in pixels.
    numbers, path, has_size = _numbers(item, field)
    x1, y1, x2, y2 = numbers
    if has_size:
        x2 += x1
        y2 += y1
    if x2 < x1 or y2 < y1:
        advice = "boxes are x1, y1, x2, y2 (not x, y, w, h)"
        if has_size:
            advice = "width and height must not be negative"
        raise ElementsError(f"{path} = {numbers} ends before it starts; {advice}")
    box = [x1, y1, x2, y2]
    if normalized or path.endswith(".rel_bbox"):
        _check_fractions(box, numbers, path)
        return _in_pixels(box, screen, path)
    if are_fractions(box):
        raise ElementsError(
            f"{path} = {numbers} are fractions of the screen, not pixels: give normalized=True"
        )
    return box


def _check_fractions(box: list[float], numbers: list[float], field: str) -> None:
    if min(box) < -OVERSHOOT or max(box) > 1 + OVERSHOOT:
        raise ElementsError(
            f"{field} = {numbers} leaves the screen; fractions are 0 to 1 (pixels:"
            " normalized=False)"
        )


def _in_pixels(box: list[float], screen: Size | None, field: str) -> list[float]:
    if screen is None:
        raise ElementsError(
            f"{field} holds fractions of the screen: give size=(height, width) in pixels"
        )
    height, width = screen
    x1, y1, x2, y2 = box
    return [x1 * width, y1 * height, x2 * width, y2 * height]


def _numbers(item: object, field: str) -> tuple[list[float], str, bool]:
    # Returns the four numbers of a label, their path, and whether they are x, y, width, height.
    if not isinstance(item, Mapping):
        return _four(item, field), field, False
    label = cast("_Dict", item)
    for key in ("rel_bbox", *BOX_KEYS):
        if key in label:
            path = f"{field}.{key}"
            return _four(label[key], path), path, key == "rel_bbox"
    for key in SIDE_KEYS:
        if key not in label:
            raise ElementsError(
                f"{field} has no {key!r}: a label needs bbox or box (x1, y1, x2, y2), or x, y,"
                f" width and height; it has {_short(sorted(map(str, label)))}"
            )
    return [_number(label[key], f"{field}.{key}") for key in SIDE_KEYS], field, True


def _four(value: object, field: str) -> list[float]:
    numbers = _sequence(value, f"{field} must be a list of 4 numbers, or a dictionary")
    if len(numbers) != 4:
        raise ElementsError(f"{field} must have 4 numbers, got {len(numbers)}: {_short(numbers)}")
    return [_number(v, f"{field}[{i}]") for i, v in enumerate(numbers)]


def _number(value: object, field: str) -> float:
    if isinstance(value, bool) or not isinstance(value, Real):
        raise ElementsError(f"{field} must be a number, got {_short(value)}")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not abs(number) <= LARGEST:  # false for NaN, too
        raise ElementsError(
            f"{field} must be a number of pixels within 2**29, got {_short(number)}"
        )
    return number


def _text(item: object, keys: tuple[str, ...]) -> str:
    if not isinstance(item, Mapping):
        return ""
    label = cast("_Dict", item)
    for key in keys:
        if isinstance(label.get(key), str):
            return label[key]
    return ""


def _short(value: object) -> str:
    try:
        text = reprlib.repr(value)
    except ValueError:  # Python refuses to print an integer with thousands of digits
        text = "a number of too many digits"
    return f"{text} ({type(value).__name__})"
