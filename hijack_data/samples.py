"""Samples of a training set: their keys, their screens, and the labels that follow the pixels.

A sample is a dictionary. These entries are read, all but the id optional:

* `id`: identifies the sample; only the id, the seed and the epoch decide its corruption,
* `step`, `epoch`: the step of its trajectory and the training epoch, 0 by default,
* `target`: the point `(x, y)` or box `(x1, y1, x2, y2)` that the label aims at; by default
  `target_box`, or the point of the `action`,
* `elements`: `[N, 4]` boxes of interactive elements,
* `action` (an `Action`, or a dictionary as the rows of a dataset have it), `action_code` (pyautogui
  code): like target and elements, they follow the pixels. If the action is a drag from the target,
  its end must be visible as well: the lesser share of the two counts.

Other labels are declared (`hijack_data.labels`). Rows of our datasets stay rows: all of their
columns are updated to the corrupted picture. This module uses no framework; `transforms`
(torchvision) and `grain` build on it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from .batches import check_ids
from .errors import ParameterError, ParameterTypeError
from .labels import Labels
from .labels.rows import corrupted_row, is_row
from .plan import Plan
from .planner import Planner, as_planner
from .rng import as_seed
from .safety import plan_avoiding, target_visible
from .types import Scene, Size, as_boxes, as_target

LABEL_POLICIES = ("keep", "avoid")
PICTURE_KEYS = ("image", "images", "screenshot", "picture", "pixels")


@dataclass(frozen=True)
class SamplePlanner:
    """A planner with the settings that every sample shares.

    Args:
        planner: a corruption, `OneOf`, `Sequence` or `Schedule`.
        seed: 0 to 2**64 - 1.
        label_policy: `keep` the first draw; or `avoid`: draw again until the target (of a drag,
            both ends) is visible, and leave the sample clean if no draw succeeds.
        id_key: name of the entry that holds the id.
        labels: which entries are labels, and how they are written.
    """

    planner: Planner
    seed: int = 0
    label_policy: str = "keep"
    id_key: str = "id"
    labels: Labels = field(default_factory=Labels)

    def __post_init__(self) -> None:
        as_planner(self.planner, "expected a corruption such as Marks()")
        if self.label_policy not in LABEL_POLICIES:
            raise ParameterError(f"label_policy must be keep or avoid, got {self.label_policy!r}")
        as_seed(self.seed)  # checked here, not at the first sample in some worker

    def plan(self, size: Size, sample: Mapping[str, Any], key: int | str, epoch: int = 0) -> Plan:
        """Return the plan for a sample whose picture has this `size`.

        `key` is its id; `epoch` is used if the sample has no epoch.
        """
        place = self.labels.place(sample, size)
        boxes = as_boxes(self.labels.boxes(sample, "elements", size), "elements")
        target = None if place is None else as_target(place.target, size)
        scene = Scene(size, boxes, target=target)
        step = scalar(sample.get("step"), "step", 0)
        epoch = scalar(sample.get("epoch"), "epoch", epoch)
        if self.label_policy == "keep":
            return self.planner.plan(scene, seed=self.seed, sample=key, step=step, epoch=epoch)
        if place is None:
            self.labels.check_target(sample, size)
        end = None if place is None else place.end
        plan = plan_avoiding(
            self.planner, scene, seed=self.seed, sample=key, step=step, epoch=epoch, end=end
        )
        return Plan.clean(size) if plan is None else plan

    def key(self, sample: Mapping[str, Any], *, batch: int | None = None) -> list[int | str]:
        """Return the id of a sample in a list, or the ids of a batch of `batch` pictures.

        Raises:
            ParameterError: the entry is missing, or a batch has a single id.
        """
        if sample.get(self.id_key) is None:
            entries = ", ".join(map(str, sample)) or "nothing"
            raise ParameterError(
                f"the sample has no {self.id_key!r} entry (it has: {entries}); the id decides"
                " which corruption a sample gets, so give each sample one of its own, such as its"
                " row number; for pictures alone, id_from='content' derives it from the pixels"
            )
        ids = sample[self.id_key]
        if batch is None:
            return [_id(ids)]
        if not is_many(ids):
            raise ParameterError(
                f"{self.id_key} is {ids!r}, but there are {batch} pictures: give a list of ids"
            )
        keys = [_id(i) for i in ids]
        check_ids(keys, batch)
        return keys


def is_many(value: Any) -> bool:
    """Return whether an id entry holds several ids."""
    return isinstance(value, list | tuple) or bool(getattr(value, "ndim", 0))


def _id(value: Any) -> int | str:
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if isinstance(value, str):
        return str(value)
    if isinstance(value, bool) or is_many(value) or not hasattr(value, "__index__"):
        raise ParameterTypeError(
            f"the id of a sample must be a string or an integer, got {value!r}"
        )
    return int(value.__index__())


def scalar(value: Any, what: str, default: int) -> int:
    """Return an integer entry, or `default` if there is none.

    Raises:
        ParameterTypeError: the entry is not an integer.
    """
    if value is None:
        return default
    try:
        if isinstance(value, bool):
            raise TypeError
        return int(value.__index__())
    except (AttributeError, TypeError):
        raise ParameterTypeError(f"{what} must be an integer, got {value!r}") from None


def visible_in(plan: Plan, sample: Mapping[str, Any], labels: Labels) -> float | None:
    """Return the share of a sample's target that is visible after `plan`.

    For a drag, it is the lesser share of both ends.
    """
    place = labels.place(sample, plan.size)
    if place is None:
        return None
    return target_visible(plan, place.target, place.end)


def follow(
    plan: Plan, sample: Mapping[str, Any], before: Any, after: Any, labels: Labels, seed: int | None
) -> dict[str, Any]:
    """Return the entries of a sample that a plan changes.

    These are its labels and, in a dataset row, the columns that describe the corruption. `before`
    and `after` are its pictures; `seed` is the seed of the plan, or `None` for a plan given by the
    user.
    """
    moved = labels.follow(plan, sample)
    if not is_row(sample):
        return moved
    place = labels.place(sample, plan.size)
    return {**moved, **corrupted_row(sample, plan, before, after, place, seed)}
