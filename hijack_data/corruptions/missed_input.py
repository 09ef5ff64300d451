"""Missed input: a click, a drag or a key press does not arrive.

The environment carries it out, see `online_env/environment/input_faults.py`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ..actions.input_faults import MAX_ACTIONS, FaultKind, InputFault
from ..corruption import Category, Corruption, Draft, Scope, register
from ..params import Every, Steps, param
from ..rng import Stream
from ..types import Scene


@register
@dataclass(frozen=True)
class MissedInput(Corruption):
    """Lets a click, drag or key press get lost: the pointer moves, and nothing is pressed."""

    name: ClassVar[str] = "missed_input"
    category: ClassVar[Category] = "unexpected_operation"
    scope: ClassVar[Scope] = "action"
    inputs: ClassVar[tuple[FaultKind, ...]] = ("drop",)
    severities: ClassVar[tuple[Mapping[str, Any], ...]] = (
        {"step": 12},
        {"step": 6},
        {},
        {"step": Every(5)},
        {"step": Every(3), "actions": 2},
    )

    step: Steps = param(3, "The steps from which on the next action gets lost", kind="steps", low=0)
    actions: int = param(1, "How many actions in a row get lost", low=1, high=MAX_ACTIONS)

    def make_plan(self, scene: Scene, stream: Stream, step: int) -> Draft:
        """Drop the next actions that press something."""
        return Draft(inputs=(InputFault("drop", actions=self.actions),))
