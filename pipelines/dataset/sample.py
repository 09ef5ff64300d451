"""One step of a recording with its screenshot decoded."""

from dataclasses import dataclass
from functools import cached_property

from hijack_data.types import Scene, Step, Trajectory, UInt8Array

from .image_codec import BaseImage


@dataclass(frozen=True)
class Sample:
    """One decoded step."""

    trajectory: Trajectory
    step: Step
    base: BaseImage
    scene: Scene

    @property
    def image(self) -> UInt8Array:
        """The screenshot as recorded."""
        return self.base.image

    @property
    def key(self) -> str:
        """The key of the random draws, without the step."""
        return self.trajectory.sample or self.trajectory.id

    @cached_property
    def position(self) -> int:
        """Number of steps of the recording before this one."""
        return step_position(self.trajectory, self.step)


def step_position(trajectory: Trajectory, step: Step) -> int:
    """Return the number of steps of `trajectory` before `step`."""
    return next(i for i, other in enumerate(trajectory) if other.index == step.index)
