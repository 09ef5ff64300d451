"""The frames of a dataset step by step, and the pairs of frames before and after an action."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby, pairwise

from hijack_data.plan import CLEAN
from hijack_data.types import UInt8Array

from ...dataset.image_codec import decode
from ..example import Row

NO_STEP_BEFORE = "nothing was recorded before the event"
NO_FRAME_BEFORE = "what the agent met before the event is not in the dataset"


@dataclass(frozen=True)
class RowFrame:
    """A row without its screenshot, and the PNG of the screenshot."""

    row: Row
    png: bytes

    @property
    def label(self) -> str:
        """The corruption of the row, or `CLEAN`."""
        return str(self.row["corruption"])

    @cached_property
    def pixels(self) -> UInt8Array:
        """The screenshot, uint8 RGB `[H, W, 3]`."""
        return decode(self.png, str(self.row["id"]))


@dataclass(frozen=True)
class StepFrames:
    """All frames of one step of a trajectory, in the order of the dataset."""

    trajectory: str
    step: int
    frames: tuple[RowFrame, ...]

    @cached_property
    def clean(self) -> RowFrame | None:
        """The clean frame of the step, if the dataset has it."""
        for frame in self.frames:
            if frame.label == CLEAN:
                return frame
        return None

    @cached_property
    def first(self) -> dict[str, RowFrame]:
        """The first frame of each corruption: of an inserted step, else of the recorded one."""
        frames_by_label: dict[str, RowFrame] = {}
        for frame in self.frames:
            frames_by_label.setdefault(frame.label, frame)
        return frames_by_label

    def acted(self, label: str) -> RowFrame | None:
        """Return the frame of a corruption on which the agent took its recorded action, or `None`.

        On an inserted step before it the action undoes the event, and the screen after a step with
        an event could only be shown by a live desktop. Where its action got lost, it is the
        inserted step after it, on which the same action arrives.
        """
        frames = [frame for frame in self.frames if frame.label == label]
        if any(frame.row["event"] is None for frame in frames):
            return frames[-1]
        return None

    @property
    def lost(self) -> Iterator[tuple[RowFrame, RowFrame]]:
        """Pairs of a frame whose action got lost, and the inserted one on the same screen."""
        for before, frame in pairwise(self.frames):
            if frame.label == before.label and before.row["event"] is None:
                yield before, frame

    def follows(self, previous: "StepFrames | None") -> bool:
        """Return whether no step is missing between the two."""
        if previous is None:
            return False
        return self.trajectory == previous.trajectory and self.step == previous.step + 1


def frames_by_step(frames: Iterable[RowFrame]) -> Iterator[StepFrames]:
    """Group frames by step; one step is in memory at a time."""
    for (trajectory, step), group in groupby(frames, key=_step_key):
        yield StepFrames(str(trajectory), int(step), tuple(group))


def transitions(
    before: StepFrames | None, after: StepFrames, skip: Callable[[str, str], object]
) -> Iterator[tuple[RowFrame, RowFrame]]:
    """Yield pairs of frames under one corruption: that of an action, and the next one.

    Before an event that begins at this step, the screen is that of the same corruption if there is
    one, else the clean one.

    Args:
        before: the frames of the step before, if there is one.
        after: the frames of this step.
        skip: called with the corruption and the reason for each event without a frame before it.
    """
    previous = before if after.follows(before) else None
    for label, frame in after.first.items():
        is_event = frame.row["event"] is not None
        start = previous.acted(label) if previous else None
        if start is None and previous and is_event:
            start = previous.clean
        if start is not None:
            yield start, frame
        elif is_event:
            skip(label, NO_STEP_BEFORE if previous is None else NO_FRAME_BEFORE)
    yield from after.lost


def _step_key(frame: RowFrame) -> tuple[str, int]:
    return frame.row["trajectory_id"], frame.row["step"]
