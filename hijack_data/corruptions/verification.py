"""Verification: the session is locked and asks for the password.

The paper's Algorithm "Verification". Its effect on a live machine is
`online_env/effects/verification.py`, its look in recordings `pipelines/edits/verification.py`.
"""

from dataclasses import dataclass
from typing import ClassVar

from ..corruption import Category, Corruption, Draft, Scope, register
from ..params import Steps, param
from ..plan import Effect
from ..rng import Stream
from ..types import Scene


@register
@dataclass(frozen=True)
class Verification(Corruption):
    """Locks the screen before the agent begins."""

    name: ClassVar[str] = "verification"
    category: ClassVar[Category] = "environment_error"
    scope: ClassVar[Scope] = "state"
    effects: ClassVar[tuple[str, ...]] = ("lock",)
    pictures: ClassVar[tuple[str, ...]] = ("lock_screen", "lock_dialog")
    paper: ClassVar[str] = "Algorithm 9 (Verification)"

    step: Steps = param(
        -1, "The step before which it happens; -1 is before the episode", kind="steps", low=-1
    )

    def make_plan(self, scene: Scene, stream: Stream, step: int) -> Draft:
        """Lock the session."""
        return Draft(effects=(Effect("lock"),))
