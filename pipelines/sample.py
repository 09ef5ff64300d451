"""One step of a recording with its screenshot decoded."""

from dataclasses import dataclass
from functools import cached_property

from hijack_data.types import Scene, Step, Trajectory, UInt8Array

from .images import Base


@dataclass(frozen=True)
class Sample:
    """One decoded step."""

    trajectory: Trajectory
    step: Step
    base: Base
    scene: Scene

    @property
    def image(self) -> UInt8Array:
        """The screenshot as it was recorded."""
        return self.base.image

    @property
    def key(self) -> str:
        """What random draws are keyed by, beside the step."""
        return self.trajectory.sample or self.trajectory.id

    @cached_property
    def position(self) -> int:
        """How many steps of the recording were read before this one."""
        return position_of(self.trajectory, self.step)


def position_of(trajectory: Trajectory, step: Step) -> int:
    """Return how many steps of `trajectory` come before `step`."""
    return next(i for i, other in enumerate(trajectory) if other.index == step.index)
