"""A plug-in that works, beside those that don't."""

from dataclasses import dataclass
from typing import ClassVar

from hijack_data.plugin import Corruption, Draft, Paste, register


@register
@dataclass(frozen=True)
class Whole(Corruption):
    """Draws a blue disc."""

    name: ClassVar[str] = "whole"
    category: ClassVar[str] = "visual_disruptor"
    scope: ClassVar[str] = "observation"

    def make_plan(self, scene, stream, step):
        """In the corner."""
        recipe = {"draw": "mark", "shape": "circle", "size": 20, "color": "blue"}
        return Draft(ops=(Paste(recipe, ((0, 0),)),))
