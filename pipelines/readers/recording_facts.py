"""The facts that a recording states: its platform, its applications, and what its pictures show.

What a recording does not state is `None` or empty, never assumed.

A reader that knows this states it in each trajectory, not by its own name: workers, which may be on
other machines, do not register the readers of plug-ins.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias, get_args

from hijack_data.apps import collect_apps, normalize_app
from hijack_data.errors import ParameterError, suggest
from hijack_data.platforms import find_platform
from hijack_data.types import Platform, Trajectory

from .fields import FieldTypeError, storable

ScreenKind: TypeAlias = Literal["desktop", "web page", "phone"]
SCREENS: dict[Platform, ScreenKind] = {"web": "web page", "android": "phone", "ios": "phone"}
# The episode of a row of a table that names none.
UNKNOWN_EPISODE = ""
# The fields in which tables name it.
EPISODES = ("trajectory_id", "episode_id")
# What readers call an episode, for the dataset card.
ROW_EPISODES = f"the rows with the same {' or '.join(f'`{name}`' for name in EPISODES)}"
PICTURE_EPISODES = "the rows of one picture"
# Domains that name no platform and say what the pictures show.
DOMAINS: dict[str, ScreenKind] = {"desktop": "desktop", "mobile": "phone"}


@dataclass(frozen=True)
class RecordedTrajectory(Trajectory):
    """A trajectory whose reader states what its pictures show, or of which episode it is a part.

    Args:
        screen: `"desktop"`, `"web page"` or `"phone"`; `None` leaves it to the platform and the
            domain.
        episode: an id shared by trajectories that must be in one split, because they are steps of
            one recording or show one picture. `None` if the trajectory is a whole recording;
            `UNKNOWN_EPISODE` if it may be a part of one, and nothing says of which.

    Raises:
        ParameterError: `screen` is something else.
    """

    screen: ScreenKind | None = None
    episode: str | None = None

    def __post_init__(self) -> None:
        known = get_args(ScreenKind)
        if self.screen is not None and self.screen not in known:
            raise ParameterError(
                f"trajectory {self.id!r}: unknown screen"
                f" {self.screen!r}{suggest(self.screen, known)}"
            )


def episode_id(trajectory: Trajectory) -> str:
    """Return the episode of a trajectory: a whole recording is one; `""` if it is not known."""
    if isinstance(trajectory, RecordedTrajectory) and trajectory.episode is not None:
        return trajectory.episode
    return trajectory.id


def stated_episode(record: Mapping[str, Any], key: str | None = None) -> str:
    """Return the episode that a row of a table states; `UNKNOWN_EPISODE` if it states none.

    Args:
        record: the row.
        key: the field that names it, as the user chose; by default one of `EPISODES`.

    Raises:
        FieldTypeError: the chosen field is missing, empty, or neither a text nor an integer.
    """
    for name in EPISODES if key is None else (key,):
        value = record.get(name)
        if isinstance(value, str | int) and not isinstance(value, bool) and str(value).strip():
            return storable(str(value), name)
        if key is not None:
            raise FieldTypeError(name, "the id of an episode, a text or an integer", value)
    return UNKNOWN_EPISODE


def stated_platform(trajectory: Trajectory) -> Platform | None:
    """Return the machine's platform: the trajectory's, or its domain if that names one."""
    if trajectory.platform:
        return trajectory.platform
    # As a domain, "web" is what a task is about; pictures of pages have the domain "web page".
    if normalize_app(trajectory.domain) == "browser":
        return None
    return find_platform(trajectory.domain)


def stated_screen(trajectory: Trajectory) -> ScreenKind | None:
    """Return what the pictures show, by the reader, the platform or the domain.

    `None` if none of them says it: the pictures may show a phone as well as a desktop.
    """
    if isinstance(trajectory, RecordedTrajectory) and trajectory.screen is not None:
        return trajectory.screen
    platform = stated_platform(trajectory)
    if platform is not None:
        return SCREENS.get(platform, "desktop")
    return DOMAINS.get(normalize_app(trajectory.domain))


@dataclass(frozen=True)
class RecordingFacts:
    """What a recording states, as builds and `inspect` read it.

    Args:
        screen: what its pictures show, or `None` if it does not say.
        platform: the platform of its machine, or `None` if it does not say.
        apps: its applications, normalised; empty if it names none.
    """

    screen: ScreenKind | None
    platform: Platform | None
    apps: frozenset[str]


def read_facts(trajectory: Trajectory) -> RecordingFacts:
    """Return what a recording states."""
    return RecordingFacts(
        stated_screen(trajectory),
        stated_platform(trajectory),
        collect_apps(trajectory.apps, trajectory.domain),
    )
