"""Pictures inside the page: scaled for display, compressed, as `data:` addresses."""

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from PIL import Image, features

from ..types import Size, UInt8Array, size_text

# Lossless up to this size; beyond it (photographs, games) a picture is stored lossily, and text
# still reads well.
LOSSLESS_BYTES = 256 * 1024
# The largest side of a WebP.
MAX_SIDE = 16383
# Method 0 makes files a fifth larger than the other methods, in a sixth of their time.
_WEBP: tuple[tuple[str, dict[str, Any]], ...] = (
    ("WEBP", {"lossless": True, "method": 0}),
    ("WEBP", {"quality": 90, "method": 4}),
)
_PLAIN: tuple[tuple[str, dict[str, Any]], ...] = (
    ("PNG", {}),
    ("JPEG", {"quality": 90, "subsampling": 0}),
)


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
    down = MAX_SIDE / size[0]
    return min(1.0, across, down)


def caption(sizes: Sequence[Size], scale: float) -> str:
    """Return the sizes of the pictures as text, with the scale unless it is 1."""
    different = dict.fromkeys(size_text(size) for size in sizes)
    text = " to ".join(different)
    if scale == 1:
        return text
    return f"{text}, shown at {100 * scale:.0f} %"


def embed(image: UInt8Array, scale: float) -> Embedded:
    """Store uint8 RGB `[H, W, 3]` for display, scaled down by `scale`.

    A picture that is larger than the format allows is scaled down further.
    """
    height, width = image.shape[:2]
    factor = min(scale, MAX_SIDE / max(height, width))
    stored_height = max(1, round(height * factor))
    stored_width = max(1, round(width * factor))
    picture = Image.fromarray(image)
    if (stored_height, stored_width) != (height, width):
        picture = picture.resize((stored_width, stored_height), Image.Resampling.LANCZOS)
    return Embedded((stored_height, stored_width), _uri(picture))


def _uri(picture: Image.Image) -> str:
    exact, small = _WEBP if features.check("webp") else _PLAIN
    kind, options = exact
    data = _encode(picture, kind, options)
    if len(data) > LOSSLESS_BYTES:
        kind, options = small
        data = _encode(picture, kind, options)
    text = base64.b64encode(data).decode("ascii")
    return f"data:image/{kind.lower()};base64,{text}"


def _encode(picture: Image.Image, kind: str, options: dict[str, Any]) -> bytes:
    buffer = io.BytesIO()
    picture.save(buffer, kind, **options)
    return buffer.getvalue()
