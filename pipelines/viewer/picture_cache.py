"""Encoded pictures for the page: made on demand, with a cache bounded in bytes."""

import io
from collections.abc import Callable
from typing import Any

from PIL import Image

from hijack_data.cache import Cache
from hijack_data.types import UInt8Array

from ..dataset.image_codec import encode
from .source import ViewerSource

THUMB = 480
BUDGET = 64 * 2**20


class Pictures:
    """The encoded pictures of a dataset.

    Args:
        source: the dataset.
        budget: the most bytes of encoded pictures that are kept.
    """

    def __init__(self, source: ViewerSource, budget: int = BUDGET) -> None:
        self.source = source
        self.kept = Cache(budget)

    def get(self, kind: str, row: int) -> bytes:
        """Return a `picture`, or the one `before` its corruption, as PNG, or a `thumb` as JPEG.

        Raises `HijackError` if the row has no such picture.
        """
        return cached_bytes(self.kept, (kind, row), lambda: self._make(kind, row))

    def _make(self, kind: str, row: int) -> bytes:
        pixels = self.source.picture(row, kind == "before")
        return encode(pixels) if kind != "thumb" else thumbnail(pixels)


def cached_bytes(kept: Cache, key: Any, make: Callable[[], bytes]) -> bytes:
    """Return the cached value of a key, making it if it is missing."""
    data = kept.get(key)
    if data is None:
        data = make()
        kept.put(key, data, len(data))
    return data


def thumbnail(pixels: UInt8Array, side: int = THUMB) -> bytes:
    """Return uint8 RGB `[H, W, 3]` as a JPEG whose sides are at most `side`."""
    small = Image.fromarray(pixels)
    # a tenth of the time of Lanczos
    small.thumbnail((side, side), Image.Resampling.BOX, reducing_gap=1.0)
    out = io.BytesIO()
    small.save(out, "JPEG", quality=85, subsampling=0)
    return out.getvalue()
