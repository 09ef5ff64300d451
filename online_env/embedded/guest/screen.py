"""The picture on the screen with the pointer drawn, through shared memory."""

import itertools
import threading
from typing import Any

import mss
import numpy as np
from mss.exception import ScreenShotError
from Xlib import error

from hijack_data.types import UInt8Array

from ...errors import DesktopError
from .display import SharedDisplay
from .frame_format import PointerImage, to_rgb
from .shim.ah_input import Connection


class ScreenCapture:
    """Captures the screen of `display` and counts the frames; safe to use from several threads."""

    def __init__(self, name: str, display: SharedDisplay) -> None:
        self._name = name
        self._display = display
        self._lock = threading.Lock()
        self._grabber: Any = None
        self._numbers = itertools.count(1)
        self.frame_id = 0

    def capture(self) -> tuple[UInt8Array, int]:
        """Capture the screen; after a `DesktopError` the next capture tries again.

        Returns:
            The screen, uint8 RGB `[H, W, 3]`, and the frame's number, counted from 1.
        """
        with self._lock:
            image = to_rgb(self._grab())
            with self._display.use() as connection:
                pointer = read_pointer(connection)
            pointer.draw(image)
            return image, self.count()

    def count(self) -> int:
        """Return the number of a new frame."""
        self.frame_id = number = next(self._numbers)
        return number

    def _grab(self) -> UInt8Array:
        try:
            if self._grabber is None:
                self._grabber = mss.MSS(display=self._name)
            shot = self._grabber.grab(self._grabber.monitors[0])
        except (ScreenShotError, OSError, ValueError) as problem:
            self._drop()
            raise DesktopError(
                f"the screen {self._name} can't be read: {problem}; is its X server still there?"
            ) from None
        return np.frombuffer(shot.raw, np.uint8).reshape(shot.height, shot.width, 4)

    def _drop(self) -> None:
        """Forget the connection: it may be broken, or the screen has another size now."""
        grabber = self._grabber
        self._grabber = None
        if grabber is not None:
            try:
                grabber.close()
            except (ScreenShotError, OSError):
                return


def read_pointer(connection: Connection) -> PointerImage:
    """Return the pointer as it is now; raises the errors that `SharedDisplay.use` handles."""
    try:
        return PointerImage.of(connection.display.xfixes_get_cursor_image(connection.root))
    except error.BadAccess:
        return (
            PointerImage.none()
        )  # X refuses the picture of a pointer whose application has just ended
