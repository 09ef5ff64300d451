"""Stored pictures: PNG with one filter (Up), compressed by ISA-L in independent bands of rows.

The same picture gives the same bytes (for one version of ISA-L). A picture that differs from
another one in some rows reuses the unchanged bands of that picture, and its hash reuses the state
before the first row that differs: see `BaseImage`.
"""

import hashlib
import io
import struct
import warnings
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias, cast

import numpy as np
from PIL import Image

from hijack_data import extras
from hijack_data.errors import ImageTypeError, MissingDependencyError
from hijack_data.kernels import lower
from hijack_data.picture_io import FORMATS, decode_image
from hijack_data.plan import Paste, Plan
from hijack_data.png import assemble, chunk, filtered
from hijack_data.types import UInt8Array

from .png_decoder import decode_png

LEVEL = 2
BAND = 24  # rows; bands of 16 to 64 rows make files of the same size, within 1 %
# bytes; ISA-L handles 16 and fewer in another way, and it needs more than 3 to start its history
HEAD = 8
ADLER = 65521  # RFC 1950
# the zlib header, and an empty final block (RFC 1950, RFC 1951)
_WRAPPER = b"\x78\x01"
_LAST_BLOCK = b"\x03\x00"

Rows: TypeAlias = Sequence[tuple[int, int]]


@dataclass(frozen=True, kw_only=True)
class _Band:
    """Some compressed rows: a whole chunk of the file.

    `adler` and `length` are the Adler-32 and the length of the data in it.
    """

    chunk: bytes
    adler: int
    length: int


