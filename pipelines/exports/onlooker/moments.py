"""Steps of a trajectory one after the other: what was on the screen, what the agent did, what was there then."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby

from hijack_data.plan import CLEAN
from hijack_data.types import UInt8Array

from ...images import decode
from ..example import Row

FIRST = "nothing was recorded before the event"
HELD = "what the agent met before the event is not in the dataset"


@dataclass(frozen=True)
class Shot:
    """A row without its screenshot, and the PNG of that."""

    row: Row
    png: bytes

    @cached_property
    def pixels(self) -> UInt8Array:
        """The screenshot, uint8 RGB `[H, W, 3]`."""
        return decode(self.png, str(self.row["id"]))


@dataclass(frozen=True)
class Moment:
    """All rows of one step of a trajectory, in the order of the dataset."""

    trajectory: str
    step: int
    shots: tuple[Shot, ...]

    @cached_property
    def clean(self) -> Shot | None:
        """The step as it was recorded."""
        return next((shot for shot in self.shots if shot.row["corruption"] == CLEAN), None)

    @cached_property
    def first(self) -> dict[str, Shot]:
        """What each corruption shows first at this step: a step that it inserted, or the recorded one."""
        found: dict[str, Shot] = {}
        for shot in self.shots:
            found.setdefault(str(shot.row["corruption"]), shot)
        return found

    def acted(self, label: str) -> Shot | None:
        """Return the step under a corruption with the agent's own action on an ordinary screen, if there is one.

        An inserted step has the action that undoes the event, and one with an event is followed by what only a live
        desktop knows.
        """
        fitting = (shot for shot in self.shots if shot.row["corruption"] == label and shot.row["event"] is None)
        return next(fitting, None)

    def follows(self, other: "Moment | None") -> bool:
        """Return whether no step is missing between the two."""
        return other is not None and (other.trajectory, other.step + 1) == (self.trajectory, self.step)


def moments(shots: Iterable[Shot]) -> Iterator[Moment]:
    """Group rows by step. One step is held at a time."""
    for (trajectory, step), group in groupby(shots, key=lambda shot: (shot.row["trajectory_id"], shot.row["step"])):
        yield Moment(str(trajectory), int(step), tuple(group))


def transitions(
    before: Moment | None, after: Moment, skip: Callable[[str, str], object]
) -> Iterator[tuple[Shot, Shot]]:
    """Yield what the agent acted on and what it saw next, under the same corruption.

    Before an event that begins here the screen was that of the same corruption, or else the clean one. Events that
    nothing is known before are told to `skip` with their corruption and the reason.
    """
    known = before if after.follows(before) else None
    for label, shot in after.first.items():
        start = known.acted(label) if known else None
        if start is None and known and shot.row["event"] is not None:
            start = known.clean
        if start is not None:
            yield start, shot
        elif shot.row["event"] is not None:
            skip(label, FIRST if known is None else HELD)
