"""Its registration is refused: a plain field."""

from dataclasses import dataclass
from typing import ClassVar

from hijack_data.plugin import Corruption, Draft, register


@register
@dataclass(frozen=True)
class Plain(Corruption):
    """Draws a line."""

    name: ClassVar[str] = "plain_line"
    category: ClassVar[str] = "visual_disruptor"
    scope: ClassVar[str] = "observation"

    thickness: int = 3

    def make_plan(self, scene, stream, step):
        """Nothing."""
        return Draft(notes=("nothing",))
