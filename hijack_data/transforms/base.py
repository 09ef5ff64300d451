"""The base of all transforms: it finds the picture and the id of a sample, plans and applies."""

import importlib
from collections.abc import Mapping
from typing import Any, cast

import numpy as np
import torch
from torch.utils import _pytree

from ..compose import sometimes
from ..errors import ImageError, ParameterError
from ..labels import Declared, Labels
from ..labels.declared import OWN
from ..labels.rows import check_drawn
from ..plan import Plan
from ..planner import Planner
from ..samples import SamplePlanner, is_many, scalar
from ..types import Size
from .leaves import (
    FOLLOWING,
    DatasetRow,
    changed_entries,
    check_beside,
    check_orders,
    content,
    corrupt,
    each_of,
    entries_of,
    follow_inside,
    follow_tensor,
    pictures_of,
    plain,
    put,
    size_of,
    tv_tensors,
    v2,
)

# torch's trees of samples, which torchvision's own transforms use, are not typed
_tree: Any = _pytree


def _keep(plans: list[Plan], *, collate_fn_map: object = None) -> list[Plan]:
    """Collate plans: make torch's default collate return the plans of a batch as a list."""
    return list(plans)


# torch documents this registry as the way to extend collating
_collate: Any = importlib.import_module("torch.utils.data._utils.collate")
_collate.default_collate_fn_map[Plan] = _keep

# Entries that are set aside while the rest of a sample is searched for pictures and boxes.
_ASIDE = (*OWN, "id", "step", "epoch", "plan")


