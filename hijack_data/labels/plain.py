"""Labels of single numbers (one coordinate, a width), the size of the picture, and masks."""

from typing import Any

import numpy as np

from ..actions import Scaling
from ..errors import LabelError, shown
from ..safety import resized_mask
from ..types import Size, are_fractions
from .base import Format, Move
from .numbers import Numbers, as_numbers, change_each, put_back, to_host


def coordinate_format(name: str) -> Format:
    """Return the format of single numbers: `"x"`, `"y"`, or lengths `"dx"` and `"dy"`."""

    def check(numbers: list[Any], scaling: Scaling, axis: int) -> None:
        if are_fractions(numbers):
            what = "which are fractions of the picture"
            raise LabelError(f"holds {numbers}, {what}; say 'leave'")
        for number in numbers:
            scaling.check(number, axis)

    def moved(value: Any, move: Move) -> Any:
        scaling = move.scaling
        axis = 1 if name.endswith("x") else 0
        ratio = move.after[axis] / move.before[axis]

        def change(numbers: Numbers) -> Numbers:
            if name in ("x", "y"):
                check(numbers.tolist(), scaling, axis)
            if numbers.dtype.kind == "f":
                return numbers * ratio
            scale = {"x": scaling.x, "y": scaling.y, "dx": scaling.dx, "dy": scaling.dy}[name]
            return np.array([scale(number) for number in numbers.tolist()], np.int64)

        return change_each(value, change)

    return Format(name, moved)


def size_format(name: str) -> Format:
    """Return the format of the picture's size: `"width"`, `"height"`, `"hw"` or `"wh"`."""

    def of(size: Size) -> tuple[int, ...]:
        height, width = size
        numbers = {
            "width": (width,),
            "height": (height,),
            "hw": (height, width),
            "wh": (width, height),
        }
        return numbers[name]

    def moved(value: Any, move: Move) -> Any:
        def change(numbers: Numbers) -> Numbers:
            known = np.array(of(move.before))
            count, rest = divmod(numbers.size, known.size)
            if rest or not np.array_equal(numbers, np.tile(known, count)):
                raise LabelError(
                    f"is {shown(value)}, but as {name} of the picture it would be {known.tolist()};"
                    " if it says something else, declare it 'leave'"
                )
            return np.tile(of(move.after), count).astype(numbers.dtype)

        return change_each(value, change)

    return Format(name, moved)


def moved_mask(value: Any, move: Move) -> Any:
    """Return a mask `[..., H, W]` after a `Move`, in its original form.

    Raises:
        LabelError: the mask does not have one value for each pixel.
    """
    array = np.asarray(to_host(value)) if _is_flags(value) else as_numbers(value)
    if array is None or array.shape[-2:] != move.before:
        got = "lists of different lengths" if array is None else f"shape {list(array.shape)}"
        height, width = move.before
        raise LabelError(f"must have one value for each pixel, [..., {height}, {width}], got {got}")
    picked = resized_mask(array, move.after)
    if isinstance(value, list | tuple):
        return picked.tolist()
    return put_back(value, picked)


def _is_flags(value: Any) -> bool:
    return getattr(to_host(value), "dtype", None) == np.bool_
