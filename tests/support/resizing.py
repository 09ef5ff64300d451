"""Pillow's resizing, to which ours is compared."""

import numpy as np
import PIL
from PIL import Image


def resize_with_pillow(image: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """The bytes of Pillow 13, which has its own order of passes for tall pictures."""
    source = Image.fromarray(np.ascontiguousarray(image))
    h, w = size
    if int(PIL.__version__.split(".")[0]) < 13 and image.shape[0] - h > max(
        0, 2 * (image.shape[1] - w)
    ):
        source = source.resize((image.shape[1], h), Image.Resampling.BICUBIC)
    return np.asarray(source.resize((w, h), Image.Resampling.BICUBIC))
