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
    padded = np.pad(differs, ((0, below), (0, beside)))
    rows, columns = padded.shape[0] // TILE_PX, padded.shape[1] // TILE_PX
    by_tile = padded.reshape(rows, TILE_PX, columns, TILE_PX)
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


def touch(first: Box, second: Box) -> bool:
    """Return whether two boxes share a pixel."""
    across = first[0] < second[2] and second[0] < first[2]
    return across and first[1] < second[3] and second[1] < first[3]


def union(first: Box, second: Box) -> Box:
    """Return the smallest box that holds two boxes."""
    return (
        min(first[0], second[0]),
        min(first[1], second[1]),
        max(first[2], second[2]),
        max(first[3], second[3]),
    )


def merged(boxes: list[Box]) -> list[Box]:
    """Return boxes of which no two touch, and that hold all of the given ones."""
    remaining = list(boxes)
    separate: list[Box] = []
    while remaining:
        box = remaining.pop()
        near = [neighbour for neighbour in remaining if touch(box, neighbour)]
        if not near:
            separate.append(box)
            continue
        for neighbour in near:
            remaining.remove(neighbour)
            box = union(box, neighbour)
        remaining += [box, *(neighbour for neighbour in separate if touch(box, neighbour))]
        separate = [neighbour for neighbour in separate if not touch(box, neighbour)]
    return sorted(separate, key=lambda box: (box[1], box[0]))
