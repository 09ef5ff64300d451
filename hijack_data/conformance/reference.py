"""The definition of a plan's pixels: the slow and plain reference for every kernel."""

from typing import Any

import numpy as np
from PIL import Image

from ..drawing.raster import render
from ..plan import Paste, Plan
from ..types import UInt8Array


def reference(plan: Plan, image: UInt8Array) -> UInt8Array:
    """Apply a plan by its definition: stamps in exact integers, and Pillow's own resize."""
    out = image.astype(np.int64)
    for op in plan.ops:
        if isinstance(op, Paste):
            for x, y in op.at:
                _stamp(out, op, x, y)
        else:
            height, width = op.size
            picture = Image.fromarray(out.astype(np.uint8))
            resized = picture.resize((width, height), Image.Resampling.BICUBIC)
            out = np.array(resized).astype(np.int64)
    return out.astype(np.uint8)


def _stamp(out: np.ndarray[Any, Any], op: Paste, x: int, y: int) -> None:
    """Blend one sprite: `d` becomes the nearest integer to `(d * (255 - alpha) + paint) / 255`."""
    sprite = render(op.sprite)
    height, width = sprite.size
    top = max(y, 0)
    left = max(x, 0)
    bottom = min(y + height, out.shape[0])
    right = min(x + width, out.shape[1])
    if top >= bottom or left >= right:
        return
    rows = slice(top - y, bottom - y)
    columns = slice(left - x, right - x)
    alpha = sprite.alpha[rows, columns].astype(np.int64)[..., None]
    paint = sprite.paint[rows, columns].astype(np.int64)
    part = out[top:bottom, left:right]
    blended = part * (255 - alpha) + paint
    part[:] = (2 * blended + 255) // 510
