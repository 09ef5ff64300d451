"""Pictures of a desktop's screen, read where its X server draws them: half the time of a request over HTTP."""

import mmap
import os
import socket
import struct
import threading
import time
from typing import Any

import numpy as np

from hijack_data.types import UInt8Array

from ...guest.picture import Held, to_rgb
from . import registry
from .framebuffer import DOOR

TIMEOUT = 5.0
MOST = 1 << 20  # bytes of the guest's answer
# X11/XWDFile.h: 25 numbers, most significant byte first.
_HEADER = struct.Struct(">25I")
_COLOUR = 12
_MASKS = (0xFF0000, 0xFF00, 0xFF)


class Frames:
    """The screen of the desktop of `record`; for one thread at a time, the others wait.

    `OSError` or `ValueError` says that the screen cannot be read this way now; the guest server is to be asked then.
    """

    def __init__(self, record: dict[str, Any]) -> None:
        self._record = record
        self._lock = threading.Lock()
        self._line: socket.socket | None = None
        self._pixels: UInt8Array | None = None

    def read(self) -> UInt8Array:
        """The screen with the pointer drawn: uint8 RGB `[H, W, 3]`, the picture that the guest server would send."""
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
        """Copy the screen while the guest holds it still (about 2 ms)."""
        line, pixels = self._opened()
        line.send(b"?")
        held = Held.unpack(line.recv(MOST))
        height, width = pixels.shape[:2]
        if not (0 < held.width <= width and 0 < held.height <= height):
            raise ValueError(f"the screen is {held.width}x{held.height}, its memory {width}x{height}")
        image = to_rgb(pixels[: held.height, : held.width])
        if time.monotonic() > held.until:
            raise TimeoutError("copying the screen took so long that the guest let it go: it may be two halves")
        line.send(b".")
        held.pointer.draw(image)
        return image

    def _opened(self) -> tuple[socket.socket, UInt8Array]:
        if self._pixels is None:
            keeper, number = self._record["keeper"][0], self._record["memory"]
            self._pixels = _pixels(f"/proc/{keeper}/fd/{number}")
        if self._line is None:
            self._line = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            self._line.settimeout(TIMEOUT)
            self._line.connect(str(registry.folder(self._record["id"]) / DOOR))
        return self._line, self._pixels

    def _drop(self) -> None:
        if self._line is not None:
            self._line.close()
        self._line = self._pixels = None


def _pixels(path: str) -> UInt8Array:
    """The pixels in the memory at `path`: BGRX `[H, W, 4]`. Raises `ValueError` where they lie otherwise."""
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        memory = mmap.mmap(descriptor, 0, prot=mmap.PROT_READ)
    finally:
        os.close(descriptor)
    fields = _HEADER.unpack_from(memory)
    start, height, bits, stride = fields[0] + fields[19] * _COLOUR, fields[5], fields[11], fields[12]
    known = bits == 32 and fields[14:17] == _MASKS and stride % 4 == 0 and height > 0
    if not known or start + height * stride > len(memory):
        raise ValueError(f"the X server's memory is of another kind: {fields}")
    return np.frombuffer(memory, np.uint8, height * stride, start).reshape(height, stride // 4, 4)
