"""Repeated input: a click becomes a double click, a key repeats.

The environment carries it out, see `online_env/environment/input_faults.py`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ..actions.input_faults import MAX_TIMES, FaultKind, InputFault
from ..corruption import Category, Corruption, Draft, Scope, register
from ..params import Every, Steps, param
from ..rng import Stream
from ..types import Scene


@register
@dataclass(frozen=True)
class RepeatedInput(Corruption):
    """Lets a click, drag or key press arrive twice, or more often."""

    name: ClassVar[str] = "repeated_input"
    category: ClassVar[Category] = "unexpected_operation"
    scope: ClassVar[Scope] = "action"
    inputs: ClassVar[tuple[FaultKind, ...]] = ("repeat",)
    severities: ClassVar[tuple[Mapping[str, Any], ...]] = (
        {"step": 12},
        {"step": 6},
        {},
        {"step": Every(5)},
        {"step": Every(3), "times": 3},
    )

    step: Steps = param(
        3, "The steps from which on the next action is repeated", kind="steps", low=0
    )
    times: int = param(2, "How often the action arrives", low=2, high=MAX_TIMES)

    def make_plan(self, scene: Scene, stream: Stream, step: int) -> Draft:
        """Repeat the next action that presses something."""
        return Draft(inputs=(InputFault("repeat", times=self.times),))
