"""A plug-in that works, beside those that don't."""

from dataclasses import dataclass
from typing import ClassVar

import hijack_data as hj


@hj.register
@dataclass(frozen=True)
class Whole(hj.Corruption):
    """Draws a blue disc."""

    name: ClassVar[str] = "whole"
    category: ClassVar[str] = "visual_disruptor"
    scope: ClassVar[str] = "observation"

    def make_plan(self, scene, stream, step):
        """In the corner."""
        recipe = {"draw": "mark", "shape": "circle", "size": 20, "color": "blue"}
        return hj.Draft(ops=(hj.Paste(recipe, ((0, 0),)),))
