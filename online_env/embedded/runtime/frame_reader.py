"""Pictures of a desktop's screen, read where its X server draws them.

They take half the time of a request over HTTP.
"""

import mmap
import os
import socket
import struct
import threading
import time
from typing import Any

import numpy as np

from hijack_data.types import UInt8Array

from ..guest.frame_format import ASK, DONE, FrozenScreen, to_rgb
from . import registry
from .framebuffer import FREEZE_SOCKET

READ_TIMEOUT_S = 5.0
MAX_ANSWER_BYTES = 1 << 20  # bytes of the guest's answer
# X11/XWDFile.h: 25 numbers, most significant byte first.
_HEADER = struct.Struct(">25I")
_COLOUR = 12  # bytes of an entry of the colour map, which lies between header and pixels
_MASKS = (0xFF0000, 0xFF00, 0xFF)
_BAND = 60  # rows that are compared, and converted, together


class FrameReader:
    """The screen of the desktop of `record`; for one thread at a time, the others wait.

    `OSError` or `ValueError` means that the screen cannot be read this way now; ask the guest
    server then.
    """

    def __init__(self, record: dict[str, Any]) -> None:
        self._record = record
        self._lock = threading.Lock()
        self._guest: socket.socket | None = None
        self._pixels: UInt8Array | None = None
        self._copy = _RgbCopy()

    def read(self) -> UInt8Array:
        """Return the screen with the pointer drawn, the picture that the guest server would send.

        Returns:
            uint8 RGB `[H, W, 3]`.

        Raises:
            OSError: The guest does not answer.
            ValueError: The guest answers with something else, or the memory is of another kind.
        """
        with self._lock:
            try:
                return self._take()
            except (OSError, ValueError):
                self._drop()
                raise

    def close(self) -> None:
        """Let go of the guest and the memory."""
        with self._lock:
            self._drop()

    def _take(self) -> UInt8Array:
        """Copy the screen while the guest has frozen it (1 to 4 ms).

        Raises:
            ValueError: The sizes do not fit.
            TimeoutError: It took too long.
        """
        pixels = self._opened_pixels()
        guest = self._opened_guest()
        guest.send(ASK)
        frozen = FrozenScreen.unpack(guest.recv(MAX_ANSWER_BYTES))
        height, width = pixels.shape[:2]
        if not (0 < frozen.width <= width and 0 < frozen.height <= height):
            raise ValueError(
                f"the screen is {frozen.width}x{frozen.height}, its memory {width}x{height}"
            )
        image = self._copy.update(pixels[: frozen.height, : frozen.width])
        if time.monotonic() > frozen.until:
            raise TimeoutError(
                "copying the screen took so long that the guest let it go: it may be two halves"
            )
        guest.send(DONE)
        frozen.pointer.draw(image)
        return image

    def _opened_pixels(self) -> UInt8Array:
        if self._pixels is None:
            keeper = self._record["keeper"][0]
            number = self._record["memory"]
            self._pixels = _pixels(f"/proc/{keeper}/fd/{number}")
        return self._pixels

    def _opened_guest(self) -> socket.socket:
        if self._guest is None:
            self._guest = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            self._guest.settimeout(READ_TIMEOUT_S)
            self._guest.connect(str(registry.folder(self._record["id"]) / FREEZE_SOCKET))
        return self._guest

    def _drop(self) -> None:
        if self._guest is not None:
            self._guest.close()
        self._guest = None
        self._pixels = None


class _RgbCopy:
    """The last picture, so that only what differs from it is converted.

    Most actions change a small part of the screen, and comparing takes a tenth of converting.
    """

    def __init__(self) -> None:
        self._bgrx = np.empty((0, 0, 4), np.uint8)
        self._rgb = np.empty((0, 0, 3), np.uint8)

    def update(self, pixels: UInt8Array) -> UInt8Array:
        """Return pixels in X's order, `[H, W, 4]`, as a new RGB picture `[H, W, 3]`."""
        if pixels.shape != self._bgrx.shape:
            self._bgrx = pixels.copy()
            self._rgb = to_rgb(self._bgrx)
            return self._rgb.copy()
        for top in range(0, len(pixels), _BAND):
            rows = slice(top, top + _BAND)
            band = self._bgrx[rows]
            if not np.array_equal(pixels[rows].view(np.uint32), band.view(np.uint32)):
                band[...] = pixels[rows]
                self._rgb[rows] = to_rgb(band)
        return self._rgb.copy()


def _pixels(path: str) -> UInt8Array:
    """Return the pixels in the memory at `path`: BGRX `[H, W, 4]`.

    Raises:
        ValueError: They lie otherwise.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        memory = mmap.mmap(descriptor, 0, prot=mmap.PROT_READ)
    finally:
        os.close(descriptor)
    fields = _HEADER.unpack_from(memory)
    start = fields[0] + fields[19] * _COLOUR
    height = fields[5]
    bits = fields[11]
    stride = fields[12]
    is_known = bits == 32 and fields[14:17] == _MASKS and stride % 4 == 0 and height > 0
    if not is_known or start + height * stride > len(memory):
        raise ValueError(f"the X server's memory is of another kind: {fields}")
    rows = np.frombuffer(memory, np.uint8, height * stride, start)
    return rows.reshape(height, stride // 4, 4)
