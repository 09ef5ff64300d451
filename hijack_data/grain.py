"""Corruptions as Grain transforms, for JAX input pipelines: no TensorFlow, no global generator.

    import hijack_data.grain as hg
    dataset = grain.MapDataset.source(rows).shuffle(seed=1).map(hg.Corrupt(hj.OneOf([hj.PopUps(),
    hj.Marks()]), seed=3))

An element is a dictionary with a picture (NumPy `[H, W, 3]` uint8 or a PIL image) and the entries
that `hijack_data.samples` names. Its id, the seed and the epoch decide what happens to it, so that
the number of workers, their threads and a restart from a checkpoint change nothing. Both transforms
are safe to call from several threads.
"""

from collections.abc import Mapping
from typing import Any, cast

import numpy as np
from PIL import Image

from . import extras
from ._apply import apply
from .backends import backend_of
from .compose import sometimes
from .errors import ImageError, ParameterTypeError
from .labels import Declared, Labels
from .labels.rows import check_drawn
from .plan import Plan
from .planner import Planner
from .samples import SamplePlanner, follow, visible_in
from .types import Size

_grain: Any = extras.load("grain.python", "hijack_data.grain", "jax")


class _Settings:
    """The settings of both transforms.

    Args:
        planner: a corruption, `OneOf`, `Sequence` or `Schedule`.
        seed: 0 to 2**64 - 1.
        label_policy: `"keep"`; or `"avoid"` to draw again until the target (of a drag, both ends)
            is visible, and to leave the element clean if no draw succeeds.
        return_plan: put the plan under `"plan"` and the visible share of the target, if any, under
            `"target_visible"`; for a drag, the lesser share of its two ends.
        image_key: name of the entry that holds the picture; by default `image`, or `screenshot`,
            as in the rows of a dataset.
        id_key: name of the entry that holds the id.
        p: probability that an element is corrupted at all, 0..1.
        labels: which entries are labels, and in which format, such as `{"bbox": "xywh"}`; see
            `hijack_data.labels`.
        target: the declared entry that must stay visible; see `hijack_data.labels.Labels`.
    """

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
        self.settings = SamplePlanner(
            sometimes(planner, p), seed, label_policy, id_key, Labels(labels, target)
        )
        self.return_plan = return_plan
        self.image_key = image_key

    def plan(self, element: Mapping[str, Any], key: int | str | None = None) -> Plan:
        """Return the plan for an element; `key` replaces the id of an element without one."""
        size = self._size(element)
        known = element.get(self.settings.id_key) is not None or key is None
        return self.settings.plan(
            size, element, self.settings.key(element)[0] if known else cast("int | str", key)
        )

    def corrupt(self, element: Mapping[str, Any], plan: Plan) -> dict[str, Any]:
        """Return a corrupted copy of an element."""
        key = self._image_key(element)
        picture = apply(plan, element[key])
        entries = {name: value for name, value in element.items() if name != key}
        labels = self.settings.labels
        out = {
            **element,
            key: picture,
            **follow(plan, entries, element[key], picture, labels, self.settings.seed),
        }
        if self.return_plan:
            out["plan"] = plan
            if (seen := visible_in(plan, entries, labels)) is not None:
                out["target_visible"] = seen
        return out

    def _image_key(self, element: Mapping[str, Any]) -> str:
        """Return the name of the entry that holds the picture."""
        names = ("image", "screenshot") if self.image_key is None else (self.image_key,)
        found = [name for name in names if name in element]
        if not found:
            have = ", ".join(map(str, element))
            raise ImageError(
                f"the element has no {names[0]!r} entry; it has {have}; image_key= names the"
                " picture"
            )
        if len(found) > 1:  # the other picture would stay clean
            raise ImageError(
                f"the element has {' and '.join(map(repr, found))}; image_key= says which of them"
                " is corrupted"
            )
        return found[0]

    def _size(self, element: object) -> Size:
        if not isinstance(element, Mapping):
            raise ParameterTypeError(
                f"an element must be a dictionary, got {type(element).__name__}"
            )
        entries = cast("Mapping[str, Any]", element)
        check_drawn(entries)
        image = entries[self._image_key(entries)]
        if isinstance(image, Image.Image):
            return image.height, image.width
        backend_of(image).check(image)
        if len(image.shape) != 3:
            raise ImageError(
                f"an element holds one picture, got shape {list(image.shape)}; corrupt before"
                " batching"
            )
        return backend_of(image).size(image)


class Corrupt(_Settings, _grain.MapTransform):
    __doc__ = f"Corrupts each element, which must have an id.\n{_Settings.__doc__}"

    def map(self, element: Any) -> dict[str, Any]:
        """Return the corrupted element; the one given is not modified.

        Raises `ParameterError` for an element without an id.
        """
        return self.corrupt(element, self.plan(element))


class RandomCorrupt(_Settings, _grain.RandomMapTransform):
    __doc__ = (
        "Corrupts each element by its id, or by Grain's generator where it has"
        f" none.\n{_Settings.__doc__}"
    )

    def random_map(self, element: Any, rng: np.random.Generator) -> dict[str, Any]:
        """Return the corrupted element; the one given is not modified."""
        return self.corrupt(element, self.plan(element, f"rng-{int(rng.integers(2**63))}"))
