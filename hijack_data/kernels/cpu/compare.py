"""Count the pixels in which two pictures in memory differ."""

from typing import Any

import numpy as np

from ...types import BoxArray, UInt8Array, clip_boxes

# Bands of this many pixels are compared at once, to stay in the cache. Areas up to the second
# number wide are compared pixel by pixel, wider ones as lines of bytes.
BAND_PIXELS = 1 << 15
NARROW_WIDTH = 128


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
    total = 0
    for x1, y1, x2, y2 in disjoint.tolist():
        total += _differing(before[y1:y2, x1:x2], after[y1:y2, x1:x2])
    return total


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


def _differing(before: UInt8Array, after: UInt8Array) -> int:
    """Count the differing pixels of two `[h, w, 3]` areas, a band of rows at a time."""
    width = before.shape[1]
    band = max(1, BAND_PIXELS // width)
    packed = before.strides[1:] == after.strides[1:] == (3, 1)
    differ = _differ_in_lines if packed and width > NARROW_WIDTH else _differ_in_pixels
    total = 0
    for row in range(0, len(before), band):
        pixels = differ(before[row : row + band], after[row : row + band])
        total += int(np.count_nonzero(pixels))
    return total


def _differ_in_lines(before: UInt8Array, after: UInt8Array) -> Any:
    """Return which pixels differ, bool `[h, w]`, comparing whole lines of bytes.

    After the comparison, the result of each pixel is at its first byte.
    """
    differ = before.reshape(len(before), -1) != after.reshape(len(after), -1)
    pixels = differ[:, :-2] | differ[:, 1:-1]
    pixels |= differ[:, 2:]
    return pixels[:, ::3]


def _differ_in_pixels(before: UInt8Array, after: UInt8Array) -> Any:
    """Return which pixels differ, bool `[h, w]`."""
    differ = before != after
    pixels = differ[..., 0] | differ[..., 1]
    pixels |= differ[..., 2]
    return pixels
