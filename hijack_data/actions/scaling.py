"""The one rule by which coordinates of one space become pixels of another.

A picture of width W spans the positions 0 to W. Pixel i spans i to i + 1, and its point is its
centre, i + 1/2.

* A whole number names a pixel. Its centre is scaled by the ratio of the sides, and the result is
  the pixel in which the scaled centre lies; exactly between two pixels, the left or upper one.
* A fractional number is a position: it scales as it is, and is rounded (halves up) where a pixel is
  wanted.
* The edges of a box of pixels scale and are rounded (halves up), but a box always keeps the pixels
  to which its own pixels map.

So a pixel inside a box maps inside the mapped box, at every scale, and no box becomes empty. Every
dialect and `CoordMap` go through `Scaling`, so no two of them can disagree by a pixel.
"""

import math
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from ..errors import ActionError
from ..geometry import Int64Array
from ..types import SLACK, BoxArray, Size, are_fractions

FloatArray: TypeAlias = npt.NDArray[np.float64]
IntArray: TypeAlias = npt.NDArray[np.int32]

_MAX_COORDINATE = 2.0**40  # beyond any screen; keeps products finite
_MAX_OFFSET = 2.0**31


@dataclass(frozen=True)
class Scaling:
    """A scaling from a space of `source` (height, width) to pixels of `target` (height, width).

    Args:
        source: size of the space of the given numbers: in pixels, (1, 1) for fractions of the
            picture, (1000, 1000) for UI-TARS 1.0.
        target: size in pixels of the picture or screen that the results refer to.
        clamp: keep points inside the target; `False` when its size is not known.
        bounded: refuse points that lie outside the source by more than `SLACK` of its side, because
            they belong to another space or another screen.
        grid: both spaces are grids of pixels. `False` between pixels and fractions: fractions are
            pixel numbers divided by the side of the picture, as recordings and models write them,
            so they map to the nearest pixel.
        recorded: the numbers come from a recording, so fractions of the picture where pixels are
            expected show that the space is wrong, and are refused; the numbers of a live agent are
            rounded instead. Bounded numbers count as recorded.
    """

    source: Size
    target: Size
    clamp: bool = True
    bounded: bool = False
    grid: bool = True
    recorded: bool = False

    @classmethod
    def pixels(cls, size: Size | None) -> "Scaling":
        """Return the identity: pixels are rounded, and clamped if the size is known."""
        if size is None:
            return cls((1, 1), (1, 1), clamp=False, recorded=True)
        return cls(size, size, recorded=True)

    @classmethod
    def fractions(cls, size: Size, unit: int = 1) -> "Scaling":
        """Return the scaling from fractions of the picture: 0..1, or 0..`unit`."""
        return cls((unit, unit), size, bounded=True, grid=False)

    def points(self, values: npt.ArrayLike) -> IntArray:
        """Scale points: `[..., 2]` of x, y, finite -> int32 pixels of the same shape."""
        points = np.asarray(values, np.float64)
        height, width = self.target
        scaled = self._pixels(points, _xy(self.source), (width, height))
        if self.clamp:
            scaled = np.clip(scaled, 0, (width - 1, height - 1))
        return scaled.astype(np.int32)

    def positions(self, values: npt.ArrayLike) -> FloatArray:
        """Scale positions `[..., 2]` of x, y, or edges of boxes `[..., 4]` (xyxy).

        The result is float64, exact and never clamped.
        """
        positions = np.asarray(values, np.float64)
        points = positions.shape[-1] // 2
        target = np.tile(_xy(self.target), points)
        source = np.tile(_xy(self.source), points)
        return positions * target / source

    def boxes(self, boxes: npt.NDArray[np.integer[Any]], clip: bool = True) -> BoxArray:
        """Scale boxes `[N, 4]` of pixels: int32, clipped to the target.

        A box that overlaps the source keeps at least one pixel, and all pixels to which its own
        pixels map. An empty box, and with `clip` a box outside the source, becomes empty.
        """
        pixels = boxes.astype(np.int64)
        low = pixels[:, :2]
        high = pixels[:, 2:]
        source = _xy(self.source)
        target = _xy(self.target)
        first_pixel = _centres(low, source, target)
        last_pixel = _centres(high - 1, source, target)
        first = np.minimum(_rounded(low, source, target), first_pixel)
        last = np.maximum(_rounded(high, source, target), last_pixel + 1)
        last = np.where(high > low, last, first)
        edges = np.concatenate([first, last], axis=1)
        if clip:
            edges = np.clip(edges, 0, np.tile(target, 2))
        return edges.astype(np.int32)

    def x(self, value: float) -> int:
        """Scale one x coordinate to a pixel.

        Raises:
            ActionError: the coordinate is not finite, or lies outside a bounded source.
        """
        return self._coordinate(value, axis=1)

    def y(self, value: float) -> int:
        """Scale one y coordinate to a pixel.

        Raises:
            ActionError: the coordinate is not finite, or lies outside a bounded source.
        """
        return self._coordinate(value, axis=0)

    def dx(self, value: float) -> int:
        """Scale a horizontal offset.

        The sign is kept (halves round away from zero), and nothing is clamped.
        """
        return self._offset(value, axis=1)

    def dy(self, value: float) -> int:
        """Scale a vertical offset, as `dx`."""
        return self._offset(value, axis=0)

    def point(self, x: float, y: float) -> tuple[int, int]:
        """Scale one point of an action to a pixel.

        Raises:
            ActionError: a number is not finite, lies outside a bounded source, or is a fraction
                where pixels are expected.
        """
        self.check_point(x, y)
        return self.x(x), self.y(y)

    def check_point(self, *numbers: float) -> None:
        """Check that recorded numbers are not fractions where another unit is expected.

        Raises:
            ActionError: the numbers are fractions.
        """
        if not are_fractions(numbers) or not (self.recorded or self.bounded):
            return
        if not self.grid:
            unit = self.source[0]
            if self.source == (1, 1):
                return
            raise ActionError(f"{numbers} are fractions 0..1; this dialect uses 0..{unit}")
        raise ActionError(
            f"{numbers} are fractions of the picture, not pixels; multiply x by its width and y by"
            " its height"
        )

    def check(self, value: float, axis: int) -> None:
        """Check that a coordinate is finite and, in a bounded source, inside it.

        `axis` is 0 for y and 1 for x.

        Raises:
            ActionError: the coordinate is not finite, or outside a bounded source.
        """
        if not math.isfinite(value):
            raise ActionError(
                f"coordinate {value!r} is not a finite number; give pixels such as 100"
            )
        side = self.source[axis]
        if not self.bounded or -SLACK * side <= value <= side * (1 + SLACK):
            return
        if self.grid:
            name = "height" if axis == 0 else "width"
            raise ActionError(
                f"coordinate {value!r} is outside the picture, whose {name} is {side} pixels"
            )
        if value < 0:
            raise ActionError(f"coordinate {value!r} is negative; the picture spans 0 to {side}")
        raise ActionError(
            f"coordinate {value!r} is outside the 0 to {side} that this dialect uses; is it in"
            " pixels already?"
        )

    def _coordinate(self, value: float, axis: int) -> int:
        self.check(value, axis)
        side = self.target[axis]
        number = np.asarray(value, np.float64)
        pixel = int(self._pixels(number, self.source[axis], side))
        if not self.clamp:
            return pixel
        return max(0, min(pixel, side - 1))

    def _offset(self, value: float, axis: int) -> int:
        if not math.isfinite(value):
            raise ActionError(f"offset {value!r} is not a finite number; give pixels such as 100")
        if not self.grid:  # in fractions, the side of the picture is the longest offset
            self.check(abs(value), axis)
        if abs(value) > _MAX_OFFSET:
            raise ActionError(
                f"offset {value!r} is beyond 2**31 pixels; give a distance that a screen can hold"
            )
        exact = abs(value) * self.target[axis] / self.source[axis]
        distance = math.floor(exact + 0.5)
        return -distance if value < 0 else distance

    def _pixels(
        self, values: FloatArray, source: npt.ArrayLike, target: npt.ArrayLike
    ) -> Int64Array:
        """Return the pixels of the target to which numbers of the source map."""
        near = np.clip(values, -_MAX_COORDINATE, _MAX_COORDINATE)
        source_sides = np.asarray(source, np.int64)
        target_sides = np.asarray(target, np.int64)
        exact = near * target_sides / source_sides
        rounded = np.floor(exact + 0.5).astype(np.int64)
        if not self.grid:
            return rounded
        floor = np.floor(near)
        centres = _centres(floor.astype(np.int64), source_sides, target_sides)
        return np.where(near == floor, centres, rounded)


def _xy(size: Size) -> Int64Array:
    """Return (height, width) as x, y."""
    height, width = size
    return np.array([width, height], np.int64)


def _rounded(edges: Int64Array, source: Int64Array, target: Int64Array) -> Int64Array:
    """Return scaled edges, halves rounded up."""
    return (2 * edges * target + source) // (2 * source)


def _centres(pixels: Int64Array, source: Int64Array, target: Int64Array) -> Int64Array:
    """Return the pixels of the target in which the centres of pixels of the source lie.

    The arithmetic is in integers, because products of floats would put some centres on the wrong
    side of an edge.
    """
    return -(-(2 * pixels + 1) * target // (2 * source)) - 1
