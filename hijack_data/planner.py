"""Planners: the base class of corruptions and of everything that combines them.

The library uses only the members that `Planner` declares, so your own subclass works in batches,
datasets, transforms and the live environment:

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

Only `plan` must be implemented. The effects, the due steps and the need for elements are derived
from `parts`; a class that knows them more precisely overrides those members.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any, cast

from .actions.input_faults import FaultKind
from .errors import ParameterTypeError, short_repr
from .plan import Plan
from .types import Scene


class Planner(ABC):
    """Base class of all planners: corruptions, `OneOf`, `Sequence`, `Schedule`, and your own."""

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
            scene: the screen: its size and, as far as known, elements, applications and target.
            seed: 0 to 2**64 - 1.
            sample: id of the sample or trajectory.
            step: step in the trajectory; -1 is before the first.
            epoch: training epoch, >= 0.
        """

    @property
    def parts(self) -> tuple["Planner", ...]:
        """The planners that this one combines; empty for a corruption."""
        return ()

    @property
    def label(self) -> str:
        """The name under which results are listed by default."""
        return type(self).__name__.lower()

    @property
    def id(self) -> str:
        """The name in plans and logs, with the version if there is one."""
        return self.label

    @property
    def effects(self) -> tuple[str, ...]:
        """Kinds of effects on the machine that its plans may hold, each once.

        By default those of its parts; empty for a planner that only changes the picture.
        """
        kinds = [kind for part in self.parts for kind in part.effects]
        return tuple(dict.fromkeys(kinds))

    @property
    def inputs(self) -> tuple[FaultKind, ...]:
        """Kinds of faults of the agent's input that its plans may hold, each once.

        By default those of its parts.
        """
        return tuple(dict.fromkeys(kind for part in self.parts for kind in part.inputs))

    @property
    def needs_elements(self) -> bool:
        """Whether the plan may depend on where the interactive elements are."""
        parts = self.parts
        return not parts or any(part.needs_elements for part in parts)

    def is_due(self, step: int) -> bool:
        """Return whether it may act at `step`, -1 before the first; `False` must be certain."""
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


def tree(planner: Planner) -> Iterator[Planner]:
    """Yield a planner, its parts, their parts, and so on."""
    yield planner
    for part in planner.parts:
        yield from tree(part)


def leaves(planner: Planner) -> Iterator[Planner]:
    """Yield the leaves of a tree of planners: those without parts, maybe `planner` itself."""
    return (part for part in tree(planner) if not part.parts)


def as_planner(value: object, expected: str) -> Planner:
    """Check that `value` is a planner, and return it.

    Args:
        value: the value given by the user.
        expected: the beginning of the message, such as `"OneOf takes corruptions such as Marks()"`.

    Raises:
        ParameterTypeError: `value` is not an instance of `Planner`.
    """
    if isinstance(value, Planner):
        return value
    raise ParameterTypeError(f"{expected}, got {short_repr(value)}{advice_for(value)}")


def advice_for(value: object) -> str:
    """Return advice for the end of an error message on a value that is not a planner."""
    kind = cast("type[object]", value) if isinstance(value, type) else type(value)
    if kind is value and issubclass(kind, Planner):
        return f"; it is a class: give an instance, such as {kind.__name__}()"
    if callable(getattr(kind, "plan", None)):
        return f"; it has a method plan, but {kind.__name__} must inherit from hijack_data.Planner"
    return ""
