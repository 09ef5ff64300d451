"""The picture of a screen from what X gives: pixels in X's order, and the pointer drawn on top.

Used on both sides: by the guest server, and by the machine, which reads an embedded desktop's screen itself.
"""

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

from hijack_data.types import UInt8Array

# What the guest tells of a screen that it holds still (still.py): width, height, end of the hold, then the pointer's
# left, top, width and height; its pixels follow.
_HEAD = struct.Struct("<IIdiiII")


@dataclass(frozen=True)
class Pointer:
    """The pointer's picture: `argb` is uint32 `[h, w]` with alpha multiplied in (XFixes), its corner at (left, top)."""

    left: int
    top: int
    argb: np.ndarray[Any, np.dtype[np.uint32]]

    @classmethod
    def of(cls, cursor: Any) -> "Pointer":
        """From the answer to XFixesGetCursorImage."""
        pixels = np.array(cursor.cursor_image, np.uint32).reshape(cursor.height, cursor.width)
        return cls(cursor.x - cursor.xhot, cursor.y - cursor.yhot, pixels)

    @classmethod
    def none(cls) -> "Pointer":
        """No pointer."""
        return cls(0, 0, np.empty((0, 0), np.uint32))

    def draw(self, image: UInt8Array) -> None:
        """Blend it into `image`, uint8 RGB `[H, W, 3]`, as far as it lies inside."""
        (height, width), (h, w) = image.shape[:2], self.argb.shape
        x1, y1 = max(self.left, 0), max(self.top, 0)
        x2, y2 = min(self.left + w, width), min(self.top + h, height)
        if x2 <= x1 or y2 <= y1:
            return
        argb = self.argb[y1 - self.top : y2 - self.top, x1 - self.left : x2 - self.left, None]
        colour, alpha = argb >> np.array([16, 8, 0], np.uint32) & 255, argb >> 24
        under = image[y1:y2, x1:x2].astype(np.uint32)
        image[y1:y2, x1:x2] = np.minimum(colour + (under * (255 - alpha) + 127) // 255, 255).astype(np.uint8)


@dataclass(frozen=True)
class Held:
    """A screen that is held still: its size in pixels, until when (`time.monotonic`), and the pointer on it."""

    width: int
    height: int
    until: float
    pointer: Pointer

    def pack(self) -> bytes:
        """As one message."""
        p = self.pointer
        h, w = p.argb.shape
        return _HEAD.pack(self.width, self.height, self.until, p.left, p.top, w, h) + p.argb.astype("<u4").tobytes()

    @classmethod
    def unpack(cls, message: bytes) -> "Held":
        """What `pack` made; raises `ValueError` for anything else."""
        if len(message) < _HEAD.size:
            raise ValueError(f"{len(message)} bytes are no description of a screen")
        width, height, until, left, top, w, h = _HEAD.unpack_from(message)
        argb = np.frombuffer(message, "<u4", offset=_HEAD.size).astype(np.uint32, copy=False).reshape(h, w)
        return cls(width, height, until, Pointer(left, top, argb))


def to_rgb(bgrx: UInt8Array) -> UInt8Array:
    """`[H, W, 4]` in X's order as RGB `[H, W, 3]`, a new array."""
    image = np.empty((*bgrx.shape[:2], 3), np.uint8)
    for channel in range(3):  # three strided copies are four times as fast as one with swapped channels
        image[..., channel] = bgrx[..., 2 - channel]
    return image
