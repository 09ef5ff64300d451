"""Accidental touch: a click that nobody meant.

The paper's Algorithm "Accidental Touch". Its effect on a live machine is
`online_env/effects/accidental_touch.py`, its look in recordings
`pipelines/edits/accidental_touch.py`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ..corruption import Category, Corruption, Draft, Scope, register
from ..geometry import holds_middle
from ..params import Every, Steps, param
from ..plan import Effect
from ..rng import Stream
from ..types import Scene


@register
@dataclass(frozen=True)
class AccidentalTouch(Corruption):
    """Clicks a random interactive element once."""

    name: ClassVar[str] = "accidental_touch"
    version: ClassVar[int] = 2
    category: ClassVar[Category] = "unexpected_operation"
    scope: ClassVar[Scope] = "transition"
    effects: ClassVar[tuple[str, ...]] = ("touch",)
    pictures: ClassVar[tuple[str, ...]] = ("menu", "dialog")
    paper: ClassVar[str] = "Algorithm 6 (Accidental Touch)"
    severities: ClassVar[tuple[Mapping[str, Any], ...]] = (
        {"step": 12},
        {"step": 6},
        {},
        {"step": Every(5)},
        {"step": Every(3)},
    )

    without_app: bool = param(
        True, "Leave out the launchers of other applications", paper="w/o_app"
    )
    step: Steps = param(3, "The steps at which it happens", kind="steps", low=0)

    @property
    def needs_elements(self) -> bool:
        """True: it clicks one of the elements."""
        return True

    def make_plan(self, scene: Scene, stream: Stream, step: int) -> Draft:
        """Order the known elements at random; the desktop clicks the first that still exists."""
        boxes = [box for box in scene.obstacles.tolist() if not holds_middle(box, scene.target)]
        order: list[list[int]] = []
        while boxes:
            order.append(boxes.pop(stream.integer(0, len(boxes) - 1)))
        notes = () if order else ("no element is known: the live desktop must name the candidates",)
        return Draft(
            effects=(Effect("touch", {"boxes": order, "without_app": self.without_app}),),
            notes=notes,
        )
