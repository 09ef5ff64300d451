"""Slow network: sites answer late, and little comes through at a time.

Its effect on a live machine is `online_env/effects/slow_network.py`.
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
class SlowNetwork(Corruption):
    """Limits the rate in both directions; small packets take as long as full ones.

    So an exchange waits at any rate: at 256 kbit/s a packet takes 47 ms.
    """

    name: ClassVar[str] = "slow_network"
    category: ClassVar[Category] = "environment_error"
    scope: ClassVar[Scope] = "state"
    effects: ClassVar[tuple[str, ...]] = ("slow_link",)
    severities: ClassVar[tuple[Mapping[str, Any], ...]] = (
        {"rate": 1024},
        {"rate": 512},
        {},
        {"rate": 128},
        {"rate": 64},
    )

    step: Steps = param(
        -1, "The step before which it begins; -1 is before the episode", kind="steps", low=-1
    )
    rate: int = param(256, "kbit/s in each direction", low=16, high=100_000)

    def make_plan(self, scene: Scene, stream: Stream, step: int) -> Draft:
        """Limit the rate."""
        return Draft(effects=(Effect("slow_link", {"rate": self.rate}),))
