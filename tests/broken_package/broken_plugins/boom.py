"""Registers one corruption and raises then."""

from dataclasses import dataclass
from typing import ClassVar

from hijack_data.plugin import Corruption, Draft, register


@register
@dataclass(frozen=True)
class Half(Corruption):
    """Draws nothing."""

    name: ClassVar[str] = "half_done"
    category: ClassVar[str] = "visual_disruptor"
    scope: ClassVar[str] = "observation"

    def make_plan(self, scene, stream, step):
        """Nothing."""
        return Draft(notes=("nothing",))


raise RuntimeError("boom: [the moon]\nis in the wrong house")
