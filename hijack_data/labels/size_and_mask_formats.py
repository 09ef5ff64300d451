"""Labels of single numbers (one coordinate, a width), the size of the picture, and masks."""

from typing import Any, cast

import numpy as np
from PIL import Image

from ..actions import Scaling
from ..errors import LabelError, short_repr
from ..safety import resized_mask
from ..sample_pictures import is_object_array, is_sequence, rebuilt
from ..types import Size, are_fractions
from .base import Format, Move
from .nested_numbers import Numbers, change_each, host_array, object_array, put_back


def coordinate_format(name: str) -> Format:
    """Return the format of single numbers: `"x"`, `"y"`, or lengths `"dx"` and `"dy"`."""

    def check(numbers: list[Any], scaling: Scaling, axis: int) -> None:
        if are_fractions(numbers):
            problem = "which are fractions of the picture"
            raise LabelError(f"holds {numbers}, {problem}; say 'leave'")
        for number in numbers:
            scaling.check(number, axis)

    def map_value(value: Any, move: Move) -> Any:
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

    return Format(name, map_value)


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

    def map_value(value: Any, move: Move) -> Any:
        def change(numbers: Numbers) -> Numbers:
            expected = np.array(of(move.before))
            count, remainder = divmod(numbers.size, expected.size)
            if remainder or not np.array_equal(numbers, np.tile(expected, count)):
                raise LabelError(
                    f"is {short_repr(value)}, but as {name} of the picture it would be"
                    f" {expected.tolist()}; if it says something else, declare it 'leave'"
                )
            return np.tile(of(move.after), count).astype(numbers.dtype)

        return change_each(value, change)

    return Format(name, map_value)


def map_mask(value: Any, move: Move) -> Any:
    """Return a mask `[..., H, W]`, or a PIL image of any mode, after a `Move`, in its own form.

    Raises:
        LabelError: the mask does not have one value for each pixel.
    """
    if value is None:
        return None
    if isinstance(value, Image.Image):
        _check_mask_size((value.height, value.width), move, f"{value.width}x{value.height} pixels")
        return _map_image_mask(value, move)
    if is_object_array(value):
        return object_array(value, [map_mask(part, move) for part in value.tolist()])
    if is_sequence(value) and _holds_arrays(value):
        return rebuilt(value, [map_mask(part, move) for part in value])
    try:
        array = host_array(value)
    except (TypeError, ValueError, OverflowError, RuntimeError):
        array = np.empty(1, object)
    if not array.size:
        return value  # no masks, in a sample without objects
    if array.dtype.kind not in "iufb":
        raise LabelError(
            "must be an image or an array of numbers, no lists of different lengths, got"
            f" {short_repr(value)}"
        )
    _check_mask_size(array.shape[-2:], move, f"shape {list(array.shape)}")
    picked = resized_mask(array, move.after)
    return picked.tolist() if is_sequence(value) else put_back(value, picked)


def _map_image_mask(mask: Image.Image, move: Move) -> Image.Image:
    """Return a mask as an image of the same mode and palette, picked as all masks are."""
    values = np.asarray(mask)
    planes = np.moveaxis(values, -1, 0) if values.ndim == 3 else values
    picked = resized_mask(planes, move.after)
    image = Image.fromarray(np.moveaxis(picked, 0, -1) if values.ndim == 3 else picked)
    if mask.mode == "P" and mask.palette is not None:
        image.putpalette(mask.palette)
    image.info = dict(mask.info)
    return image


def _check_mask_size(size: object, move: Move, actual: str) -> None:
    if size != move.before:
        height, width = move.before
        raise LabelError(
            f"must have one value for each pixel, [..., {height}, {width}], got {actual}"
        )


def _holds_arrays(value: Any) -> bool:
    """Return whether the innermost parts of lists and tuples are arrays, tensors or images."""
    first: Any = value
    while isinstance(first, list | tuple) and first:
        first = cast("list[Any]", first)[0]
    return hasattr(cast(Any, first), "dtype") or isinstance(first, Image.Image)
