"""A corruption of your own that changes what an agent does. Try it:

hijack check examples/trembling_hand.py
hijack --load examples/trembling_hand.py bench embedded_small --corruptions clean,trembling_hand
"""

from dataclasses import dataclass
from typing import ClassVar

from hijack_data.plugin import Corruption, Draft, InputFault, Scene, Stream, param, register


@register
@dataclass(frozen=True)
class TremblingHand(Corruption):
    """Lets every click and drag land a few pixels off, in a random direction."""

    name: ClassVar[str] = "trembling_hand"
    category: ClassVar[str] = "unexpected_operation"
    scope: ClassVar[str] = "action"
    inputs: ClassVar[tuple[str, ...]] = ("offset",)

    pixels: int = param(6, "Largest shift in pixels, each way", low=1, high=200)

    def make_plan(self, scene: Scene, stream: Stream, step: int) -> Draft:
        """Draw a shift for the next click or drag."""
        dx = stream.integer(1, self.pixels) * (1 - 2 * stream.integer(0, 1))
        dy = stream.integer(-self.pixels, self.pixels)
        return Draft(inputs=(InputFault("offset", ("click", "drag"), dx=dx, dy=dy),))
