"""Read PNG files of screenshots: ISA-L inflates them, Numba (extra `fast`) undoes their filters.

Only common, undamaged files are read here: 8 bits, RGB or RGBA, one frame, not interlaced, no EXIF,
every checksum right. `read` returns `None` for any other file, which Pillow then reads or explains.
The pixels are the same as Pillow's, in a third of its time (and half of OpenCV's); transparency is
dropped, as in Pillow's conversion to RGB. The first pictures of a process are left to Pillow, until
what Numba would have saved is more than it takes to load.
"""

import struct
import warnings
from collections.abc import Callable
from typing import Any, TypeAlias, cast

import numpy as np
from PIL import ExifTags, Image

from hijack_data.kernels.cpu import jit
from hijack_data.limits import PICTURE_PIXELS
from hijack_data.png import SIGNATURE, UP
from hijack_data.types import UInt8Array

Chunk: TypeAlias = tuple[bytes, memoryview]  # name and body

NONE, SUB, _, AVERAGE, PAETH = range(5)
CHANNELS = {2: 3, 6: 4}  # by colour type (PNG specification, IHDR)
SAVES = 28 / (1080 * 1920)  # milliseconds a pixel, of Pillow's time
ANIMATION = b"acTL"
UPRIGHT = 1
# Chunks that may hold an orientation: one of their own, as macOS writes it, or texts.
EXIF = b"eXIf"
TEXTS = (b"tEXt", b"zTXt", b"iTXt")
RAW_EXIF = b"Raw profile type "
XMP = b"XML:com.adobe.xmp\0"
PLAIN = b"\0\0"


def read(data: bytes, zlib: Any) -> UInt8Array | None:
    """Return the pixels of a PNG file, uint8 RGB `[H, W, 3]`.

    Returns `None` for a file that this reader does not support. `zlib` is the module
    `isal.isal_zlib`.
    """
    chunks = _chunks(data, zlib.crc32)
    if chunks is None or len(chunks[0][1]) != 13:
        return None
    if any(_may_turn(name, body) for name, body in chunks):
        return None
    width, height, depth, colour, *rest = struct.unpack(">II5B", chunks[0][1])
    if depth != 8 or colour not in CHANNELS or rest != [0, 0, 0]:
        return None
    if not 0 < width * height <= PICTURE_PIXELS:
        return None
    line = 1 + CHANNELS[colour] * width
    packed = b"".join(body for name, body in chunks if name == b"IDAT")
    raw = _inflated(packed, height * line, zlib)
    if raw is None:
        return None
    return _unfiltered(raw.reshape(height, line), width)


def _chunks(data: bytes, crc32: Callable[..., int]) -> list[Chunk] | None:
    """Return the chunks from IHDR to IEND, or `None` if one is damaged or the PNG is animated."""
    at = len(SIGNATURE)
    if data[:at] != SIGNATURE or data[at + 4 : at + 8] != b"IHDR":
        return None
    view = memoryview(data)
    found: list[Chunk] = []
    while at + 12 <= len(data):
        (size,) = cast("tuple[int]", struct.unpack_from(">I", data, at))
        end = at + 12 + size
        name = data[at + 4 : at + 8]
        body = view[at + 8 : at + 8 + size]
        if name == ANIMATION or end > len(data):
            return None
        if crc32(body, crc32(name)) != int.from_bytes(data[end - 4 : end], "big"):
            return None
        found.append((name, body))
        if name == b"IEND":
            return found
        at = end
    return None


def _may_turn(name: bytes, body: memoryview) -> bool:
    """Return whether a chunk may hold an EXIF orientation."""
    if name == EXIF:
        return _orientation(bytes(body)) != UPRIGHT
    if name not in TEXTS:
        return False
    text = bytes(body)
    if text.startswith(XMP):  # two zero bytes follow, unless the text is compressed
        return b"tiff:Orientation" in text or not text.startswith(XMP + PLAIN)
    return text.startswith(RAW_EXIF)


def _orientation(data: bytes) -> object:
    """Return the orientation in EXIF data: `UPRIGHT` if there is none, `None` if it is damaged."""
    exif = Image.Exif()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the exceptions of Pillow for damaged data
            exif.load(b"Exif\0\0" + data)
            return exif.get(ExifTags.Base.Orientation, UPRIGHT)
    except (ValueError, SyntaxError, struct.error, OSError, LookupError, TypeError):
        return None


