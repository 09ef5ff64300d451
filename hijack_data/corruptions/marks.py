"""Marks: shapes strewn over the screen, as screensavers and animations leave them.

The paper's Algorithm "Marks".
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ..corruption import Category, Corruption, Draft, Scope, register
from ..geometry import place_disjoint
from ..params import param
from ..plan import Paste
from ..rng import Stream
from ..types import Scene, as_boxes

# The search ends after this many attempts per mark on average; the paper gives no bound.
ATTEMPTS_PER_MARK = 20


@register
@dataclass(frozen=True)
class Marks(Corruption):
    """Strews stars, circles or rectangles over the screen."""

    name: ClassVar[str] = "marks"
    category: ClassVar[Category] = "visual_disruptor"
    scope: ClassVar[Scope] = "observation"
    paper: ClassVar[str] = "Algorithm 3 (Marks)"
    severities: ClassVar[tuple[Mapping[str, Any], ...]] = (
        {"number": 10},
        {"number": 25},
        {},
        {"number": 100},
        {"number": 200},
    )

    number: int = param(50, "The number of marks", low=0, high=100_000)
    mark_size: int = param(20, "Half the side of a mark in pixels", low=1, high=4096)
    mark_type: str = param(
        "star", "The shape of the marks", choices=("star", "circle", "rectangle")
    )
    color: str = param("red", "The colour of the marks", kind="color")
    avoid_elements: bool = param(
        False,
        "Keep clear of interactive elements (the paper's overlap=True is avoid_elements=False)",
    )

    def make_plan(self, scene: Scene, stream: Stream, step: int) -> Draft:
        """Draw centres until `number` marks are placed or the attempts are used up."""
        boxes = scene.obstacles if self.avoid_elements else as_boxes(None)
        attempts = self.number * ATTEMPTS_PER_MARK
        centres, attempts_used = place_disjoint(
            stream, scene.size, self.mark_size, self.number, attempts, boxes
        )
        notes = ()
        if len(centres) < self.number:
            notes = (f"placed {len(centres)} of {self.number} marks in {attempts_used} attempts",)
        if not centres:
            return Draft(notes=notes)
        recipe = {
            "draw": "mark",
            "shape": self.mark_type,
            "size": self.mark_size,
            "color": self.color,
        }
        at = tuple((x - self.mark_size, y - self.mark_size) for x, y in centres)
        return Draft(ops=(Paste(recipe, at),), notes=notes)
