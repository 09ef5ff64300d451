"""The picture of a screen from what X gives: pixels in X's order, and the pointer drawn on top.

Used on both sides: by the guest server, and by the machine, which reads an embedded desktop's
screen itself.
"""

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

from hijack_data.types import UInt8Array

# The description of a screen that the guest has frozen (freeze.py): width, height, end of the hold,
# then the pointer's left, top, width and height; its pixels follow.
_HEAD = struct.Struct("<IIdiiII")
_CHANNELS = np.array([16, 8, 0], np.uint32)  # where red, green and blue begin, in bits
_ALPHA = 24
_OPAQUE = 255
ASK, DONE = b"?", b"."  # the machine asks for a frozen screen, and has its copy


@dataclass(frozen=True)
class PointerImage:
    """The pointer's picture.

    Attributes:
        left: x of its corner, in pixels of the screen.
        top: y of it.
        argb: uint32 `[h, w]` with alpha multiplied in (XFixes).
    """

    left: int
    top: int
    argb: np.ndarray[Any, np.dtype[np.uint32]]

    @classmethod
    def of(cls, cursor: Any) -> "PointerImage":
        """From the answer to XFixesGetCursorImage."""
        pixels = np.array(cursor.cursor_image, np.uint32)
        argb = pixels.reshape(cursor.height, cursor.width)
        return cls(cursor.x - cursor.xhot, cursor.y - cursor.yhot, argb)

    @classmethod
    def none(cls) -> "PointerImage":
        """No pointer."""
        return cls(0, 0, np.empty((0, 0), np.uint32))

    def draw(self, image: UInt8Array) -> None:
        """Blend it into `image`, uint8 RGB `[H, W, 3]`, as far as it lies inside."""
        height, width = image.shape[:2]
        h, w = self.argb.shape
        x1 = max(self.left, 0)
        y1 = max(self.top, 0)
        x2 = min(self.left + w, width)
        y2 = min(self.top + h, height)
        if x2 <= x1 or y2 <= y1:
            return
        rows = slice(y1 - self.top, y2 - self.top)
        columns = slice(x1 - self.left, x2 - self.left)
        argb = self.argb[rows, columns, None]
        colour = argb >> _CHANNELS & 255
        clear = _OPAQUE - (argb >> _ALPHA)
        part = image[y1:y2, x1:x2]
        under = part.astype(np.uint32) * clear
        blended = colour + (under + _OPAQUE // 2) // _OPAQUE
        part[...] = np.minimum(blended, 255).astype(np.uint8)


@dataclass(frozen=True)
class FrozenScreen:
    """A screen on which nothing is drawn until a certain time.

    Attributes:
        width: in pixels.
        height: in pixels.
        until: when that ends (`time.monotonic`).
        pointer: the pointer on it.
    """

    width: int
    height: int
    until: float
    pointer: PointerImage

    def pack(self) -> bytes:
        """As one message."""
        pointer = self.pointer
        h, w = pointer.argb.shape
        screen = (self.width, self.height, self.until)
        head = _HEAD.pack(*screen, pointer.left, pointer.top, w, h)
        return head + pointer.argb.astype("<u4").tobytes()

    @classmethod
    def unpack(cls, message: bytes) -> "FrozenScreen":
        """Return the screen that `pack` made a message of.

        Raises:
            ValueError: The message is not one of `pack`.
        """
        if len(message) < _HEAD.size:
            raise ValueError(f"{len(message)} bytes are no description of a screen")
        width, height, until, left, top, w, h = _HEAD.unpack_from(message)
        pixels = np.frombuffer(message, "<u4", offset=_HEAD.size)
        argb = pixels.astype(np.uint32, copy=False).reshape(h, w)
        return cls(width, height, until, PointerImage(left, top, argb))


def to_rgb(bgrx: UInt8Array) -> UInt8Array:
    """`[H, W, 4]` in X's order as RGB `[H, W, 3]`, a new array."""
    height, width = bgrx.shape[:2]
    image = np.empty((height, width, 3), np.uint8)
    # three strided copies are four times as fast as one with swapped channels
    for channel in range(3):
        image[..., channel] = bgrx[..., 2 - channel]
    return image