def _inflated(packed: bytes, length: int, zlib: Any) -> UInt8Array | None:
    unpack = zlib.decompressobj()
    try:
        raw = unpack.decompress(packed, length + 1)
    except zlib.error:
        return None
    if len(raw) != length or not unpack.eof:
        return None
    return np.frombuffer(raw, np.uint8)


def _unfiltered(raw: UInt8Array, width: int) -> UInt8Array | None:
    kinds = raw[:, 0]
    if raw.shape[1] == 1 + 3 * width and (kinds == UP).all():
        return _summed(raw)
    if kinds.max() > PAETH or not jit.worthwhile(SAVES * len(raw) * width):
        return None
    out = np.empty((len(raw), width, 3), np.uint8)

    def compiled() -> UInt8Array:
        _kernel()(raw, out)
        return out

    return jit.call_with_fallback(compiled, lambda: None)


def _summed(raw: UInt8Array) -> UInt8Array:
    """Undo filter Up in every row with NumPy, which is enough for our own files."""
    out = np.empty((raw.shape[0], raw.shape[1] - 1), np.uint8)
    out[0] = raw[0, 1:]
    for y in range(1, len(out)):
        np.add(out[y - 1], raw[y, 1:], out=out[y])
    return out.reshape(len(out), -1, 3)


@jit.compiled_on_first_use("the compiled PNG reader")
def _kernel(numba: Any) -> Callable[[UInt8Array, UInt8Array], None]:
    """Compile `_unfilter`, or load it from Numba's cache on disk."""
    t: Any = numba.types
    raw = t.Array(t.uint8, 2, "C", readonly=True)
    out = t.Array(t.uint8, 3, "C")
    return jit.compile_now(numba.njit, _unfilter, t.void(raw, out))


def _unfilter(raw: UInt8Array, out: UInt8Array) -> None:
    """Undo the filters (PNG specification, "Filtering") of `raw` `[H, 1 + C W]` into `out`.

    `out` is `[H, W, 3]`. A filter never mixes channels, so a fourth channel is skipped. One loop
    for each filter, with the pixel to the left kept in registers, takes half the time of one loop
    for all filters.
    """

    def paeth(left: Any, up: Any, corner: Any) -> Any:
        to_left = up - corner
        to_up = left - corner
        to_corner = abs(to_left + to_up)
        to_left = abs(to_left)
        to_up = abs(to_up)
        other = up if to_up <= to_corner else corner
        return left if to_left <= to_up and to_left <= to_corner else other

    height, width, _ = out.shape
    first = np.zeros((width, 3), np.uint8)
    for y in range(height):
        kind = raw[y, 0]
        now = out[y]
        up = out[y - 1] if y else first
        line = raw[y, 1:].reshape(width, (raw.shape[1] - 1) // width)
        r = g = b = r1 = g1 = b1 = np.int32(0)  # the pixel to the left, and the one above it
        if kind == 0:
            for x in range(width):
                now[x, 0] = line[x, 0]
                now[x, 1] = line[x, 1]
                now[x, 2] = line[x, 2]
        elif kind == 1:
            for x in range(width):
                r = (r + line[x, 0]) & 255
                g = (g + line[x, 1]) & 255
                b = (b + line[x, 2]) & 255
                now[x, 0] = r
                now[x, 1] = g
                now[x, 2] = b
        elif kind == 2:
            for x in range(width):
                now[x, 0] = line[x, 0] + up[x, 0]
                now[x, 1] = line[x, 1] + up[x, 1]
                now[x, 2] = line[x, 2] + up[x, 2]
        elif kind == 3:
            for x in range(width):
                r = (((r + up[x, 0]) >> 1) + line[x, 0]) & 255
                g = (((g + up[x, 1]) >> 1) + line[x, 1]) & 255
                b = (((b + up[x, 2]) >> 1) + line[x, 2]) & 255
                now[x, 0] = r
                now[x, 1] = g
                now[x, 2] = b
        else:
            for x in range(width):
                r2 = np.int32(up[x, 0])
                g2 = np.int32(up[x, 1])
                b2 = np.int32(up[x, 2])
                r = (line[x, 0] + paeth(r, r2, r1)) & np.int32(255)
                g = (line[x, 1] + paeth(g, g2, g1)) & np.int32(255)
                b = (line[x, 2] + paeth(b, b2, b1)) & np.int32(255)
                now[x, 0] = r
                now[x, 1] = g
                now[x, 2] = b
                r1 = r2
                g1 = g2
                b1 = b2
