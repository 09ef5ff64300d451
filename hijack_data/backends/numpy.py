"""NumPy arrays: uint8 `[..., H, W, 3]`."""

from typing import Any

import numpy as np

from ..errors import ParameterError
from ..kernels import Stamp
from ..kernels.cpu import pixels
from ..types import Size, UInt8Array
from .base import Backend


class NumpyBackend(Backend):
    """NumPy arrays of any strides; contiguous ones, in either channel order, are fast."""

    name = "numpy"
    to_uint8 = "(image * 255).round().clip(0, 255).astype(np.uint8)"

    @property
    def module(self) -> Any:
        """The module `numpy`."""
        return np

    def check_writable(self, image: UInt8Array) -> None:
        """See `Backend.check_writable`; NumPy arrays can be read-only.

        Raises:
            ParameterError: the array is read-only, or its pixels share memory.
        """
        if not image.flags.writeable:
            advice = "pass a copy, or inplace=False"
            raise ParameterError(f"inplace=True: the array is read-only; {advice}")
        super().check_writable(image)

    def strides(self, image: UInt8Array) -> tuple[int, ...]:
        """Return the steps in bytes along each axis."""
        return image.strides

    def address(self, image: UInt8Array) -> int:
        """Return the memory address of the array."""
        return int(image.ctypes.data)

    def from_numpy(self, image: UInt8Array) -> UInt8Array:
        """Return the picture itself."""
        return image

    def to_numpy(self, image: UInt8Array) -> UInt8Array:
        """Return the picture itself."""
        return np.asarray(image)

    def empty_like(self, image: UInt8Array) -> UInt8Array:
        """Return a new array of the same shape and memory layout, not filled."""
        return pixels.empty_like(image)

    def paste(self, image: UInt8Array, stamps: list[Stamp]) -> UInt8Array:
        """Stamp sprites into `image`, in order, in place; return it."""
        return pixels.paste(image, stamps)

    def resample(self, image: UInt8Array, size: Size) -> UInt8Array:
        """Return a new picture of `size`, (height, width)."""
        return pixels.resample(image, size)


BACKEND = NumpyBackend()
