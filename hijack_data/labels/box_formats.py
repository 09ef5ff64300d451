"""Boxes in pixels, fractions or thousandths of the picture, in the four usual orders."""

from typing import Any

import numpy as np

from ..actions import Scaling
from ..errors import LabelError
from ..types import Size
from .base import Format, Location, Move, RowFormat, check_unit, with_unit
from .nested_numbers import Numbers, change_groups, read_groups

ORDERS = ("xyxy", "xywh", "cxcywh", "yxyx")


def _edges(order: str, boxes: Numbers) -> Numbers:
    """Return boxes `[N, 4]` in some order as x1, y1, x2, y2; integers stay integers if possible."""
    if order == "xyxy":
        return boxes
    if order == "yxyx":
        return boxes[:, [1, 0, 3, 2]]
    corner = boxes[:, :2]
    sides = boxes[:, 2:]
    if order == "cxcywh":
        corner = corner - sides / 2
    return np.concatenate([corner, corner + sides], axis=1)


def _in_order(order: str, edges: Numbers) -> Numbers:
    """Return edges `[N, 4]` as boxes in some order of numbers."""
    if order == "xyxy":
        return edges
    if order == "yxyx":
        return edges[:, [1, 0, 3, 2]]
    start = edges[:, :2]
    end = edges[:, 2:]
    sides = end - start
    if order == "xywh":
        return np.concatenate([start, sides], axis=1)
    centre = (start + end) / 2
    if edges.dtype.kind == "i":
        centre = np.floor(centre).astype(edges.dtype)
    return np.concatenate([centre, sides], axis=1)


def _check_edges(
    order: str, unit: int, boxes: Numbers, size: Size, anywhere: bool, all_inside: bool
) -> Numbers:
    # Returns the edges of boxes; raises `LabelError` for a box that cannot be right.
    edges = _edges(order, boxes)
    reversed_ = (edges[:, 2:] < edges[:, :2]).any(axis=1)
    if reversed_.any():
        example = boxes[reversed_][0].tolist()
        advice = "; boxes of x, y, width, height are 'xywh'" if order == "xyxy" else ""
        raise LabelError(f"holds {example}, which as {order} ends before it starts{advice}")
    check_unit(edges, unit, size, anywhere, all_inside)
    return edges


def _scale_edges(edges: Numbers, scaling: Scaling, is_whole: bool) -> Numbers:
    if is_whole and edges.dtype.kind == "i":
        return scaling.boxes(edges, clip=False).astype(np.int64)
    scaled = scaling.positions(edges)
    if not is_whole:
        return scaled
    # A box given by its centre may have odd sides, so its edges may be halves.
    start = np.floor(scaled[:, :2])
    end = np.ceil(scaled[:, 2:])
    return np.concatenate([start, end], axis=1).astype(np.int64)


def box_format(order: str, unit: int, anywhere: bool = False) -> Format:
    """Return the format of boxes in some order; with `anywhere` they may be off the picture."""

    def map_rows(boxes: Numbers, move: Move, all_inside: bool = True) -> Numbers:
        edges = _check_edges(order, unit, boxes, move.before, anywhere, all_inside)
        if unit:
            return boxes
        is_whole = boxes.dtype.kind == "i"
        return _in_order(order, _scale_edges(edges, move.scaling, is_whole))

    def locate_rows(boxes: Numbers, size: Size, all_inside: bool = True) -> list[Location]:
        edges = _check_edges(order, unit, boxes, size, anywhere, all_inside)
        if unit:
            height, width = size
            edges = edges * (np.array([width, height, width, height]) / unit)
        return [Location(tuple(row)) for row in edges.tolist()]

    def map_value(value: Any, move: Move) -> Any:
        return change_groups(value, 4, lambda boxes: map_rows(boxes, move, all_inside=False))

    def locate(value: Any, size: Size) -> list[Location]:
        return [
            location
            for boxes in read_groups(value, 4)
            for location in locate_rows(boxes, size, all_inside=False)
        ]

    rows = RowFormat(4, map_rows, locate_rows)
    return Format(with_unit(order, unit), map_value, locate, rows=rows)
