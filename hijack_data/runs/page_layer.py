"""What a picture shows of a plan that a renderer of web pages has drawn: `layer="dom"`.

A renderer rounds its blending differently, and the page may have moved on since the clean picture.
So only those pixels are compared that the plan paints fully.
"""

import numpy as np

from .._apply import apply
from ..plan import Plan
from ..types import Size, UInt8Array

LAYER = "layer"  # the field of a step
MAX_DIFFERENCE = 2  # of a channel, 0..255


def compare_painted(plan: Plan, picture: UInt8Array, area: Size) -> tuple[int, int]:
    """Compare a picture with the pixels that a plan paints fully.

    Args:
        plan: Pastes only.
        picture: uint8 RGB `[H, W, 3]` of the plan's size.
        area: (height, width) of the part of the picture that can show it; a scrollbar cannot.

    Returns:
        The number of these pixels, and the largest difference of a channel, 0..255.
    """
    on_black: UInt8Array = apply(plan, np.zeros((*plan.size, 3), np.uint8))
    on_white: UInt8Array = apply(plan, np.full((*plan.size, 3), 255, np.uint8))
    is_painted = (on_black == on_white).all(axis=2)
    is_painted[area[0] :] = False
    is_painted[:, area[1] :] = False
    if not is_painted.any():
        return 0, 0
    expected = on_black[is_painted].astype(np.int16)
    return int(is_painted.sum()), int(np.abs(picture[is_painted] - expected).max())
