"""Slipped pointer: a click or drag lands beside its target.

The environment carries it out, see `online_env/environment/input_faults.py`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ..actions.input_faults import FaultKind, InputFault
from ..corruption import Category, Corruption, Draft, Scope, register
from ..params import Steps, param
from ..rng import Stream
from ..types import Scene


@register
@dataclass(frozen=True)
class SlippedPointer(Corruption):
    """Lets a click or drag land beside its target, by a distance in proportion to its size."""

    name: ClassVar[str] = "slipped_pointer"
    category: ClassVar[Category] = "unexpected_operation"
    scope: ClassVar[Scope] = "action"
    inputs: ClassVar[tuple[FaultKind, ...]] = ("offset",)
    severities: ClassVar[tuple[Mapping[str, Any], ...]] = (
        {"distance": 0.5},
        {"distance": 0.9},
        {},
        {"distance": 2.5},
        {"distance": 5.0},
    )

    step: Steps = param(
        3, "The steps from which on the next click or drag slips", kind="steps", low=0
    )
    distance: float = param(
        1.5,
        "How far it slips: 1 leads from the middle of the element to its edge",
        low=0.01,
        high=50.0,
    )

    @property
    def needs_elements(self) -> bool:
        """True: the element under the pointer decides how far it slips."""
        return True

    def make_plan(self, scene: Scene, stream: Stream, step: int) -> Draft:
        """Draw whether the pointer slips left, right, up or down."""
        percent = round(100 * self.distance)
        across, down = ((1, 0), (-1, 0), (0, 1), (0, -1))[stream.integer(0, 3)]
        fault = InputFault(
            "offset", ("click", "drag"), dx=across * percent, dy=down * percent, unit="percent"
        )
        return Draft(inputs=(fault,))
