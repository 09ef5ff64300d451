"""The platform of a recording, and whether its pictures show a desktop, a page or a phone.

A reader that knows this states it in each trajectory, not by its own name: workers, which may be on
other machines, do not register the readers of plug-ins.
"""

from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

from hijack_data.apps import normalize_app
from hijack_data.errors import ParameterError, suggest
from hijack_data.platforms import find_platform
from hijack_data.types import Platform, Trajectory

ScreenKind: TypeAlias = Literal["desktop", "web page", "phone"]
SCREENS: dict[Platform, ScreenKind] = {"web": "web page", "android": "phone", "ios": "phone"}


@dataclass(frozen=True)
class RecordedTrajectory(Trajectory):
    """A trajectory whose reader states what its pictures show.

    Args:
        screen: `"desktop"`, `"web page"` or `"phone"`; `None` leaves it to the platform and the
            domain.

    Raises:
        ParameterError: `screen` is something else.
    """

    screen: ScreenKind | None = None

    def __post_init__(self) -> None:
        known = get_args(ScreenKind)
        if self.screen is not None and self.screen not in known:
            raise ParameterError(
                f"trajectory {self.id!r}: unknown screen"
                f" {self.screen!r}{suggest(self.screen, known)}"
            )


def platform_of(trajectory: Trajectory) -> Platform | None:
    """Return the machine's platform: the trajectory's, or its domain if that names one."""
    if trajectory.platform:
        return trajectory.platform
    # As a domain, "web" is what a task is about; pictures of pages have the domain "web page".
    if normalize_app(trajectory.domain) == "browser":
        return None
    return find_platform(trajectory.domain)


def screen_of(trajectory: Trajectory) -> ScreenKind:
    """Return what the pictures show, by the reader, the platform or the domain."""
    if isinstance(trajectory, RecordedTrajectory) and trajectory.screen is not None:
        return trajectory.screen
    platform = platform_of(trajectory)
    if platform is not None:
        return SCREENS.get(platform, "desktop")
    return "phone" if normalize_app(trajectory.domain) == "mobile" else "desktop"
