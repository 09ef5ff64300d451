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

Pictures are found by name and shape (`hijack_data.sample_pictures`), and other labels are declared
(`hijack_data.labels`). Rows of our datasets stay rows: all of their columns are updated to the
corrupted picture. This module uses no framework; `transforms` (torchvision) and `grain` build on
it.
"""

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, cast

from .chained_draws import NO_DRAWS, Draws, check_chain, note_chain
from .errors import ParameterError, ParameterTypeError
from .labels import Declared, Labels
from .labels.dataset_rows import corrupted_row, is_row, read_row_plan, visible_after
from .labels.formats import PICTURE, find_format
from .plan import Plan
from .planner import Planner, as_planner, leaves
from .rng import as_seed
from .safety import plan_avoiding
from .sample_pictures import SamplePicture, apply_plan, common_size, find_pictures, swapped
from .types import Scene, Size, as_boxes, as_target

LABEL_POLICIES = ("keep", "avoid")


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

    Raises:
        ParameterError: a value is out of its range, or the planner acts on more than pictures.
        ParameterTypeError: `planner` plans nothing, or the seed is not an integer.
    """

    planner: Planner
    seed: int = 0
    label_policy: str = "keep"
    id_key: str = "id"
    labels: Labels = field(default_factory=Labels)

    def __post_init__(self) -> None:
        as_planner(self.planner, "expected a corruption such as Marks()")
        live = [leaf.label for leaf in leaves(self.planner) if leaf.effects or leaf.inputs]
        if live:
            raise ParameterError(
                f"{', '.join(live)}: samples are pictures, which stay clean under a corruption of"
                " the machine or of the agent's input: leave it out, or build a dataset with it"
                " (hijack build)"
            )
        if self.label_policy not in LABEL_POLICIES:
            raise ParameterError(f"label_policy must be keep or avoid, got {self.label_policy!r}")
        as_seed(self.seed)  # checked here, not at the first sample in some worker

    def plan(self, size: Size, sample: Mapping[str, Any], key: int | str, epoch: int = 0) -> Plan:
        """Return the plan for a sample whose picture has this `size`.

        `key` is its id; `epoch` is used if the sample has no epoch.
        """
        location = self.labels.find_target(sample, size)
        boxes = as_boxes(self.labels.boxes(sample, "elements", size), "elements")
        target = None if location is None else as_target(location.target, size)
        scene = Scene(size, boxes, target=target)
        step = scalar(sample.get("step"), "step", 0)
        epoch = scalar(sample.get("epoch"), "epoch", epoch)
        if self.label_policy == "keep":
            return self.planner.plan(scene, seed=self.seed, sample=key, step=step, epoch=epoch)
        if location is None:
            self.labels.check_target(sample, size, {self.id_key})
        end = None if location is None else location.end
        plan = plan_avoiding(
            self.planner, scene, seed=self.seed, sample=key, step=step, epoch=epoch, end=end
        )
        return Plan.clean(size) if plan is None else plan

    def key(self, sample: Mapping[str, Any]) -> int | str:
        """Return the id of a sample.

        Raises:
            ParameterError: the entry is missing, or empty.
            ParameterTypeError: it is neither a string nor an integer.
        """
        if sample.get(self.id_key) is None:
            entries = ", ".join(map(str, sample)) or "nothing"
            raise ParameterError(
                f"the sample has no {self.id_key!r} entry (it has: {entries}); the id decides"
                " which corruption a sample gets, so give each sample one of its own, such as its"
                " row number; for pictures alone, id_from='content' derives it from the pixels"
            )
        return _id(sample[self.id_key])

    def keys(self, sample: Mapping[str, Any]) -> list[int | str]:
        """Return the ids of a batch.

        Raises:
            ParameterError: an id is empty.
            ParameterTypeError: an id is neither a string nor an integer.
        """
        return [_id(key) for key in sample[self.id_key]]

    def corrupt(
        self,
        sample: Mapping[str, Any],
        planner_entries: Mapping[str, Any],
        make_plan: Callable[[Size, list[SamplePicture]], Plan],
        *,
        seed: int | None,
        draws: Draws = NO_DRAWS,
        return_plan: bool | str = False,
    ) -> dict[str, Any]:
        """Return the entries of a sample that change when its pictures are corrupted.

        Args:
            sample: the entries of one sample.
            planner_entries: the same, as planners read them.
            make_plan: returns the plan for its pictures, of a size (height, width).
            seed: the seed of the plan, or `None` for a plan given by the user.
            draws: what the plan draws, which no earlier transform of the pictures may draw alike.
            return_plan: also return `plan`, as text with `"json"`, and `target_visible`.
        """
        pictures, unclear = find_pictures(sample, self.labels.is_picture)
        chain = check_chain(self.planner, draws, (picture.pixels for picture in pictures))
        plan = make_plan(common_size(pictures), pictures)
        new = corrupted_pixels(plan, pictures)
        note_chain(chain, new.values())
        keys = {picture.path[0] for picture in pictures}
        changes = {key: swapped(sample[key], new) for key in sample if key in keys}
        after = new[id(pictures[0].pixels)]
        entries = {**sample, **changes}
        changes |= self.follow(plan, entries, pictures[0].pixels, after, seed, unclear=unclear)
        if return_plan:
            changes |= self.plan_entries(plan, planner_entries, return_plan)
        return changes

    def follow(
        self,
        plan: Plan,
        sample: Mapping[str, Any],
        before: Any,
        after: Any,
        seed: int | None,
        skip: Collection[str] = (),
        unclear: Mapping[str, Any] | None = None,
    ) -> dict[str, Any]:
        """Return the entries of a sample, other than its pictures, that a plan changes.

        These are its labels and, in a dataset row, the columns that describe the corruption.
        `before` and `after` are its main picture, `seed` is as in `corrupt`; for `skip` and
        `unclear` see `Labels.follow`.
        """
        changes = self.labels.follow(plan, sample, {self.id_key, *skip}, unclear)
        if not is_row(sample):
            return changes
        location = self.labels.find_target(sample, plan.size)
        return {**changes, **corrupted_row(sample, plan, before, after, location, seed)}

    def plan_entries(
        self, plan: Plan, sample: Mapping[str, Any], return_plan: bool | str
    ) -> dict[str, Any]:
        """Return the entries `plan` and `target_visible`.

        The share is NaN without a target: a number in every sample, for batches and tables. Both
        are those of a row's earlier plan and this one.

        Raises:
            ParameterError: the sample has an entry `plan` that is another one.
        """
        earlier = None
        if is_row(sample):
            earlier = read_row_plan(sample, plan.size)
        elif sample.get("plan") is not None and sample["plan"] not in (plan, plan.to_json()):
            raise ParameterError(
                "the sample has an entry 'plan' already, and return_plan would put another in its"
                " place: put both transforms into one Sequence, or rename that entry"
            )
        location = self.labels.find_target(sample, plan.size)
        share = None if location is None else visible_after(earlier, plan, location)
        share = math.nan if share is None else share
        whole = plan if earlier is None else earlier.then(plan)
        return {
            "plan": whole.to_json() if return_plan == "json" else whole,
            "target_visible": share,
        }


