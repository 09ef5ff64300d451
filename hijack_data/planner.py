"""What plans: the base class of corruptions and of everything that joins them.

The library asks a planner for nothing but what `Planner` declares, so a class of your own that
inherits from it works in batches, datasets, transforms and the live environment:

    class Rarely(hj.Planner):
        def __init__(self, part: hj.Planner) -> None:
            self.part = part

        @property
        def parts(self) -> tuple[hj.Planner, ...]:
            return (self.part,)

        def plan(self, scene, *, seed, sample=0, step=None, epoch=0):
            if (step or 0) % 10:
                return hj.Plan.clean(scene.size)
            return self.part.plan(scene, seed=seed, sample=sample, step=step, epoch=epoch)

Only `plan` must be written. From `parts` follow the effects, the due steps and whether elements are
needed; a class that knows better overrides those.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any, cast

from .errors import ParameterTypeError, shown
from .plan import Plan
from .types import Scene


class Planner(ABC):
    """Base class of all that plans: corruptions, `OneOf`, `Sequence`, `Schedule`, and your own."""

    @abstractmethod
    def plan(
        self,
        scene: Scene,
        *,
        seed: int,
        sample: int | str = 0,
        step: int | None = None,
        epoch: int = 0,
    ) -> Plan:
        """Return the plan for one screen.

        The same arguments must give the same plan in every process.

        Args:
            scene: the screen: its size, and the elements, applications and target as far as known.
            seed: 0 to 2**64 - 1.
            sample: id of the sample or trajectory.
            step: step in the trajectory; -1 is before the first.
            epoch: training epoch, >= 0.
        """

    @property
    def parts(self) -> tuple["Planner", ...]:
        """The planners that this one is made of; none for a corruption."""
        return ()

    @property
    def label(self) -> str:
        """The name under which results are listed if no other was given."""
        return type(self).__name__.lower()

    @property
    def id(self) -> str:
        """The name that plans and logs use for it; with a version where there is one."""
        return self.label

    @property
    def effects(self) -> tuple[str, ...]:
        """Kinds of effects on the machine that its plans may hold, each once; those of its parts.

        Empty for a planner that only changes the picture.
        """
        kinds = [kind for part in self.parts for kind in part.effects]
        return tuple(dict.fromkeys(kinds))

    @property
    def needs_elements(self) -> bool:
        """Whether the plan may depend on where the interactive elements are."""
        parts = self.parts
        return not parts or any(part.needs_elements for part in parts)

    def is_due(self, step: int) -> bool:
        """Return whether it may act at `step` (-1 is before the first); `False` must be certain."""
        parts = self.parts
        return not parts or any(part.is_due(step) for part in parts)

    def params(self) -> dict[str, Any]:
        """Return the parameters as JSON data."""
        return {}

    def to_config(self) -> dict[str, dict[str, Any]]:
        """Return its entry in a configuration: one name with its settings, as JSON data.

        Raises:
            ParameterTypeError: a configuration cannot hold this kind of planner.
        """
        kinds = "corruptions, OneOf and Sequence"
        raise ParameterTypeError(f"a configuration holds {kinds}, got {type(self).__name__}")


def leaves(planner: Planner) -> Iterator[Planner]:
    """Yield the planners without parts that a planner is made of, itself if it has none."""
    parts = planner.parts
    if not parts:
        yield planner
    for part in parts:
        yield from leaves(part)


def as_planner(value: object, wanted: str) -> Planner:
    """Return `value`, which must be a planner.

    Args:
        value: what a user gave.
        wanted: the beginning of the message, such as `"OneOf takes corruptions such as Marks()"`.

    Raises:
        ParameterTypeError: `value` is not an instance of `Planner`.
    """
    if isinstance(value, Planner):
        return value
    raise ParameterTypeError(f"{wanted}, got {shown(value)}{advice_for(value)}")


def advice_for(value: object) -> str:
    """Return how to make a planner of a value that is none, as the end of an error message."""
    kind = cast("type[object]", value) if isinstance(value, type) else type(value)
    if kind is value and issubclass(kind, Planner):
        return f"; it is a class: give an instance, such as {kind.__name__}()"
    if callable(getattr(kind, "plan", None)):
        return f"; it has a method plan, but {kind.__name__} must inherit from hijack_data.Planner"
    return ""
