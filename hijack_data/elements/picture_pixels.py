"""Size and pixels of one picture of any framework."""

from typing import Any, cast

import numpy as np
from PIL import Image

from ..backends import find_backend, to_numpy
from ..errors import ImageError
from ..types import Size, UInt8Array


def image_size(image: object) -> Size:
    """Return `(height, width)` of one picture without reading its pixels.

    Raises `ImageTypeError` for any other kind or dtype.

    `image` is uint8 RGB: `[H, W, 3]` (NumPy, JAX) or `[3, H, W]` (torch); or a PIL image of any
    mode.

    Raises:
        ImageError: the picture has another shape.
    """
    if isinstance(image, Image.Image):
        width, height = image.size
        if not width or not height:
            raise ImageError(f"image is empty: {width} x {height} pixels")
        return height, width
    backend = find_backend(image)
    backend.check(image)
    shape = tuple(cast("Any", image).shape)
    if len(shape) != 3:
        raise ImageError(
            f"image has shape {list(shape)}: elements are found in one picture at a time, not in a"
            " batch"
        )
    return backend.size(image)


def image_pixels(image: object) -> UInt8Array:
    """Return the pixels of one picture as uint8 RGB `[H, W, 3]`.

    Arguments and errors are those of `image_size`.
    """
    image_size(image)
    pixels = np.asarray(image.convert("RGB")) if isinstance(image, Image.Image) else to_numpy(image)
    return np.ascontiguousarray(pixels)
