"""Where two pictures of a screen differ: tile by tile, as boxes."""

import numpy as np
import numpy.typing as npt

from hijack_data import extras
from hijack_data.types import Box, UInt8Array

TILE_PX = 32  # px; smaller tiles cost time, larger ones more reading


def changed_tiles(before: UInt8Array, after: UInt8Array) -> npt.NDArray[np.bool_]:
    """Return which tiles differ: bool `[rows, columns]`, of tiles of `TILE_PX` pixels.

    Args:
        before: uint8 `[H, W, 3]`.
        after: uint8 of the same shape.
    """
    differs = (before != after).any(axis=2)
    height, width = differs.shape
    below = -height % TILE_PX
    beside = -width % TILE_PX
    whole = np.pad(differs, ((0, below), (0, beside)))
    rows, columns = whole.shape[0] // TILE_PX, whole.shape[1] // TILE_PX
    by_tile = whole.reshape(rows, TILE_PX, columns, TILE_PX)
    return np.any(by_tile, axis=(1, 3))


def changed_boxes(before: UInt8Array, after: UInt8Array) -> list[Box]:
    """Return boxes, `xyxy` in pixels, that hold all that differs.

    Tiles that touch, or have one tile between them, are in one box. Pictures of different sizes
    differ everywhere.

    Args:
        before: uint8 `[H, W, 3]`.
        after: uint8 `[H, W, 3]`.
    """
    height, width = after.shape[:2]
    if before.shape != after.shape:
        return [(0, 0, width, height)]
    tiles = changed_tiles(before, after)
    cv2 = extras.load("cv2", "comparing pictures", "ocr")
    joined = cv2.dilate(tiles.astype(np.uint8), np.ones((3, 3), np.uint8))
    count, labels = cv2.connectedComponents(joined, connectivity=8)
    boxes: list[Box] = []
    for label in range(1, count):
        rows, columns = np.nonzero(tiles & (labels == label))
        box = (
            int(columns.min()) * TILE_PX,
            int(rows.min()) * TILE_PX,
            min((int(columns.max()) + 1) * TILE_PX, width),
            min((int(rows.max()) + 1) * TILE_PX, height),
        )
        boxes.append(box)
    return boxes


def changed_share(before: UInt8Array, after: UInt8Array) -> float:
    """Return the share of tiles that differ, 0 to 1; 1 for pictures of different sizes."""
    if before.shape != after.shape:
        return 1.0
    return float(changed_tiles(before, after).mean())


def touch(one: Box, other: Box) -> bool:
    """Return whether two boxes share a pixel."""
    across = one[0] < other[2] and other[0] < one[2]
    return across and one[1] < other[3] and other[1] < one[3]


def union(one: Box, other: Box) -> Box:
    """Return the smallest box that holds two boxes."""
    return (
        min(one[0], other[0]),
        min(one[1], other[1]),
        max(one[2], other[2]),
        max(one[3], other[3]),
    )


def merged(boxes: list[Box]) -> list[Box]:
    """Return boxes of which no two touch, and that hold all of the given ones."""
    left = list(boxes)
    apart: list[Box] = []
    while left:
        box = left.pop()
        near = [other for other in left if touch(box, other)]
        if not near:
            apart.append(box)
            continue
        for other in near:
            left.remove(other)
            box = union(box, other)
        left += [box, *(other for other in apart if touch(box, other))]
        apart = [other for other in apart if not touch(box, other)]
    return sorted(apart, key=lambda box: (box[1], box[0]))
