"""Network error: the outside world is unreachable.

The paper's Algorithm "Network Error". Its effect on a live machine is
`online_env/effects/network_error.py`, its look in recordings `pipelines/edits/network_error.py`.
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
class NetworkError(Corruption):
    """Drops all traffic but loopback, the controlling host and established connections."""

    name: ClassVar[str] = "network_error"
    category: ClassVar[Category] = "environment_error"
    scope: ClassVar[Scope] = "state"
    effects: ClassVar[tuple[str, ...]] = ("firewall",)
    pictures: ClassVar[tuple[str, ...]] = ("error_page", "error_view", "panel")
    paper: ClassVar[str] = "Algorithm 8 (Network Error)"

    step: Steps = param(
        -1, "The step before which it happens; -1 is before the episode", kind="steps", low=-1
    )
    local_ip: str | None = param(
        None,
        "Address of the controlling host, which stays reachable; found when not given",
        kind="ip",
        optional=True,
    )

    def make_plan(self, scene: Scene, stream: Stream, step: int) -> Draft:
        """Close the firewall."""
        return Draft(
            effects=(Effect("firewall", {"allow": [self.local_ip] if self.local_ip else []}),)
        )
