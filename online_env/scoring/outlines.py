"""The outline of a target that is no box, as grounding sets have some.

A reader puts it into the column `extra`, under `target_polygon`: a list of [x, y], positions in
pixels of the recorded screen.
"""

import json
import math
from collections.abc import Sequence
from typing import Any, cast

from hijack_data.errors import ParameterError

KEY = "target_polygon"
Outline = tuple[tuple[float, float], ...]


def target_outline(extra: str | None, scale: tuple[float, float]) -> Outline:
    """Return the outline in a row's picture; empty if the row has none.

    Args:
        extra: the column `extra`, JSON or `None`.
        scale: width and height of the picture over those of the recorded screen.

    Raises:
        ParameterError: it is no list of at least three points, or the column is not JSON.
    """
    if not extra or KEY not in extra:
        return ()
    try:
        data: object = json.loads(extra)
    except (ValueError, RecursionError) as error:
        raise ParameterError(f"extra: is not JSON ({str(error)[:120]})") from None
    if not isinstance(data, dict) or KEY not in data:
        return ()
    corners: object = cast("dict[str, Any]", data)[KEY]
    points = cast("list[object]", corners) if isinstance(corners, list) else []
    if len(points) < 3 or not all(map(_is_point, points)):
        raise ParameterError(f"extra: {KEY} must be three points [x, y] or more, got {extra:.200}")
    numbers = cast("Sequence[tuple[float, float]]", points)
    return tuple((x * scale[0], y * scale[1]) for x, y in numbers)


def _is_point(value: object) -> bool:
    if not isinstance(value, list):
        return False
    numbers = cast("list[object]", value)
    return len(numbers) == 2 and all(_is_finite(number) for number in numbers)


def _is_finite(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer beyond all floats
        return False