class Corrupt(v2.Transform):
    """Corrupts each sample as a planner decides.

    Args:
        planner: a corruption, a combinator, or another transform of this module.
        seed: 0 to 2**64 - 1.
        id_from: `"entry"` takes the sample's id from its entry `id_key`; `"content"` derives it
            from the pixels, for pictures that come alone: the same picture then gets the same
            corruption until `set_epoch` is called.
        label_policy: `"keep"`, or `"avoid"` to draw again until the sample's target (of a drag,
            both ends) is visible, and to leave it clean if no draw succeeds.
        return_plan: put the plan under `"plan"` and the visible share of the target, if any, under
            `"target_visible"` (of a drag, the lesser share of both ends); with `"json"` the plan is
            text, which a dataset can store.
        id_key: name of the entry that holds the id.
        p: probability that a sample is corrupted at all, 0..1.
        labels: which entries of a sample are labels, and in which format, such as `{"bbox": "xywh",
            "objects.points": "xy01", "action": "openai", "note": "leave"}`; see
            `hijack_data.labels`.
        target: the declared entry that must stay visible; see `hijack_data.labels.Labels`.

    Raises `ParameterError`, `ImageError` or `ImageTypeError` for a sample that cannot be corrupted,
    and `LabelError` if a plan moves pixels and an undeclared entry could be a label, or a label
    cannot follow.
    """

    seeded = True  # whether plans are drawn from the seed; those of `Replay` are given

    def __init__(
        self,
        planner: "Planner | Corrupt",
        *,
        seed: int = 0,
        id_from: str = "entry",
        label_policy: str = "keep",
        return_plan: bool | str = False,
        id_key: str = "id",
        p: float = 1.0,
        labels: Declared | None = None,
        target: str | None = None,
    ) -> None:
        super().__init__()  # pyright: ignore[reportUnknownMemberType]
        if id_from not in ("entry", "content"):
            raise ParameterError(f"id_from must be entry or content, got {id_from!r}")
        if return_plan not in (True, False, "json"):
            raise ParameterError(f"return_plan must be True, False or 'json', got {return_plan!r}")
        chosen = sometimes(planner_of(planner), p)
        known = Labels(labels, target)
        self.settings = SamplePlanner(chosen, scalar(seed, "seed", 0), label_policy, id_key, known)
        self.id_from = id_from
        self.return_plan = return_plan
        self._epoch: torch.Tensor = torch.zeros(
            1, dtype=torch.int64
        ).share_memory_()  # shared, so that DataLoader workers see changes

    def set_epoch(self, epoch: int) -> None:
        """Set the epoch of samples without an `epoch` entry; running workers see it, too."""
        self._epoch[0] = scalar(epoch, "epoch", 0)

    def extra_repr(self) -> str:
        """Return the planner and the seed, for `repr`."""
        return f"{self.settings.planner}, seed={self.settings.seed}"

    def forward(self, *inputs: Any) -> Any:
        """Corrupt one sample or batch; the input is never modified."""
        sample = _as_dict(inputs[0]) if len(inputs) == 1 else inputs
        check_drawn(entries_of(sample))
        check_orders(entries_of(sample), self.settings.labels)
        aside, rest = _split(sample, self.settings.labels)
        paths, spec = _tree.tree_flatten_with_path(rest)
        leaves = [leaf for _, leaf in paths]
        places = pictures_of(paths)
        pictures = [leaves[i] for i in places]
        entries = entries_of(sample)
        known = plain(entries)
        sizes = [size_of(picture) for picture in pictures]
        rows = self._rows(pictures, known, places, paths)
        plans = self._plans(pictures, sizes, known, rows)
        corrupt(leaves, places, plans if rows else plans * len(places))
        for i, leaf in enumerate(leaves):
            if isinstance(leaf, FOLLOWING):
                leaves[i] = follow_tensor(leaf, plans)
        check_beside(sample, plans)
        each = _each_picture(pictures, [leaves[i] for i in places], rows)
        out = _tree.tree_unflatten(leaves, spec)
        if aside:
            out = {key: aside[key] if key in aside else out[key] for key in sample}
        unpictured = {k: v for k, v in known.items() if not _is_picture(v, pictures)}
        changes = changed_entries(
            plans,
            unpictured,
            rows,
            each,
            self.settings.labels,
            seed=self.settings.seed if self.seeded else None,
            return_plan=self.return_plan,
        )
        tensors = [k for k in changes if isinstance(entries.get(k), tv_tensors.TVTensor)]
        out = put(out, {k: v for k, v in changes.items() if k not in tensors})
        for key in aside.keys() - self.settings.labels.left:
            out[key] = follow_inside(out[key], plans)
        return out

    def _rows(
        self,
        pictures: list[Any],
        entries: DatasetRow,
        places: list[int],
        paths: list[tuple[Any, Any]],
    ) -> list[DatasetRow] | None:
        """Return the entries for each picture of a batch, or `None` for a single sample.

        Raises:
            ImageError: the batch consists of several tensors.
        """
        count = int(np.prod(tuple(pictures[0].shape[:-3]))) if hasattr(pictures[0], "shape") else 1
        many = is_many(entries.get(self.settings.id_key))
        if not (many or (count > 1 and not isinstance(pictures[0], tv_tensors.Video))):
            return None
        if len(pictures) > 1 and count > 1:
            raise ImageError(
                "a batch is one tensor [B, 3, H, W] or a list of pictures; this sample holds"
                " several tensors"
            )
        count *= len(pictures)
        named = {getattr(paths[place][0][0], "key", None) for place in places if paths[place][0]}
        columns = {
            key: self._column(key, value, count)
            for key, value in entries.items()
            if key not in named
        }
        return [{key: column[i] for key, column in columns.items()} for i in range(count)]

    def _column(self, key: str, value: Any, count: int) -> list[Any]:
        """Return an entry of a batch as one value for each picture.

        A value that is not a list of `count` items applies to all pictures.
        """
        labels = {path.partition(".")[0] for path in self.settings.labels.declared}
        if key in (*OWN, "step", "epoch") or key in labels:
            return [None] * count if value is None else each_of(value, count, key)
        if isinstance(value, tv_tensors.TVTensor) or not is_many(value) or len(value) != count:
            return [value] * count
        return list(value)

    def _plans(
        self,
        pictures: list[Any],
        sizes: list[Size],
        entries: DatasetRow,
        rows: list[DatasetRow] | None,
    ) -> list[Plan]:
        epoch = int(self._epoch.item())
        if rows is None and len(set(sizes)) > 1:
            raise ImageError(
                f"the pictures of one sample differ in size: {sorted(set(sizes))}; give a list"
                " of ids"
            )
        count = None if rows is None else len(rows)
        if self.id_from == "content":
            each = list(pictures[0]) if rows and len(pictures) == 1 else pictures
            keys = [content(picture) for picture in (each if rows else each[:1])]
        else:
            keys = self.settings.key(entries, batch=count)
        if rows is None:
            return [self.make_plan(sizes[0], entries, keys[0], epoch)]
        sizes = sizes * (len(rows) // len(sizes))
        return [
            self.make_plan(s, row, key, epoch)
            for s, row, key in zip(sizes, rows, keys, strict=True)
        ]

    def make_plan(self, size: Size, row: DatasetRow, key: int | str, epoch: int) -> Plan:
        """Return the plan for one picture of `size` with the id `key`.

        `row` holds the entries that describe it.
        """
        return self.settings.plan(size, row, key, epoch)


def _as_dict(sample: Any) -> Any:
    """Return a mapping of any kind, such as a row of `datasets`, as a dictionary.

    Any other value is returned unchanged.
    """
    if not isinstance(sample, Mapping) or type(cast(object, sample)) is dict:
        return cast(Any, sample)
    return dict(cast("Mapping[str, Any]", sample))


def _split(sample: Any, labels: Labels) -> tuple[dict[str, Any], Any]:
    """Return the entries of a dictionary that are set aside, and the rest of the sample."""
    if type(sample) is not dict:
        return {}, sample
    entries = cast("dict[str, Any]", sample)
    names = {*_ASIDE, *(path.partition(".")[0] for path in labels.declared)}
    aside = {
        k: v
        for k, v in entries.items()
        if k in labels.left or (k in names and not isinstance(v, tv_tensors.TVTensor))
    }
    return aside, {k: v for k, v in entries.items() if k not in aside}


def _is_picture(value: Any, pictures: list[Any]) -> bool:
    """Return whether an entry is the picture, or a list of the pictures."""
    parts = cast("list[Any]", value) if isinstance(value, list | tuple) else [value]
    return any(part is picture for part in parts for picture in pictures)


def _each_picture(
    before: list[Any], after: list[Any], rows: list[DatasetRow] | None
) -> list[tuple[Any, Any]]:
    """Return the pictures for which plans were made as pairs of before and after."""
    if rows is None:
        return [(before[0], after[0])]
    if len(before) == len(rows):
        return list(zip(before, after, strict=True))
    return list(zip(list(before[0]), list(after[0]), strict=True))


def planner_of(value: "Planner | Corrupt") -> Planner:
    """Return the planner of a value, which is a planner or a transform."""
    return value.settings.planner if isinstance(value, Corrupt) else value
