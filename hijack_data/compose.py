"""Several corruptions as one: `OneOf`, `Sequence`, `Schedule`, over single screens and batches."""

import math
from bisect import bisect_right
from collections.abc import Callable, Iterable, Mapping, Set
from collections.abc import Sequence as SequenceOf
from itertools import accumulate
from numbers import Real
from typing import Any, cast

from .batches import Corrupted, corrupt_batch, moved_target
from .errors import ParameterError, ParameterTypeError
from .params import Parameter
from .plan import Plan, joined_params
from .planner import Planner, as_planner
from .rng import Branch, Stream, branch
from .types import Scene

__all__ = ["Augmentation", "Corrupted", "OneOf", "Schedule", "Sequence", "probability", "sometimes"]

BEFORE = -1  # the step of what happens before an episode
_MAX_TIMES = Parameter("int", "", low=1, high=1000, optional=True)


class Augmentation(Planner):
    """Base class of the combinators: subclasses implement `plan`, and a call corrupts a batch."""

    def choose(
        self, *, seed: int, sample: int | str = 0, step: int | None = None, epoch: int = 0
    ) -> "tuple[Planner, Branch] | None":
        """Return the only part that plans for a sample, and its random key.

        Returns `None` if no part plans for the sample, or several do.
        """
        return None

    def __call__(
        self,
        batch: Any,
        *,
        ids: SequenceOf[int | str],
        boxes: SequenceOf[Any] | None = None,
        targets: SequenceOf[Any] | None = None,
        ends: SequenceOf[Any] | None = None,
        seed: int,
        epoch: int = 0,
        steps: SequenceOf[int] | None = None,
    ) -> Corrupted:
        """Corrupt a batch; only its id, the seed and the epoch decide what happens to a sample.

        Args:
            batch: NumPy or JAX `[B, H, W, 3]`, torch `[B, 3, H, W]`, or a list of pictures, also of
                Pillow; uint8 RGB.
            ids: one id per picture, each different.
            boxes: for each picture, `[N_i, 4]` boxes of its elements (`xyxy`), or `None`.
            targets: for each picture, the point or box that its label aims at, or `None`.
            ends: for each picture, where the drag from its target ends, or `None`; for a drag,
                `safety` judges both ends and counts the lesser visible share.
            seed: 0 to 2**64 - 1.
            epoch: another epoch gives other plans.
            steps: for each picture, its step in the trajectory; 0 by default.

        Raises:
            ParameterError: a list does not have one entry per picture, an id appears twice, or a
                value is out of range.
            ParameterTypeError: an argument has the wrong type.
            ImageTypeError: the pictures are of a kind that cannot be corrupted.
        """
        return corrupt_batch(
            self,
            batch,
            ids=ids,
            boxes=boxes,
            targets=targets,
            ends=ends,
            seed=seed,
            epoch=epoch,
            steps=steps,
        )


