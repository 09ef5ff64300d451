"""Its default is out of its own range."""

from dataclasses import dataclass
from typing import ClassVar

from hijack_data.plugin import Corruption, Draft, param, register


@register
@dataclass(frozen=True)
class OutOfRange(Corruption):
    """Draws a line."""

    name: ClassVar[str] = "out_of_range"
    category: ClassVar[str] = "visual_disruptor"
    scope: ClassVar[str] = "observation"

    thickness: int = param(0, "Thickness in pixels", low=1)

    def make_plan(self, scene, stream, step):
        """Nothing."""
        return Draft(notes=("nothing",))
