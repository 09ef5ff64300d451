"""Pixel kernels: paste, resample and compare, nothing else.

A backend module works on one picture at a time, in its framework's own layout:

* `paste(image, stamps)` stamps sprites and returns the picture; NumPy and torch write into it, JAX makes a new one.
* `resample(image, size)` returns a new picture, resized as Pillow's bicubic filter does, bit for bit.

The arithmetic is the same everywhere: gather, multiply-add in 32-bit integers, shift, clip.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..plan import Paste
from ..raster import render
from ..sprite import Sprite
from ..types import Size


@dataclass(frozen=True, eq=False)
class Stamp:
    """A sprite and the places (top-left corners, int32 `[n]`) where it lies wholly inside the picture."""

    sprite: Sprite
    ys: npt.NDArray[np.int32]
    xs: npt.NDArray[np.int32]


def lower(op: Paste, size: Size) -> list[Stamp]:
    """Turn a paste into stamps that need no bounds checks: places that stick out get a cropped sprite of their own.

    The order of the places is kept where it can matter.
    """
    sprite = render(op.sprite)
    (height, width), (h, w) = size, sprite.size
    at = np.array(op.at, np.int32).reshape(-1, 2)
    xs, ys = at[:, 0], at[:, 1]
    inside = (xs >= 0) & (ys >= 0) & (xs <= width - w) & (ys <= height - h)
    if inside.all():
        return [Stamp(sprite, ys, xs)]
    if sprite.uniform:
        whole = [Stamp(sprite, ys[inside], xs[inside])]
        return whole + [s for i in np.flatnonzero(~inside) for s in _cropped(sprite, ys[i], xs[i], size)]
    return [s for i in range(len(at)) for s in _cropped(sprite, ys[i], xs[i], size)]


def _cropped(sprite: Sprite, y: np.int32, x: np.int32, size: Size) -> list[Stamp]:
    (height, width), (h, w) = size, sprite.size
    top, left = max(0, -int(y)), max(0, -int(x))
    bottom, right = min(h, height - int(y)), min(w, width - int(x))
    if top >= bottom or left >= right:
        return []
    part = sprite if (top, left, bottom, right) == (0, 0, h, w) else sprite.crop(top, left, bottom, right)
    return [Stamp(part, np.array([y + top], np.int32), np.array([x + left], np.int32))]
