"""Write PNG files fast: filter Up in NumPy, and a quick deflate (PNG specification, 5 and 9).

`encode` is for short-lived pictures, such as the frames of a live desktop; `pipelines` assembles
the PNG files of datasets from the same functions, in bands of rows.
"""

import struct
import zlib
from collections.abc import Iterable
from functools import cache
from typing import Any

import numpy as np

from .types import Size, UInt8Array

SIGNATURE = b"\x89PNG\r\n\x1a\n"
UP = 2  # the filter type: differences to the row above
# bit depth, colour type, compression, filter method, interlace (PNG specification, IHDR)
RGB_8_BIT = (8, 2, 0, 0, 0)
LEVEL = 1


@cache
def fastest_zlib() -> Any:
    """Return `isal.isal_zlib`, or the standard library's `zlib` without it.

    A process that cannot import modules later, such as a desktop's guest server, calls it at the
    start.
    """
    try:
        from isal import isal_zlib
    except ImportError:
        return zlib
    return isal_zlib


def encode(image: UInt8Array) -> bytes:
    """Return `image`, uint8 RGB `[H, W, 3]`, as a PNG file.

    The bytes depend on whether `isal` is installed; the pixels do not.
    """
    height, width, _ = image.shape
    data = fastest_zlib().compress(filtered(image, 0, height).data.cast("B"), LEVEL)
    return assemble((height, width), [chunk(b"IDAT", data)])


def filtered(image: UInt8Array, top: int, bottom: int) -> UInt8Array:
    """Return rows `top` to `bottom` as differences to the row above, uint8 `[n, 1 + 3 W]`.

    Each row begins with its filter type.
    """
    rows = image.reshape(image.shape[0], -1)
    out = np.empty((bottom - top, rows.shape[1] + 1), np.uint8)
    out[:, 0] = UP
    if top:
        np.subtract(rows[top:bottom], rows[top - 1 : bottom - 1], out=out[:, 1:])
    else:
        out[0, 1:] = rows[0]
        np.subtract(rows[1:bottom], rows[: bottom - 1], out=out[1:, 1:])
    return out


def assemble(size: Size, body: Iterable[bytes]) -> bytes:
    """Return the PNG file of a picture of `size` (height, width); `body` is its IDAT chunks."""
    height, width = size
    header = struct.pack(">II5B", width, height, *RGB_8_BIT)
    return SIGNATURE + b"".join((chunk(b"IHDR", header), *body, chunk(b"IEND", b"")))


def chunk(kind: bytes, data: bytes) -> bytes:
    """Return a chunk of a PNG file: length, kind, data and checksum."""
    checksum = fastest_zlib().crc32(data, zlib.crc32(kind))
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", checksum)
