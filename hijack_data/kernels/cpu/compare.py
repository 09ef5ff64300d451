"""Count the pixels in which two pictures in memory differ."""

from collections.abc import Iterator
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from ...types import Box, BoxArray, UInt8Array, clip_boxes

BoolArray: TypeAlias = npt.NDArray[np.bool_]
PIXELS_AT_ONCE = 1 << 15  # so many pixels are compared at once, to stay in the cache
_FIRST_BYTES = np.tile([True, False, False], PIXELS_AT_ONCE)


def count(before: UInt8Array, after: UInt8Array, boxes: BoxArray) -> int:
    """Count the pixels inside given boxes in which two pictures of one size differ.

    The time grows with the square of the number of boxes: for more than some hundred, one box for
    the whole picture is quicker.

    Args:
        before: `[h, w, 3]`, of any strides.
        after: likewise.
        boxes: int32 `[n, 4]` (`xyxy`); they hold all pixels that can differ. They may overlap and
            stick out of the picture; each pixel counts once. Overlapping boxes are replaced by the
            box around them.
    """
    inside = clip_boxes(boxes, before.shape[:2])
    holds_pixels = (inside[:, :2] < inside[:, 2:]).all(axis=1)
    disjoint = _disjoint(inside[holds_pixels])
    planar = after.strides[1] < after.strides[2]
    parts = _differences(before[..., :3], after[..., :3], disjoint, planar)
    return sum(_count_pixels(differ, planar) for differ in parts)


def _disjoint(boxes: BoxArray) -> BoxArray:
    """Replace overlapping boxes by the box around them until none overlap; no box may be empty."""
    while len(boxes) > 1:
        x1, y1, x2, y2 = boxes.T[:, :, None]
        touch = (x1 < x2.T) & (x2 > x1.T) & (y1 < y2.T) & (y2 > y1.T)
        # For each box, the first one that it overlaps, which may be itself.
        first = touch.argmax(axis=1)
        if (first == np.arange(len(boxes))).all():
            break
        low = boxes[:, :2].copy()
        high = boxes[:, 2:].copy()
        np.minimum.at(low, first, boxes[:, :2])
        np.maximum.at(high, first, boxes[:, 2:])
        boxes = np.concatenate([low, high], axis=1)[np.unique(first)]
    return boxes


def _differences(
    before: UInt8Array, after: UInt8Array, boxes: BoxArray, planar: bool
) -> Iterator[BoolArray]:
    """Yield which bytes differ inside disjoint boxes; many small boxes share one array.

    The arrays are bool `[n, 3]`, or `[3, n]` if `planar`, which is fast for pictures whose channels
    lie in the same way. Each is written into the memory of the one before.
    """
    differ = np.empty((3, PIXELS_AT_ONCE) if planar else (PIXELS_AT_ONCE, 3), bool)
    end = 0
    for x1, y1, x2, y2 in _pieces(boxes):
        height = y2 - y1
        width = x2 - x1
        start = end
        end = start + height * width
        if end > PIXELS_AT_ONCE:
            yield differ[:, :start] if planar else differ[:start]
            start = 0
            end = height * width
        if planar:
            out = differ[:, start:end].reshape(3, height, width).transpose(1, 2, 0)
        else:
            out = differ[start:end].reshape(height, width, 3)
        np.not_equal(before[y1:y2, x1:x2], after[y1:y2, x1:x2], out=out)
    yield differ[:, :end] if planar else differ[:end]


def _pieces(boxes: BoxArray) -> Iterator[Box]:
    """Cut boxes into pieces of at most `PIXELS_AT_ONCE` pixels."""
    for x1, y1, x2, y2 in boxes.tolist():
        for left in range(x1, x2, PIXELS_AT_ONCE):
            right = min(left + PIXELS_AT_ONCE, x2)
            rows = PIXELS_AT_ONCE // (right - left)
            for top in range(y1, y2, rows):
                yield left, top, right, min(top + rows, y2)


def _count_pixels(differ: BoolArray, planar: bool) -> int:
    """Count the pixels with a difference in any channel, see `_differences`."""
    if planar:
        return int(np.count_nonzero(differ[0] | differ[1] | differ[2]))
    # Whole lines of bytes are combined, because steps of three bytes take several times as long:
    # then the result of each pixel is at its first byte.
    line = differ.reshape(-1)
    pixels = line[:-2] | line[1:-1]
    pixels |= line[2:]
    pixels &= _FIRST_BYTES[: len(pixels)]
    return int(np.count_nonzero(pixels))