def make_labels(labels: Declared | None, target: str | None, image_key: str | None) -> Labels:
    """Return the labels of a transform, with the entry `image_key` declared a picture.

    Raises:
        ParameterError: `labels` declares the entry as something else.
        ParameterTypeError: `image_key` is not a string.
    """
    if image_key is None:
        return Labels(labels, target)
    if not isinstance(cast(object, image_key), str):
        raise ParameterTypeError(f"image_key must be the name of an entry, got {image_key!r}")
    declarations = dict(labels or {})
    if find_format(declarations.get(image_key, PICTURE)).name != PICTURE:
        raise ParameterError(
            f"image_key={image_key!r} is the picture, but labels= declares it"
            f" {declarations[image_key]!r}; leave it out of labels="
        )
    return Labels({**declarations, image_key: PICTURE}, target)


def corrupted_pixels(plan: Plan, pictures: list[SamplePicture]) -> dict[int, Any]:
    """Return the corrupted pixels of each picture by the `id` of its object."""
    return {id(picture.pixels): apply_plan(plan, picture.pixels) for picture in pictures}


def check_names(sample: Mapping[Any, Any]) -> None:
    """Check that the names of a sample's entries are strings.

    Raises:
        ParameterTypeError: a name is not a string.
    """
    name = next((key for key in sample if not isinstance(key, str)), None)
    if name is not None:
        raise ParameterTypeError(f"the names of a sample's entries must be strings, got {name!r}")


def is_many(value: Any) -> bool:
    """Return whether an id entry holds several ids."""
    return isinstance(value, list | tuple) or bool(getattr(value, "ndim", 0))


def _id(value: Any) -> int | str:
    if isinstance(value, bytes):
        try:
            value = value.decode("utf-8")
        except UnicodeDecodeError:
            raise ParameterError(
                f"the id of a sample is no UTF-8 text, got {value!r:.80}; give value.hex()"
            ) from None
    if isinstance(value, str):
        if not value:
            raise ParameterError("the id of a sample is empty; give each sample one of its own")
        return str(value)
    if isinstance(value, bool) or is_many(value) or not hasattr(value, "__index__"):
        raise ParameterTypeError(
            f"the id of a sample must be a string or an integer, got {value!r}"
        )
    return int(value.__index__())


def scalar(value: Any, name: str, default: int) -> int:
    """Return an integer entry, or `default` if there is none.

    Raises:
        ParameterTypeError: the entry is not an integer.
    """
    if value is None:
        return default
    try:
        if not isinstance(value, bool):
            return int(value.__index__())
    except (AttributeError, TypeError):
        pass
    raise ParameterTypeError(f"{name} must be an integer, got {value!r}")
