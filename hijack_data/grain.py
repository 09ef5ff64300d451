"""Corruptions as Grain transforms, for JAX input pipelines: no TensorFlow, no global generator.

    import hijack_data.grain as hg
    dataset = grain.MapDataset.source(rows).shuffle(seed=1).map(hg.Corrupt(hj.OneOf([hj.PopUps(),
    hj.Marks()]), seed=3))

An element is a dictionary with pictures (NumPy `[H, W, 3]` uint8, PIL, or stacks and lists of
them; `hijack_data.sample_pictures`) and the entries that `hijack_data.samples` names. Both
transforms are safe to call from several threads, and the number of workers, their threads and a
restart from a checkpoint change nothing.

Epochs: Grain does not tell a `map` in which epoch an element comes. `Corrupt` takes the epoch from
the entry `epoch`, and warns when elements without one come a second time. `RandomCorrupt` draws
anew at each visit of an element without `epoch`, by Grain's generator, which depends on the place
of the visit in the whole run; so it does in each epoch of `MapDataset.repeat` and of a
`DataLoader`, and a run resumed in mid-epoch goes on as it would have.
"""

from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from . import extras
from .chained_draws import NO_DRAWS, find_draws
from .compose import sometimes
from .epochs import RepeatNotice
from .errors import ImageError, ParameterTypeError
from .labels import Declared
from .labels.dataset_rows import check_drawn
from .plan import Plan
from .planner import Planner
from .sample_pictures import read_once
from .samples import SamplePlanner, check_names, is_many, make_labels
from .types import Size

_grain: Any = extras.load("grain.python", "hijack_data.grain", "jax")


_REMEDY = (
    "put 'epoch' into the elements with map_with_index, as docs/training.md shows, or draw anew at"
    " each visit with RandomCorrupt; 'epoch': 0 says that the same corruptions are meant"
)


class _Settings:
    """The settings of both transforms; see `Corrupt` for the arguments."""

    def __init__(
        self,
        planner: Planner,
        *,
        seed: int = 0,
        label_policy: str = "keep",
        return_plan: bool = False,
        image_key: str | None = None,
        id_key: str = "id",
        p: float = 1.0,
        labels: Declared | None = None,
        target: str | None = None,
    ) -> None:
        declared_labels = make_labels(labels, target, image_key)
        self.settings = SamplePlanner(
            sometimes(planner, p), seed, label_policy, id_key, declared_labels
        )
        self.return_plan = return_plan
        self._draws = find_draws(self.settings.planner, self.settings.seed, id_key)
        self._repeats = RepeatNotice(_REMEDY)

    def corrupt(self, element: Any, rng: np.random.Generator | None = None) -> dict[str, Any]:
        """Return a corrupted copy of an element; Grain's generator `rng` counts its visits.

        Raises:
            ParameterTypeError: the element is not a dictionary, or a name in it is not a string.
            ImageError: the element has several ids, or its pictures cannot be corrupted.
        """
        if not isinstance(element, Mapping):
            raise ParameterTypeError(
                f"an element must be a dictionary, got {type(element).__name__}"
            )
        entries: dict[str, Any] = read_once(dict(cast("Mapping[str, Any]", element)))
        check_names(entries)
        check_drawn(entries)
        if is_many(entries.get(self.settings.id_key)):
            raise ImageError("an element has one id, got several; corrupt before batching")
        is_keyed = all(entries.get(key) is not None for key in (self.settings.id_key, "epoch"))
        changes = self.settings.corrupt(
            entries,
            entries,
            lambda size, _: self._plan(size, entries, rng),
            seed=self.settings.seed,
            draws=self._draws if rng is None or is_keyed else NO_DRAWS,
            return_plan=self.return_plan,
        )
        return {**entries, **changes}

    def _plan(
        self, size: Size, element: Mapping[str, Any], rng: np.random.Generator | None
    ) -> Plan:
        if rng is None:
            key = self.settings.key(element)
            if element.get("epoch") is None:
                self._repeats.note(key, element.get("step"))
            return self.settings.plan(size, element, key)
        has_id = element.get(self.settings.id_key) is not None
        if has_id and element.get("epoch") is not None:
            return self.settings.plan(size, element, self.settings.key(element))
        visit = f"rng-{int(rng.integers(2**63))}"
        key = f"{self.settings.key(element)}\0{visit}" if has_id else visit
        return self.settings.plan(size, element, key)


