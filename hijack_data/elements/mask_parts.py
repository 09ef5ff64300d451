"""The connected parts and the straight lines of a mask, a uint8 picture `[H, W]` of 0 and 255.

Screens are mostly flat: many rows repeat the row above, and few pixels differ from the pixel
before. Using both facts takes about a third of the time of OpenCV's statistics and openings, which
visit every pixel; the results are the same.
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
        mask: uint8 `[H, W]`, 0 in the background and the same number everywhere else.
        connectivity: 4, or 8 for parts that may hang together by corners.

    Attributes:
        x, y, w, h: the box of each part, intp `[N]`, in pixels.
        area: the number of its pixels, intp `[N]`.
    """

    def __init__(self, cv2: Any, mask: UInt8Array, connectivity: int) -> None:
        packed = np.packbits(mask, axis=1)
        changes = (packed[1:] != packed[:-1]).any(axis=1)
        is_new = np.concatenate([[True], changes])
        # A run of equal rows is represented by its first row.
        self._row: Ints = np.cumsum(is_new) - 1
        self._first: Ints = np.flatnonzero(is_new)
        self._mask: UInt8Array = mask[self._first]
        count, labels = cv2.connectedComponents(self._mask, connectivity=connectivity)
        self._labels = labels
        self._runs = _runs(cv2, self._mask)
        row, start, _ = self._runs
        self._part: Ints = labels[row, start].astype(np.intp) - 1  # of each run
        self._measure(count - 1)

    def _measure(self, count: int) -> None:
        row, start, end = self._runs
        height = np.bincount(self._row)
        first = self._first
        last = first + height
        left = np.full(count, self._mask.shape[1])
        right = np.zeros(count, np.intp)
        top = np.full(count, len(self._row))
        bottom = np.zeros(count, np.intp)
        np.minimum.at(left, self._part, start)
        np.maximum.at(right, self._part, end)
        np.minimum.at(top, self._part, first[row])
        np.maximum.at(bottom, self._part, last[row])
        self.x = left
        self.y = top
        self.w = right - left
        self.h = bottom - top
        self.area = np.zeros(count, np.intp)
        np.add.at(self.area, self._part, (end - start) * height[row])

    def without(self, unwanted: Bools) -> UInt8Array:
        """Return the mask without some of its parts; `unwanted` is bool `[N]`."""
        drop = unwanted[self._part]
        row, start, end = self._runs
        mask = self._mask.copy()
        width = mask.shape[1]
        begin = row[drop] * width + start[drop]
        length = end[drop] - start[drop]
        # The indices of all pixels of the runs: those of the first run, of the second, ...
        before = np.cumsum(length) - length
        within: Ints = np.arange(int(length.sum()))
        pixels: Ints = np.repeat(begin - before, length) + within
        mask.reshape(-1)[pixels] = 0
        return mask[self._row]

    def touching(self, mask: UInt8Array) -> Bools:
        """Return which parts share a pixel with another mask, uint8 `[H, W]`: bool `[N]`."""
        pixels = np.flatnonzero(mask != 0)
        row, column = np.divmod(pixels, mask.shape[1])
        labels = self._labels[self._row[row], column]
        counts = np.bincount(labels, minlength=len(self.x) + 1)
        return counts[1:] > 0


def _runs(cv2: Any, mask: UInt8Array) -> tuple[Ints, Ints, Ints]:
    """Return the runs of set pixels, row by row: rows, first columns and ends, `[M]` each."""
    padded = cv2.copyMakeBorder(mask, 0, 0, 1, 1, cv2.BORDER_CONSTANT, value=0)
    edged: UInt8Array = padded.reshape(-1)
    flips = np.flatnonzero(edged[1:] != edged[:-1])
    begins = flips[::2]
    ends = flips[1::2]
    row, start = np.divmod(begins, mask.shape[1] + 2)
    return row, start, start + ends - begins


def straight_lines(cv2: Any, mask: UInt8Array, length: int) -> UInt8Array:
    """Return the straight lines of a mask: its openings with a row and a column of `length`.

    The length is odd. As with OpenCV, a line counts even if half of it is outside the picture.
    """
    columns = _open_columns(mask, length)
    rows = _open_columns(cv2.transpose(mask), length)
    across: UInt8Array = cv2.transpose(rows)
    return cv2.max(across, columns)


def _open_columns(mask: UInt8Array, length: int) -> UInt8Array:
    """Return the opening with a column, computed on eight pixels per byte."""
    half = length // 2
    margin = ((half, half), (0, 0))
    packed = np.packbits(mask, axis=1)
    padded = np.pad(packed, margin, constant_values=255)
    inner = _fold_rows(np.bitwise_and, padded, length)
    if not inner.any():
        return np.zeros_like(mask)
    opened = _fold_rows(np.bitwise_or, np.pad(inner, margin), length)
    bits = np.unpackbits(opened, axis=1, count=mask.shape[1])
    return bits * np.uint8(255)


def _fold_rows(fold: Callable[..., UInt8Array], rows: UInt8Array, length: int) -> UInt8Array:
    """Fold each row with the `length - 1` rows below it, in doubling steps."""
    done = 1
    while done < length:
        step = min(done, length - done)
        rows = fold(rows[:-step], rows[step:])
        done += step
    return rows
