"""What is asked of a mask, a uint8 picture `[H, W]` of 0 and 255: its connected parts, and its straight lines.

Screens are mostly flat: many rows repeat the row above, and few pixels differ from the one before. Both are made use
of, which takes about a third of the time of OpenCV's statistics and openings, as those look at every pixel; what is
found is the same.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from ..types import UInt8Array

Ints = npt.NDArray[np.intp]
Bools = npt.NDArray[np.bool_]


class Parts:
    """The connected parts of a mask, without its background, in no fixed order.

    Args:
        cv2: OpenCV.
        mask: uint8 `[H, W]`, 0 where there is nothing and the same number everywhere else.
        connectivity: 4, or 8 for parts that may hang together by corners.

    Attributes:
        x, y, w, h: the box of each part, intp `[N]`, in pixels.
        area: its pixels, intp `[N]`.
    """

    def __init__(self, cv2: Any, mask: UInt8Array, connectivity: int) -> None:
        packed = np.packbits(mask, axis=1)
        new = np.concatenate([[True], (packed[1:] != packed[:-1]).any(1)])
        # Of rows that are equal to the one above, the first stands for all.
        self._row: Ints = np.cumsum(new) - 1
        self._first: Ints = np.flatnonzero(new)
        self._mask: UInt8Array = mask[self._first]
        count, self._labels = cv2.connectedComponents(self._mask, connectivity=connectivity)
        self._runs = _runs(cv2, self._mask)
        self._part: Ints = self._labels[self._runs[:2]].astype(np.intp) - 1  # of each run
        self._measure(count - 1)

    def _measure(self, count: int) -> None:
        row, start, end = self._runs
        height = np.bincount(self._row)
        left, right = np.full(count, self._mask.shape[1]), np.zeros(count, np.intp)
        top, bottom = np.full(count, len(self._row)), np.zeros(count, np.intp)
        np.minimum.at(left, self._part, start)
        np.maximum.at(right, self._part, end)
        np.minimum.at(top, self._part, self._first[row])
        np.maximum.at(bottom, self._part, (self._first + height)[row])
        self.x, self.y, self.w, self.h = left, top, right - left, bottom - top
        self.area = np.zeros(count, np.intp)
        np.add.at(self.area, self._part, (end - start) * height[row])

    def without(self, unwanted: Bools) -> UInt8Array:
        """Return the mask without some of the parts; `unwanted` is bool `[N]`."""
        row, start, end = (values[unwanted[self._part]] for values in self._runs)
        mask, length = self._mask.copy(), end - start
        before = np.cumsum(length) - length
        mask.reshape(-1)[np.repeat(row * mask.shape[1] + start - before, length) + np.arange(length.sum())] = 0
        return mask[self._row]

    def touching(self, mask: UInt8Array) -> Bools:
        """Return which parts share a pixel with another mask, uint8 `[H, W]`: bool `[N]`."""
        row, column = np.divmod(np.flatnonzero(mask != 0), mask.shape[1])
        return np.bincount(self._labels[self._row[row], column], minlength=len(self.x) + 1)[1:] > 0


def _runs(cv2: Any, mask: UInt8Array) -> tuple[Ints, Ints, Ints]:
    """Return what is set of a mask, row by row: rows, first columns and ends of runs, `[M]` each."""
    edged: UInt8Array = cv2.copyMakeBorder(mask, 0, 0, 1, 1, cv2.BORDER_CONSTANT, value=0).reshape(-1)
    flips = np.flatnonzero(edged[1:] != edged[:-1])
    row, start = np.divmod(flips[::2], mask.shape[1] + 2)
    return row, start, start + flips[1::2] - flips[::2]


def straight(cv2: Any, mask: UInt8Array, length: int) -> UInt8Array:
    """Return the straight lines of a mask: its openings with a row and with a column of `length`, which is odd.

    As with OpenCV, a line of which half is outside of the picture counts.
    """
    across: UInt8Array = cv2.transpose(_opened(cv2.transpose(mask), length))
    return cv2.max(across, _opened(mask, length))


def _opened(mask: UInt8Array, length: int) -> UInt8Array:
    """Return the opening with a column, eight pixels a byte."""
    half = ((length // 2, length // 2), (0, 0))
    inner = _folded(np.bitwise_and, np.pad(np.packbits(mask, axis=1), half, constant_values=255), length)
    if not inner.any():
        return np.zeros_like(mask)
    opened = _folded(np.bitwise_or, np.pad(inner, half), length)
    return np.unpackbits(opened, axis=1, count=mask.shape[1]) * np.uint8(255)


def _folded(fold: Callable[..., UInt8Array], rows: UInt8Array, length: int) -> UInt8Array:
    """Fold each row with the `length - 1` below it, in steps that double."""
    done = 1
    while done < length:
        step = min(done, length - done)
        rows, done = fold(rows[:-step], rows[step:]), done + step
    return rows
