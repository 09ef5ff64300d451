"""Registers one corruption and raises then."""

from dataclasses import dataclass
from typing import ClassVar

import hijack_data as hj


@hj.register
@dataclass(frozen=True)
class Half(hj.Corruption):
    """Draws nothing."""

    name: ClassVar[str] = "half_done"
    category: ClassVar[str] = "visual_disruptor"
    scope: ClassVar[str] = "observation"

    def make_plan(self, scene, stream, step):
        """Nothing."""
        return hj.Draft(notes=("nothing",))


raise RuntimeError("boom: [the moon]\nis in the wrong house")
