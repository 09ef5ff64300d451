"""Write stamps as rows of numbers, the input of the compiled kernel on a GPU.

One row, `COLUMNS` int64, is one layer of one stamp, in the order of drawing:

    top, left, height, width   where it lies, in pixels, wholly inside the picture
    kind                       FILL, INK, INKS, PICTURE or PAINT
    a, a_pitch                 address of a mask uint8 [height, width], elements from row to row
    b, b_pitch                 address of the second mask, or of a picture [height, width, 3];
                               likewise
    a_color, b_color           0xRRGGBB

`FILL` is `a_color` everywhere; `INK` is `a_color` through the mask `a`, `INKS` also `b_color`
through the mask `b`, in one blend; `PICTURE` is the uint8 colours `b`; `PAINT` the uint16 colours *
opacity `b` with the opacity `a`. With `keep = 255 - opacity`, a byte `d` becomes `(t + (t >> 8)) >>
8`, where `t = d * keep + colour * opacity + 128`.
"""

from collections.abc import Callable, Iterable
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from ..drawing.sprite import Color, Layer, Sprite
from .stamps import Stamp

COLUMNS = 11
FILL, INK, INKS, PICTURE, PAINT = range(5)
StampRows: TypeAlias = npt.NDArray[np.int64]
# returns the address of an array, and its pitch in elements
Addressing: TypeAlias = Callable[[npt.NDArray[Any]], tuple[int, int]]


def stamp_rows(
    stamps: Iterable[Stamp], key: object, make: Callable[[Sprite], StampRows]
) -> StampRows:
    """Return the rows `[n, COLUMNS]` of stamps.

    Args:
        stamps: in the order of drawing.
        key: the key under which a sprite caches the result of `make`.
        make: returns the rows of a sprite that lies at (0, 0).
    """
    parts: list[StampRows] = []
    for stamp in stamps:
        scratch = stamp.sprite.scratch
        rows = scratch.get(key)
        if rows is None:
            rows = make(stamp.sprite)
            scratch[key] = rows
        part = rows[None].repeat(len(stamp.ys), axis=0)
        part[:, :, 0] += stamp.ys[:, None]
        part[:, :, 1] += stamp.xs[:, None]
        parts.append(part.reshape(-1, COLUMNS))
    if len(parts) == 1:
        return parts[0]
    return np.concatenate([np.empty((0, COLUMNS), np.int64), *parts])


def sprite_rows(sprite: Sprite, address: Addressing) -> StampRows:
    """Return the rows of a sprite that lies at (0, 0); `address` returns where its arrays are."""
    return np.array([_row(layer, address) for layer in sprite.layers], np.int64)


def _row(layer: Layer, address: Addressing) -> tuple[int, ...]:
    x1, y1, x2, y2 = layer.box
    box = (y1, x1, y2 - y1, x2 - x1)
    nowhere = (0, 0)
    addresses = [address(cover) for cover in layer.covers]
    if layer.picture is None:
        kind = FILL + len(addresses)
        addresses += [nowhere, nowhere]
    else:
        kind = PAINT if addresses else PICTURE
        addresses = [*(addresses or [nowhere]), address(layer.picture)]
    colors = [*map(_pack_color, layer.colors), 0, 0]
    return *box, kind, *addresses[0], *addresses[1], colors[0], colors[1]


def _pack_color(color: Color) -> int:
    red, green, blue = color
    return red << 16 | green << 8 | blue
