"""App minimization: every window vanishes to the panel.

The paper's Algorithm "App Minimization". Its effect on a live machine is
`online_env/effects/app_minimization.py`, its look in recordings
`pipelines/edits/app_minimization.py`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ..corruption import Category, Corruption, Draft, Scope, register
from ..params import Every, Steps, param
from ..plan import Effect
from ..rng import Stream
from ..types import Scene


@register
@dataclass(frozen=True)
class AppMinimization(Corruption):
    """Minimises all windows at once, as the show-desktop key does."""

    name: ClassVar[str] = "app_minimization"
    category: ClassVar[Category] = "unexpected_operation"
    scope: ClassVar[Scope] = "transition"
    effects: ClassVar[tuple[str, ...]] = ("minimise",)
    pictures: ClassVar[tuple[str, ...]] = ("desktop", "wallpaper", "icon")
    paper: ClassVar[str] = "Algorithm 7 (App Minimization)"
    severities: ClassVar[tuple[Mapping[str, Any], ...]] = (
        {"step": 12},
        {"step": 6},
        {},
        {"step": Every(5)},
        {"step": Every(3)},
    )

    step: Steps = param(3, "The steps at which it happens", kind="steps", low=0)

    def make_plan(self, scene: Scene, stream: Stream, step: int) -> Draft:
        """Show the desktop."""
        return Draft(effects=(Effect("minimise"),))
