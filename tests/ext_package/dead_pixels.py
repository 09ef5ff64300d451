"""A third-party corruption: dead pixels. One file, registered through an entry point."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hijack_data.plugin import Corruption, Draft, Paste, param, png_recipe, register


@register
@dataclass(frozen=True)
class DeadPixels(Corruption):
    """Burns single-coloured dots into the screen."""

    name: ClassVar[str] = "dead_pixels"
    category: ClassVar[str] = "visual_disruptor"
    scope: ClassVar[str] = "observation"

    number: int = param(20, "How many dots", low=0, high=10_000)
    side: int = param(3, "Side of a dot in pixels", low=1, high=64)
    opacity: int = param(200, "0 is invisible, 255 opaque", low=0, high=255)

    def make_plan(self, scene, stream, step):
        """Draw a place for each dot."""
        height, width = scene.size
        rgba = np.zeros((self.side, self.side, 4), np.uint8)
        rgba[..., 1], rgba[..., 3] = 255, self.opacity
        at = tuple(
            (stream.integer(0, width - 1), stream.integer(0, height - 1))
            for _ in range(self.number)
        )
        return Draft(ops=(Paste(png_recipe(rgba), at),))
