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

from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from ..drawing.sprite import Color, Layer, Sprite
from ..types import Size
from .stamps import Stamp

COLUMNS = 11
ADDRESSES = [5, 7]  # the columns a and b
FILL, INK, INKS, PICTURE, PAINT = range(5)
# Size (height, width) of the tile of one program of the kernel: small enough that its values fit
# into registers.
PASTE_TILE = (8, 64)
StampRows: TypeAlias = npt.NDArray[np.int64]
# returns the address of an array, and its pitch in elements
Addressing: TypeAlias = Callable[[npt.NDArray[Any]], tuple[int, int]]


def stamp_rows(stamps: Iterable[Stamp], rows: Callable[[Sprite], StampRows]) -> StampRows:
    """Return the rows `[n, COLUMNS]` of stamps.

    Args:
        stamps: in the order of drawing.
        rows: returns the rows of a sprite that lies at (0, 0).
    """
    parts: list[StampRows] = []
    for stamp in stamps:
        part = rows(stamp.sprite)[None].repeat(len(stamp.ys), axis=0)
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


def overlapped_tiles(sizes: list[Size], tables: Sequence[StampRows]) -> npt.NDArray[np.int32]:
    """Return the tiles that the rows of each picture overlap.

    They are int32 `[n, 3]`: picture, and the tile's row and column. All rows are counted at once
    with a summed-area table: four numbers at the corners of each row add one to all of its tiles.
    """
    if not sizes:
        return np.empty((0, 3), np.int32)
    tall, wide = PASTE_TILE
    down = -(-max(height for height, _ in sizes) // tall) + 1
    across = -(-max(width for _, width in sizes) // wide) + 1
    picture = np.repeat(np.arange(len(tables)), [len(table) for table in tables])
    y, x, h, w = np.concatenate(tables)[:, :4].T
    top = y // tall
    bottom = (y + h - 1) // tall + 1
    left = x // wide
    right = (x + w - 1) // wide + 1
    count = np.zeros((len(sizes), down, across), np.int32)
    np.add.at(count, (picture, top, left), 1)
    np.add.at(count, (picture, top, right), -1)
    np.add.at(count, (picture, bottom, left), -1)
    np.add.at(count, (picture, bottom, right), 1)
    np.cumsum(count, axis=1, out=count)
    np.cumsum(count, axis=2, out=count)
    return np.argwhere(count > 0).astype(np.int32)
