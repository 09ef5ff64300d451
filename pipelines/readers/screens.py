"""What the pictures of a recording show: the screen of a desktop, a web page without the screen around it, or a phone.

A reader that knows says it in each trajectory, and not by its own name: where rows are made, in a worker that may be on
another machine, a reader from elsewhere is not registered.
"""

from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

from hijack_data.corruptions.multi_apps import normalize_app
from hijack_data.errors import ParameterError, suggest
from hijack_data.types import Trajectory

Screen: TypeAlias = Literal["desktop", "web page", "phone"]
# Domains that say so, in the spelling of `normalize_app`.
DOMAINS: dict[str, Screen] = {"web_page": "web page", "mobile": "phone", "android": "phone", "ios": "phone"}


@dataclass(frozen=True)
class RecordedTrajectory(Trajectory):
    """A trajectory whose reader knows what its pictures show.

    `screen` is `"desktop"`, `"web page"` or `"phone"`; `None` leaves it to the domain. Raises `ParameterError` for
    anything else.
    """

    screen: Screen | None = None

    def __post_init__(self) -> None:
        known = get_args(Screen)
        if self.screen is not None and self.screen not in known:
            raise ParameterError(f"trajectory {self.id!r}: unknown screen {self.screen!r}{suggest(self.screen, known)}")


def screen_of(trajectory: Trajectory) -> Screen:
    """Return what the pictures show: what the reader says, or else the domain, or else a desktop."""
    said = trajectory.screen if isinstance(trajectory, RecordedTrajectory) else None
    return said or DOMAINS.get(normalize_app(trajectory.domain), "desktop")
