"""The size to which the image processor of Qwen2.5-VL and similar models resizes a picture."""

import math

from .errors import ParameterError
from .types import Size

# Limits of the image processor that Qwen2.5-VL ships with, and the aspect ratio that it refuses.
FACTOR = 28
MIN_PIXELS = 4 * 28 * 28
MAX_PIXELS = 16384 * 28 * 28
MAX_ASPECT = 200


def smart_resize(
    height: int,
    width: int,
    factor: int = FACTOR,
    min_pixels: int = MIN_PIXELS,
    max_pixels: int = MAX_PIXELS,
) -> Size:
    """Return the (height, width) of the picture that Qwen2.5-VL sees for a picture of this size.

    Its image processor makes both sides multiples of `factor` (28) and keeps their product within
    `min_pixels`..`max_pixels`: 1080x1920 becomes 1092x1932.

    Raises:
        ParameterError: a side is below 1, the aspect ratio is above 200, which the processor
            refuses, or the limits leave no size.
    """
    too_small = min(height, width, factor, min_pixels) < 1
    if too_small or max_pixels < max(min_pixels, factor * factor):
        raise ParameterError(
            f"smart_resize({height}, {width}, factor={factor}, min_pixels={min_pixels},"
            f" max_pixels={max_pixels}): sides, factor and min_pixels must be at least 1,"
            " max_pixels at least min_pixels and factor squared"
        )
    if max(height, width) > MAX_ASPECT * min(height, width):
        raise ParameterError(
            f"a picture of {height}x{width} is longer than {MAX_ASPECT} times its width; crop it"
            " first"
        )
    sides = [max(factor, round(side / factor) * factor) for side in (height, width)]
    if math.prod(sides) > max_pixels:
        shrink = math.sqrt(height * width / max_pixels)
        sides = [
            max(factor, math.floor(side / shrink / factor) * factor) for side in (height, width)
        ]
    elif math.prod(sides) < min_pixels:
        grow = math.sqrt(min_pixels / (height * width))
        sides = [math.ceil(side * grow / factor) * factor for side in (height, width)]
    return sides[0], sides[1]
