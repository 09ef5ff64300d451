"""Stamps as rows of numbers: what compiled kernels, on the CPU and on a GPU, take instead of Python objects.

One row, `COLUMNS` int64, is one layer of one stamp, in the order of drawing:

    top, left, height, width   where it lies, in pixels, wholly inside the picture
    kind                       FILL, INK, INKS, PICTURE or PAINT
    a, a_pitch                 address of a mask uint8 [height, width], elements from row to row
    b, b_pitch                 address of the second mask, or of a picture [height, width, 3]; likewise
    a_color, b_color           0xRRGGBB

`FILL` is `a_color` everywhere; `INK` is `a_color` through the mask `a`, `INKS` also `b_color` through the mask `b`, in
one blend; `PICTURE` is the uint8 colours `b`; `PAINT` the uint16 colours * opacity `b` with the opacity `a`. With
`keep = 255 - opacity`, a byte `d` becomes `(t + (t >> 8)) >> 8`, where `t = d * keep + colour * opacity + 128`.
"""

from collections.abc import Callable, Iterable
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from ..sprite import Color, Layer, Sprite
from . import Stamp

COLUMNS = 11
FILL, INK, INKS, PICTURE, PAINT = range(5)
Rows: TypeAlias = npt.NDArray[np.int64]
Place: TypeAlias = Callable[[npt.NDArray[Any]], tuple[int, int]]  # an array to its address and its pitch in elements


def rows_of(stamps: Iterable[Stamp], key: object, make: Callable[[Sprite], Rows]) -> Rows:
    """Return the rows `[n, COLUMNS]` of stamps. What `make` gives for a sprite at (0, 0) is kept in it under `key`."""
    parts = [np.empty((0, COLUMNS), np.int64)]
    for stamp in stamps:
        made = stamp.sprite.scratch.get(key)
        if made is None:
            made = stamp.sprite.scratch[key] = make(stamp.sprite)
        part = made[None].repeat(len(stamp.ys), axis=0)
        part[:, :, 0] += stamp.ys[:, None]
        part[:, :, 1] += stamp.xs[:, None]
        parts.append(part.reshape(-1, COLUMNS))
    return np.concatenate(parts) if len(parts) != 2 else parts[1]


def rows_of_sprite(sprite: Sprite, place: Place) -> Rows:
    """Return the rows of a sprite that lies at (0, 0); `place` says where its arrays are."""
    return np.array([_row(layer, place) for layer in sprite.layers], np.int64)


def on_host(sprite: Sprite) -> Rows:
    """Return the rows of a sprite at (0, 0) whose arrays are where they are: in this process's memory."""
    return rows_of_sprite(sprite, lambda array: (array.ctypes.data, array.strides[0] // array.itemsize))


def _row(layer: Layer, place: Place) -> tuple[int, ...]:
    (x1, y1, x2, y2), covers, picture = layer.box, layer.covers, layer.picture
    if picture is None:
        kind, arrays = FILL + len(covers), covers
    else:
        kind, arrays = (PAINT, (covers[0], picture)) if covers else (PICTURE, (None, picture))
    places = [(0, 0) if array is None else place(array) for array in arrays]
    a, b = (*places, (0, 0), (0, 0))[:2]
    a_color, b_color = (*map(_packed, layer.colors), 0, 0)[:2]
    return y1, x1, y2 - y1, x2 - x1, kind, *a, *b, a_color, b_color


def _packed(color: Color) -> int:
    return color[0] << 16 | color[1] << 8 | color[2]
