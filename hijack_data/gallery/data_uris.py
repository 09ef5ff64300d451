"""Pictures inside the page: scaled for display, compressed, as `data:` addresses."""

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from PIL import Image

from ..types import Size, UInt8Array, size_text

# Lossless up to this size; beyond it (photographs, games) a picture is stored lossily, and text
# still reads well.
LOSSLESS_BYTES = 256 * 1024
# The largest side of a WebP.
WEBP_MAX_SIDE = 16383
QUALITY, SMALL_QUALITY = 90, 60  # of lossy WebP


@dataclass(frozen=True)
class Embedded:
    """One picture of the page.

    Attributes:
        size: the stored `(height, width)` in pixels.
        uri: the picture as a `data:` address.
    """

    size: Size
    uri: str


def scale_for(size: Size, width: int) -> float:
    """Return the factor, at most 1, that makes a picture of `size` (height, width) `width` wide."""
    across = width / size[1]
    down = WEBP_MAX_SIDE / size[0]
    return min(1.0, across, down)


def caption(sizes: Sequence[Size], scale: float) -> str:
    """Return the sizes of the pictures as text, with the scale unless it is 1."""
    different = dict.fromkeys(size_text(size) for size in sizes)
    text = " to ".join(different)
    if scale == 1:
        return text
    return f"{text}, shown at {100 * scale:.0f} %"


def embed(image: UInt8Array, scale: float, *, small: bool = False) -> Embedded:
    """Store uint8 RGB `[H, W, 3]` for display, scaled down by `scale`.

    A picture that is larger than the format allows is scaled down further. `small` stores it
    lossily where that is smaller, for a screen at a fifth of the size.
    """
    height, width = image.shape[:2]
    factor = min(scale, WEBP_MAX_SIDE / max(height, width))
    stored_height = max(1, round(height * factor))
    stored_width = max(1, round(width * factor))
    picture = Image.fromarray(image)
    if (stored_height, stored_width) != (height, width):
        picture = picture.resize((stored_width, stored_height), Image.Resampling.LANCZOS)
    return Embedded((stored_height, stored_width), _uri(picture, small))


def _uri(picture: Image.Image, small: bool) -> str:
    # Method 0 makes files a fifth larger than the other methods, in a sixth of their time.
    data = _webp(picture, lossless=True, method=0)
    if small:
        data = min(data, _webp(picture, quality=SMALL_QUALITY, method=4), key=len)
    elif len(data) > LOSSLESS_BYTES:
        data = _webp(picture, quality=QUALITY, method=4)
    return _address(data)


def _address(data: bytes) -> str:
    return f"data:image/webp;base64,{base64.b64encode(data).decode('ascii')}"


def _webp(picture: Image.Image, **options: Any) -> bytes:
    buffer = io.BytesIO()
    picture.save(buffer, "WEBP", **options)
    return buffer.getvalue()
