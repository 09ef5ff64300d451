"""Its registration is refused: a plain field."""

from dataclasses import dataclass
from typing import ClassVar

import hijack_data as hj


@hj.register
@dataclass(frozen=True)
class Plain(hj.Corruption):
    """Draws a line."""

    name: ClassVar[str] = "plain_line"
    category: ClassVar[str] = "visual_disruptor"
    scope: ClassVar[str] = "observation"

    thickness: int = 3

    def make_plan(self, scene, stream, step):
        """Nothing."""
        return hj.Draft(notes=("nothing",))
