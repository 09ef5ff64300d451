"""Boxes on a screen: the largest free rectangle, overlaps, and placement of marks between elements.

Boxes are `xyxy`, half-open, in pixels; two boxes overlap when they share at least one pixel, so an
empty box overlaps nothing. Nothing here allocates memory per pixel: the cost depends on the number
of boxes, never on the size of the screen.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from itertools import groupby
from operator import itemgetter
from typing import TypeAlias, cast

import numpy as np
import numpy.typing as npt

from .rng import Stream
from .types import Box, BoxArray, Point, Size, clip_boxes

Int64Array: TypeAlias = npt.NDArray[np.int64]

# A box in the order that a sweep from top to bottom needs: y1, y2, x1, x2.
_Row: TypeAlias = list[int]
# twice as fast as a function; sorting takes a tenth of the time
_lower_edge: "itemgetter[int]" = itemgetter(1)

_EMPTY: Box = (0, 0, 0, 0)
_MAX_BATCH = 256  # attempts checked at once, which bounds memory


def largest_free_rectangle(size: Size, boxes: BoxArray) -> Box:
    """Return the largest rectangle of a screen that overlaps no box.

    This is `find_largest_non_overlapping_box` of Algorithm "Pop-ups". Of several largest rectangles
    it returns the one with the smallest y1, then the smallest x1, then the smallest y2; the order
    of the boxes and repeated boxes do not matter.

    A rectangle that cannot grow hangs from the lower edge of a box or from the top of the screen.
    So each such edge, from top to bottom, is swept downwards once. Time is about n² steps for n
    boxes at worst (each row drops, trims or splits spans, and splits one at most), memory O(n).

    Args:
        size: `(height, width)` in pixels, each at least 1.
        boxes: int32 `[N, 4]`, `xyxy`; may overlap, be empty or leave the screen.

    Returns:
        `(x1, y1, x2, y2)`, inside the screen, or `(0, 0, 0, 0)` when the boxes cover all of it.
    """
    height, width = size
    if not len(boxes):
        return (0, 0, width, height)
    rows = _rows(size, boxes)
    best = 0
    largest = _EMPTY
    for top, group in groupby(sorted(rows, key=_lower_edge), _lower_edge):
        if width * (height - top) <= best:
            break
        ceiling = list(group)
        for row in ceiling:
            del rows[bisect_left(rows, row)]
        best, largest = _sweep_down(top, ceiling, rows, size, best, largest)
    return largest


def _rows(size: Size, boxes: BoxArray) -> list[_Row]:
    """Return the boxes as sorted rows; the edges of the screen are rows without height."""
    height, width = size
    visible = _solid(clip_boxes(boxes, size))
    rows = cast("list[_Row]", visible[:, [1, 3, 0, 2]].tolist())
    return sorted([[0, 0, 0, width], *rows, [height, height, 0, width]])


def _solid(boxes: BoxArray) -> BoxArray:
    """Return the boxes that hold at least one pixel."""
    return boxes[(boxes[:, 2] > boxes[:, 0]) & (boxes[:, 3] > boxes[:, 1])]


def _sweep_down(
    top: int, ceiling: list[_Row], rows: list[_Row], size: Size, best: int, largest: Box
) -> tuple[int, Box]:
    """Return the larger of `largest` and the free rectangles that hang from `ceiling` at `top`.

    The area of `largest` is `best`.
    `rows` are the boxes that reach below `top`, by their upper edges. The free spans between those
    passed so far are `[lefts[i], rights[i])`, in order, so a row meets a run of neighbours. A span
    is dropped when it is beside the ceiling (then it belongs to another ceiling) or too narrow to
    win even if it reached the floor. Of two equal rectangles with the same `left`, the one that
    ends higher is met first and stays.
    """
    height, width = size
    room = height - top
    too_narrow = best // room  # in a tie, the earlier and higher place wins
    _, _, first, last = ceiling[0]
    if len(ceiling) > 1:
        first = min(row[2] for row in ceiling)
        last = max(row[3] for row in ceiling)
    lefts, rights = [0, width], [width]  # a sentinel, at which the walk over a run of spans ends
    for y1, _, x1, x2 in rows:
        i = bisect_right(rights, x1)
        while lefts[i] < x2:
            left = lefts[i]
            right = rights[i]
            area = (right - left) * (y1 - top)
            if area > best or (area == best and largest[1] == top and left < largest[0]):
                best = area
                largest = (left, top, right, y1)
                too_narrow = (best - 1) // room
            keep_right = x2 < last and right - x2 > too_narrow
            if x1 > first and x1 - left > too_narrow:
                rights[i] = x1
                i += 1
                if keep_right:
                    lefts.insert(i, x2)
                    rights.insert(i, right)
                    break
            elif keep_right:
                lefts[i] = x2
                break
            else:
                del lefts[i], rights[i]
        if not rights:
            break
    return best, largest


def intersection_area(box: Box, boxes: BoxArray) -> Int64Array:
    """Return how many pixels `box` shares with each of `boxes` (`[N, 4]`), int64 `[N]`."""
    corners = np.array(box, np.int64)
    sides = np.minimum(corners[2:], boxes[:, 2:]) - np.maximum(corners[:2], boxes[:, :2])
    return np.maximum(sides, 0).prod(axis=1)


def intersection(first: Sequence[int], second: Sequence[int]) -> Box:
    """Return what two overlapping boxes share."""
    return (
        max(first[0], second[0]),
        max(first[1], second[1]),
        min(first[2], second[2]),
        min(first[3], second[3]),
    )


def holds_middle(box: Sequence[int], other: Sequence[int] | None) -> bool:
    """Return whether `box` holds the middle pixel of another box; not if there is no other."""
    if other is None:
        return False
    x = (other[0] + other[2]) // 2
    y = (other[1] + other[3]) // 2
    return box[0] <= x < box[2] and box[1] <= y < box[3]


def free(box: Box, boxes: BoxArray) -> bool:
    """Return whether `box` shares no pixel with any of `boxes` (`[N, 4]`)."""
    return not intersection_area(box, boxes).any()


def place_disjoint(
    stream: Stream, size: Size, half: int, number: int, attempts: int, boxes: BoxArray
) -> tuple[list[Point], int]:
    """Draw centres of marks that cover no box.

    This is Algorithm "Marks", `overlap` False; with no boxes, `overlap` True. Each attempt draws x
    in `[half, width - half]`, then y in `[half, height - half]`, and keeps the centre when the
    square `(x - half, y - half, x + half, y + half)` is free. The search ends with `number` centres
    or after `attempts`. Marks may cover each other, as in the paper.

    Args:
        stream: exactly two integers are drawn from it for each attempt used.
        size: `(height, width)` in pixels.
        half: half the side of a mark in pixels, 0 or more.
        number: centres wanted, 0 or more.
        attempts: attempts allowed, 0 or more.
        boxes: int32 `[N, 4]`, `xyxy`.

    Returns:
        The centres `(x, y)` in the order drawn, and the attempts used; `([], 0)` when the screen is
        too small for one.
    """
    height, width = size
    centres: list[Point] = []
    attempts_used = 0
    if min(width, height) < 2 * half:
        return centres, attempts_used
    # A centre strictly inside one of these would put a pixel of its square on a box.
    barred = _solid(boxes).T.astype(np.int64) + np.array([[-half], [-half], [half], [half]])
    # A batch has only as many attempts as are needed at least, so that the stream ends where it
    # would after drawing them one by one.
    while (batch := min(number - len(centres), attempts - attempts_used, _MAX_BATCH)) > 0:
        candidates = stream.integers([(half, width - half), (half, height - half)], batch)
        free = _outside(candidates, barred) if half else candidates
        centres += [(x, y) for x, y in free.tolist()]
        attempts_used += batch
    return centres, attempts_used


def _outside(points: Int64Array, barred: Int64Array) -> Int64Array:
    """Return the points `[n, 2]`, in order, strictly inside none of `barred`, int64 `[4, N]`."""
    if not barred.size:
        return points
    x, y = points.T[:, :, None]
    x1, y1, x2, y2 = barred
    return points[~((x > x1) & (x < x2) & (y > y1) & (y < y2)).any(axis=1)]
