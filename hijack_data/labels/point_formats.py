"""Points in pixels, fractions or thousandths of the picture, some with a visibility."""

from typing import Any

import numpy as np

from ..actions import Scaling
from ..errors import LabelError
from ..types import Size
from .base import Format, Location, Move, RowFormat, check_unit, with_unit
from .nested_numbers import Numbers, change_groups, read_groups

_NOWHERE = (-1, -1)


def point_format(order: str, unit: int, visibility: bool = False) -> Format:
    """Return the format of points in the order `"xy"` or `"yx"`, with or without a visibility."""
    width = 3 if visibility else 2

    def in_order(points: Numbers) -> Numbers:
        return points[:, ::-1] if order == "yx" else points

    def ordered_points(groups: Numbers) -> Numbers:
        return in_order(groups[:, :2])

    def seen_in(groups: Numbers) -> Numbers:
        if not visibility:
            return np.ones(len(groups), bool)
        return groups[:, 2] != 0

    def checked(groups: Numbers, size: Size) -> Numbers:
        points = ordered_points(groups)
        if not unit and (points == _NOWHERE).all(axis=1).any():
            raise LabelError("holds the point (-1, -1); where there is none, give None")
        check_unit(points, unit, size)
        if not unit:
            bounds = Scaling(size, size, bounded=True)
            for x, y in points.tolist():
                bounds.check(x, axis=1)
                bounds.check(y, axis=0)
        return points

    def map_rows(groups: Numbers, move: Move) -> Numbers:
        is_visible = seen_in(groups)
        if not is_visible.any():
            return groups
        points = checked(groups[is_visible], move.before)
        if unit:
            return groups
        is_whole = points.dtype.kind == "i"
        scale = move.scaling.points if is_whole else move.scaling.positions
        out = groups.copy()
        out[is_visible, :2] = in_order(scale(points))
        return out

    def locate_rows(groups: Numbers, size: Size) -> list[Location]:
        visible_groups = groups[seen_in(groups)]
        if not len(visible_groups):
            return []
        points = checked(visible_groups, size)
        if unit:
            height, width = size
            points = points * (np.array([width, height]) / unit)
        return [Location(tuple(row)) for row in points.tolist()]

    def map_value(value: Any, move: Move) -> Any:
        return change_groups(value, width, lambda groups: map_rows(groups, move))

    def locate(value: Any, size: Size) -> list[Location]:
        return [
            location
            for groups in read_groups(value, width)
            for location in locate_rows(groups, size)
        ]

    name = "xyv" if visibility else with_unit(order, unit)
    return Format(name, map_value, locate, rows=RowFormat(width, map_rows, locate_rows))