class OneOf(Augmentation):
    """One of several corruptions, drawn for each sample.

    Args:
        options: corruptions or other combinators; each draws from a stream of its own.
        p_clean: probability that a sample stays clean, 0..1; in a nested combinator, it applies to
            the samples that reach that combinator.
        weights: relative weights of the options, finite and >= 0; equal by default.
        max_times: the most steps of one sample (an episode, a trajectory) at which an option acts,
            >= 1; `None` for no limit. The draws of earlier steps are repeated to count them.

    Raises:
        ParameterError: there are no options, or a number is out of range.
        ParameterTypeError: an option is not a planner, or a number has the wrong type.
    """

    def __init__(
        self,
        options: Iterable[Planner],
        *,
        p_clean: float = 0.0,
        weights: SequenceOf[float] | None = None,
        max_times: int | None = None,
    ) -> None:
        self.options = _planners(options, "OneOf")
        self.max_times: int | None = _MAX_TIMES.check("OneOf: max_times", max_times)
        self.p_clean = probability(p_clean, "OneOf: p_clean")
        count = len(self.options)
        self.weights = (1.0,) * count if weights is None else _weights(weights, count)
        self._edges = list(accumulate(self.weights))

    def __repr__(self) -> str:
        options = ", ".join(map(repr, self.options))
        is_even = len(set(self.weights)) == 1
        weights = "" if is_even else f", weights={self.weights}"
        limit = "" if self.max_times is None else f", max_times={self.max_times}"
        return f"OneOf([{options}], p_clean={self.p_clean:g}{weights}{limit})"

    @property
    def parts(self) -> tuple[Planner, ...]:
        """The options."""
        return self.options

    def plan(
        self,
        scene: Scene,
        *,
        seed: int,
        sample: int | str = 0,
        step: int | None = None,
        epoch: int = 0,
    ) -> Plan:
        """Draw whether to corrupt and with which option, then plan it; see `Planner.plan`."""
        choice = self.choose(seed=seed, sample=sample, step=step, epoch=epoch)
        if choice is None:
            return Plan.clean(scene.size)
        option, key = choice
        return option.plan(scene, seed=seed, sample=key, step=step, epoch=epoch)

    def choose(
        self, *, seed: int, sample: int | str = 0, step: int | None = None, epoch: int = 0
    ) -> tuple[Planner, Branch] | None:
        """Draw whether to corrupt a sample; return the drawn option and its key, or `None`."""
        choice = self._draw(seed, sample, step or 0, epoch)
        if choice is None or self.max_times is None:
            return choice
        earlier = range(BEFORE, step or 0)
        times = sum(self._acts(seed, sample, each, epoch) for each in earlier)
        return choice if times < self.max_times else None

    def _acts(self, seed: int, sample: int | str, step: int, epoch: int) -> bool:
        """Return whether the option that is drawn for a step acts at it."""
        choice = self._draw(seed, sample, step, epoch)
        return choice is not None and _acts(*choice, seed, step, epoch)

    def _draw(
        self, seed: int, sample: int | str, step: int, epoch: int
    ) -> tuple[Planner, Branch] | None:
        stream = Stream(seed, "one_of-v2", sample, step, epoch)
        if stream.random() < self.p_clean:
            return None
        at = stream.random() * self._edges[-1]
        position = bisect_right(self._edges, at)
        number = min(position, len(self.options) - 1)
        return self.options[number], branch(sample, number)

    def to_config(self) -> dict[str, dict[str, Any]]:
        """Return the entry `one_of`; see `Planner.to_config`."""
        settings: dict[str, Any] = {
            "options": [option.to_config() for option in self.options],
            "p_clean": self.p_clean,
            "weights": list(self.weights),
        }
        if self.max_times is not None:
            settings["max_times"] = self.max_times
        return {"one_of": settings}


class Sequence(Augmentation):
    """Several corruptions of one picture, one after the other.

    Each part sees the screen as the parts before left it, and draws from its own stream, even if
    the same corruption occurs twice.

    Args:
        parts: corruptions or other combinators, in their order.

    Raises:
        ParameterError: there are no parts.
        ParameterTypeError: a part is not a planner.
    """

    def __init__(self, parts: Iterable[Planner]) -> None:
        self._parts = _planners(parts, "Sequence")

    def __repr__(self) -> str:
        return f"Sequence([{', '.join(map(repr, self.parts))}])"

    @property
    def parts(self) -> tuple[Planner, ...]:
        """The corruptions, in their order."""
        return self._parts

    @property
    def label(self) -> str:
        """The labels of the parts, such as `"subtitle+network_error"`."""
        return "+".join(part.label for part in self.parts)

    def plan(
        self,
        scene: Scene,
        *,
        seed: int,
        sample: int | str = 0,
        step: int | None = None,
        epoch: int = 0,
    ) -> Plan:
        """Plan the parts in order and join them; see `Planner.plan`."""
        joined = Plan.clean(scene.size)
        for number, part in enumerate(self.parts):
            boxes = joined.coords.boxes_to_observation(scene.boxes)
            target = moved_target(joined, scene.target)
            current = Scene(joined.out_size, boxes, scene.apps, target)
            key = branch(sample, number)
            plan = part.plan(current, seed=seed, sample=key, step=step, epoch=epoch)
            joined = joined.then(plan)
        return joined

    def params(self) -> dict[str, Any]:
        """Return the parameters of each part by its id, as plans hold them."""
        return joined_params([(part.id, part.params()) for part in self.parts])

    def to_config(self) -> dict[str, dict[str, Any]]:
        """Return the entry `sequence`; see `Planner.to_config`."""
        return {"sequence": {"parts": [part.to_config() for part in self.parts]}}


