"""App freeze: the program in front hangs for some seconds, then goes on.

Its effect on a live machine is `online_env/effects/app_freeze.py`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ..corruption import Category, Corruption, Draft, Scope, register
from ..params import Steps, param
from ..plan import Effect
from ..rng import Stream
from ..types import Scene


@register
@dataclass(frozen=True)
class AppFreeze(Corruption):
    """Stops the processes of the window in front for some seconds.

    The window does not answer meanwhile; what is typed and clicked arrives when it goes on.
    """

    name: ClassVar[str] = "app_freeze"
    category: ClassVar[Category] = "unexpected_operation"
    scope: ClassVar[Scope] = "transition"
    effects: ClassVar[tuple[str, ...]] = ("freeze",)
    severities: ClassVar[tuple[Mapping[str, Any], ...]] = (
        {"seconds": 5},
        {"seconds": 7},
        {},
        {"seconds": 20},
        {"seconds": 40},
    )

    step: Steps = param(2, "The steps before which it hangs", kind="steps", low=0)
    seconds: int = param(10, "How long it hangs, in seconds", low=4, high=300)

    def make_plan(self, scene: Scene, stream: Stream, step: int) -> Draft:
        """Stop the window in front."""
        return Draft(effects=(Effect("freeze", {"lasts": {"seconds": self.seconds}}),))