class BaseImage:
    """Encodes a picture, uint8 RGB `[H, W, 3]`, and others that differ from it in some rows only.

    Raises:
        ImageTypeError: the picture is not uint8 `[H, W, 3]`.
    """

    def __init__(self, image: UInt8Array) -> None:
        if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
            description = f"{image.dtype} {list(image.shape)}"
            raise ImageTypeError(f"a picture must be uint8 [H, W, 3], got {description}")
        self.image: UInt8Array = np.ascontiguousarray(image)
        self._count = -(-len(image) // BAND)
        self._bands: dict[int, _Band] = {}  # the bands compressed so far
        # the hash state before each band, computed so far
        self._states: list[Any] = [hashlib.sha256()]

    @cached_property
    def png(self) -> bytes:
        """The bytes of the picture's PNG file.

        Raises:
            MissingDependencyError: `isal` is not installed.
        """
        return _file(self.image, [self._band(k) for k in range(self._count)])

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of the RGB bytes, 64 hexadecimal digits."""
        return self._state(self._count).hexdigest()

    def encode_variant(self, picture: UInt8Array, rows: Rows) -> bytes:
        """Return the same bytes as `encode(picture)`, faster.

        `picture`, uint8 `[H, W, 3]`, may differ from this picture in `rows` (first, end) only.
        """
        changed_bands: set[int] = set()
        for first, end in rows:
            last = min(end, len(picture) - 1)
            changed_bands.update(range(first // BAND, last // BAND + 1))

        def band(k: int) -> _Band:
            return _band(picture, k) if k in changed_bands else self._band(k)

        return _file(picture, [band(k) for k in range(self._count)])

    def hash_variant(self, picture: UInt8Array, rows: Rows) -> str:
        """Return the same digest as `pixel_sha256(picture)`, faster; see `encode_variant`."""
        if not rows:
            return self.sha256
        first = min(first for first, _ in rows) // BAND
        state = self._state(first).copy()
        state.update(np.ascontiguousarray(picture[first * BAND :]).data)
        return state.hexdigest()

    def _band(self, k: int) -> _Band:
        if k not in self._bands:
            self._bands[k] = _band(self.image, k)
        return self._bands[k]

    def _state(self, k: int) -> Any:
        """Return the hash state after the bands before band `k`."""
        for top in range((len(self._states) - 1) * BAND, k * BAND, BAND):
            state = self._states[-1].copy()
            state.update(self.image[top : top + BAND].data)
            self._states.append(state)
        return self._states[k]


def encode(image: UInt8Array) -> bytes:
    """Return uint8 RGB `[H, W, 3]` as the bytes of a PNG file.

    Raises:
        ImageTypeError: `image` is not uint8 `[H, W, 3]`.
        MissingDependencyError: `isal` is not installed.
    """
    return BaseImage(image).png


def changed_rows(plan: Plan) -> Rows | None:
    """Return the rows (first, end) that a plan can change, or `None` if it changes the size."""
    rows: list[tuple[int, int]] = []
    for op in plan.ops:
        if not isinstance(op, Paste):
            return None
        for stamp in lower(op, plan.size):
            height = stamp.sprite.size[0]
            rows += [(y, y + height) for y in stamp.ys.tolist()]
    return rows


def decode(data: bytes, name: str) -> UInt8Array:
    """Decode a picture file to uint8 RGB `[H, W, 3]`.

    The result is that of `hijack_data.picture_io.decode_image`, but faster for common PNG files.

    Raises:
        ImageError: the picture, named `name` in the message, is damaged, or its EXIF orientation
            turns it, so that it is unknown whether recorded coordinates refer to the stored or the
            turned picture.
    """
    try:
        image = decode_png(data, _isal())
    except MissingDependencyError:
        image = None
    return decode_image(data, name)[0] if image is None else image


def is_transparent(data: bytes) -> bool:
    """Return whether pixels of a picture file are transparent, so that its colours are hidden.

    The header answers for pictures without an alpha channel; others are decoded.
    """
    with suppress(Exception), warnings.catch_warnings():  # `decode` explains what is damaged
        warnings.simplefilter("ignore")
        image = Image.open(io.BytesIO(data), formats=FORMATS)
        if image.has_transparency_data:
            low, _ = cast("tuple[int, int]", image.convert("RGBA").getchannel("A").getextrema())
            return low < 255
    return False


def _file(image: UInt8Array, bands: Sequence[_Band]) -> bytes:
    tail = _LAST_BLOCK + struct.pack(">I", _adler(bands))
    body = [band.chunk for band in bands]
    height, width, _ = image.shape
    return assemble((height, width), [chunk(b"IDAT", _WRAPPER), *body, chunk(b"IDAT", tail)])


def _band(image: UInt8Array, k: int) -> _Band:
    zlib = _isal()
    bottom = min((k + 1) * BAND, len(image))
    data = filtered(image, k * BAND, bottom).reshape(-1)
    packed = chunk(b"IDAT", deflate(data, zlib))
    return _Band(chunk=packed, adler=zlib.adler32(data), length=data.size)


def deflate(data: UInt8Array, zlib: Any) -> bytes:
    """Return uint8 `[n]` as deflate blocks that end on a byte and refer to no earlier data.

    The first bytes are compressed as a separate block. ISA-L begins a longer block by hashing
    whatever a register happens to hold (the address of its state), so that one stream in some
    thousands would depend on memory addresses. `zlib` is `isal.isal_zlib`.
    """
    squeeze = zlib.compressobj(LEVEL, zlib.DEFLATED, -15)
    head = squeeze.compress(data[:HEAD]) + squeeze.flush(zlib.Z_SYNC_FLUSH)
    return head + squeeze.compress(data[HEAD:]) + squeeze.flush(zlib.Z_FULL_FLUSH)


def _adler(bands: Iterable[_Band]) -> int:
    """Return the Adler-32 of the data of all bands."""
    low = 1
    high = 0
    for band in bands:
        high = (high + (band.adler >> 16) + (low - 1) * band.length) % ADLER
        low = (low + (band.adler & 0xFFFF) - 1) % ADLER
    return high << 16 | low


def _isal() -> Any:
    try:
        from isal import isal_zlib
    except ImportError:
        raise extras.missing("storing pictures needs isal", "hf") from None
    return isal_zlib