class Corrupt(_Settings, _grain.MapTransform):
    """Corrupts each element by its id, the seed and its epoch, which is 0 without an entry `epoch`.

    Args:
        planner: a corruption, `OneOf`, `Sequence` or `Schedule`.
        seed: 0 to 2**64 - 1.
        label_policy: `"keep"`; or `"avoid"` to draw again until the target (of a drag, both ends)
            is visible, and to leave the element clean if no draw succeeds.
        return_plan: put the plan under `"plan"` and the visible share of the target, 0..1, under
            `"target_visible"` (for a drag, the lesser share of its two ends; NaN without a
            target).
        image_key: name of an entry that holds the picture, if it has no name of a picture.
        id_key: name of the entry that holds the id.
        p: probability that an element is corrupted at all, 0..1.
        labels: which entries are labels, and in which format, such as `{"bbox": "xywh"}`; see
            `hijack_data.labels`.
        target: the declared entry that must stay visible; see `hijack_data.labels.Labels`.

    Raises:
        ParameterError: a value is out of its range.
        ParameterTypeError: a value has the wrong type, or `planner` plans nothing.

    Examples:
        >>> rows = [{"image": np.zeros((1080, 1920, 3), np.uint8), "id": "traj-3/0"}]
        >>> dataset = grain.MapDataset.source(rows).map(hg.Corrupt(hj.Marks(), seed=3))
        >>> dataset[0]["image"].shape  # uint8 [H, W, 3]
        (1080, 1920, 3)
    """

    def map(self, element: Any) -> dict[str, Any]:
        """Return a corrupted copy of an element; `ParameterError` for an element without an id."""
        return self.corrupt(element)


class RandomCorrupt(_Settings, _grain.RandomMapTransform):
    """Corrupts each element anew at each visit, by Grain's generator and its id.

    An element with an id and an entry `epoch` is corrupted as by `Corrupt`.

    Args:
        planner: a corruption, `OneOf`, `Sequence` or `Schedule`.
        seed: 0 to 2**64 - 1.
        label_policy: `"keep"`; or `"avoid"` to draw again until the target (of a drag, both ends)
            is visible, and to leave the element clean if no draw succeeds.
        return_plan: put the plan under `"plan"` and the visible share of the target, 0..1, under
            `"target_visible"` (for a drag, the lesser share of its two ends; NaN without a
            target).
        image_key: name of an entry that holds the picture, if it has no name of a picture.
        id_key: name of the entry that holds the id.
        p: probability that an element is corrupted at all, 0..1.
        labels: which entries are labels, and in which format, such as `{"bbox": "xywh"}`; see
            `hijack_data.labels`.
        target: the declared entry that must stay visible; see `hijack_data.labels.Labels`.

    Raises:
        ParameterError: a value is out of its range.
        ParameterTypeError: a value has the wrong type, or `planner` plans nothing.

    Examples:
        >>> rows = [{"image": np.zeros((1080, 1920, 3), np.uint8)}]
        >>> dataset = grain.MapDataset.source(rows).seed(1)
        >>> dataset = dataset.random_map(hg.RandomCorrupt(hj.Marks()))
        >>> dataset[0]["image"].shape  # uint8 [H, W, 3]
        (1080, 1920, 3)
    """

    def random_map(self, element: Any, rng: np.random.Generator) -> dict[str, Any]:
        """Return a corrupted copy of an element."""
        return self.corrupt(element, rng)