class Schedule(Augmentation):
    """A corruption that changes with the epoch, such as a rising severity.

    Datasets and live episodes use epoch 0, and `parts` and the properties based on it are those of
    epoch 0.

    Args:
        at: called with the epoch (an integer >= 0), returns the planner for that epoch.

    Raises:
        ParameterTypeError: `at` is not callable, or returns something else than a planner.
    """

    def __init__(self, at: Callable[[int], Planner]) -> None:
        if not callable(cast(object, at)):
            raise ParameterTypeError(
                f"Schedule takes a function from the epoch to a corruption, got {at!r}"
            )
        self.at = at

    @property
    def parts(self) -> tuple[Planner, ...]:
        """The planner of epoch 0."""
        return (self._at(0),)

    @property
    def needs_elements(self) -> bool:
        """Always true, because the planner of another epoch may need elements."""
        return True

    def plan(
        self,
        scene: Scene,
        *,
        seed: int,
        sample: int | str = 0,
        step: int | None = None,
        epoch: int = 0,
    ) -> Plan:
        """Plan with the planner for `epoch`; see `Planner.plan`."""
        planner, key = self.choose(seed=seed, sample=sample, step=step, epoch=epoch)
        return planner.plan(scene, seed=seed, sample=key, step=step, epoch=epoch)

    def choose(
        self, *, seed: int, sample: int | str = 0, step: int | None = None, epoch: int = 0
    ) -> tuple[Planner, Branch]:
        """Return the planner for `epoch`, and its key."""
        return self._at(epoch), branch(sample, 0)

    def _at(self, epoch: int) -> Planner:
        return as_planner(
            self.at(epoch), f"Schedule at epoch {epoch} takes corruptions such as Marks()"
        )


def _acts(planner: Planner, key: int | str, seed: int, step: int, epoch: int) -> bool:
    """Return whether a planner acts at a step, as far as its draws decide."""
    if isinstance(planner, Sequence):
        parts = enumerate(planner.parts)
        return any(_acts(part, branch(key, at), seed, step, epoch) for at, part in parts)
    if isinstance(planner, OneOf | Schedule):
        choice = planner.choose(seed=seed, sample=key, step=step, epoch=epoch)
        return choice is not None and _acts(*choice, seed, step, epoch)
    if step == BEFORE and not (planner.effects or planner.inputs):
        return False  # there is no picture before the first
    return planner.is_due(step)


def sometimes(planner: Planner, p: float) -> Planner:
    """Return a planner that acts with probability `p`, 0..1.

    Raises:
        ParameterError: `p` is out of range.
        ParameterTypeError: `p` is not a number, or `planner` plans nothing.
    """
    if isinstance(p, list | tuple):
        raise ParameterTypeError(
            f"p is one probability, got {p!r}; OneOf takes weights=[...] for its options"
        )
    acting = probability(p, "p")
    if acting == 1:
        return planner
    return OneOf([planner], p_clean=1 - acting)


def probability(value: object, name: str) -> float:
    """Return a number in 0..1.

    Raises:
        ParameterError: the number is outside 0..1.
        ParameterTypeError: the value is not a number.
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        raise ParameterTypeError(f"{name} must be a number in 0..1, got {value!r}")
    number = float(value)
    if not 0 <= number <= 1:
        raise ParameterError(f"{name} must be in 0..1, got {value!r}")
    return number


def _planners(values: Iterable[Planner], who: str) -> tuple[Planner, ...]:
    is_wrong = isinstance(values, str | bytes | Mapping | Set)
    if is_wrong or not isinstance(cast(object, values), Iterable):
        raise ParameterTypeError(f"{who} takes a list of corruptions, got {values!r}")
    expected = f"{who} takes corruptions such as Marks()"
    planners = tuple(as_planner(value, expected) for value in values)
    if not planners:
        raise ParameterError(f"{who} needs at least one corruption")
    return planners


def _weights(values: object, count: int) -> tuple[float, ...]:
    """Return one weight for each option.

    Raises:
        ParameterError: a value is out of its range; the message names it.
        ParameterTypeError: `values` is not a list of numbers.
    """
    expected = f"OneOf: weights must be {count} numbers >= 0, finite and not all 0, got {values!r}"
    if isinstance(values, str | bytes) or not hasattr(values, "__len__"):
        raise ParameterTypeError(expected)
    listed = list(cast("SequenceOf[Any]", values))
    if any(isinstance(weight, bool) or not isinstance(weight, Real) for weight in listed):
        raise ParameterTypeError(expected)
    weights = tuple(float(weight) for weight in listed)
    if len(weights) != count or any(weight < 0 for weight in weights):
        raise ParameterError(expected)
    total = sum(weights)
    if not math.isfinite(total) or total <= 0:
        raise ParameterError(expected)
    return weights
