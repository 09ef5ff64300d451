"""The transform that all others are: finds the picture and the id of a sample, plans, applies."""

import importlib
from typing import Any, cast

import numpy as np
import torch
from torch.utils import _pytree

from ..errors import ImageError, ParameterError
from ..plan import Plan
from ..safety import Planner
from ..samples import SamplePlanner, is_many, scalar
from ..types import Size
from .leaves import (
    FOLLOWING,
    Row,
    changed_entries,
    content,
    corrupt,
    each_of,
    entries_of,
    follow_tensor,
    pictures_of,
    plain,
    put,
    size_of,
    tv_tensors,
    v2,
)

_tree: Any = _pytree  # torch's trees of samples, which torchvision's own transforms use, are not typed


def _keep(plans: list[Plan], *, collate_fn_map: object = None) -> list[Plan]:
    """Collate plans: torch's default collate keeps those of a batch as a list."""
    return list(plans)


_collate: Any = importlib.import_module("torch.utils.data._utils.collate")  # where torch documents the extension
_collate.default_collate_fn_map[Plan] = _keep

# Entries that are set aside while the rest of a sample is searched for pictures and boxes.
_ASIDE = ("id", "step", "epoch", "target", "elements", "action", "action_code", "plan")


class Corrupt(v2.Transform):
    """Corrupts each sample as a planner decides.

    Args:
        planner: a corruption, a combinator, or another transform of this module.
        seed: 0 to 2**64 - 1.
        id_from: `"entry"` takes the sample's id from its entry `id_key`; `"content"` derives it from the pixels, for
            pictures that come alone: the same picture then gets the same corruption until `set_epoch` is called.
        label_policy: `"keep"`, or `"avoid"` to draw again until the sample's target shows, and with it the end of its
            action where that is a drag, else leave it clean.
        return_plan: put the plan under `"plan"`, and with a target its visible share, or that of a drag's end if less,
            under `"target_visible"`.
        id_key: name of the entry that holds the id.

    Raises `ParameterError`, `ImageError` or `ImageTypeError` for a sample that cannot be corrupted.
    """

    def __init__(
        self,
        planner: "Planner | Corrupt",
        *,
        seed: int = 0,
        id_from: str = "entry",
        label_policy: str = "keep",
        return_plan: bool = False,
        id_key: str = "id",
    ) -> None:
        super().__init__()  # pyright: ignore[reportUnknownMemberType]
        if id_from not in ("entry", "content"):
            raise ParameterError(f"id_from must be entry or content, got {id_from!r}")
        self.settings = SamplePlanner(planner_of(planner), scalar(seed, "seed", 0), label_policy, id_key)
        self.id_from, self.return_plan = id_from, return_plan
        self._epoch: torch.Tensor = torch.zeros(
            1, dtype=torch.int64
        ).share_memory_()  # DataLoader workers see it change

    def set_epoch(self, epoch: int) -> None:
        """Set the epoch of samples that carry none; workers that are already running see it, too."""
        self._epoch[0] = scalar(epoch, "epoch", 0)

    def extra_repr(self) -> str:
        """The planner and the seed."""
        return f"{self.settings.planner}, seed={self.settings.seed}"

    def forward(self, *inputs: Any) -> Any:
        """Corrupt one sample or batch; the input is never modified."""
        sample = inputs[0] if len(inputs) == 1 else inputs
        aside, rest = _split(sample)
        paths, spec = _tree.tree_flatten_with_path(rest)
        leaves = [leaf for _, leaf in paths]
        places = pictures_of(paths)
        pictures, entries = [leaves[i] for i in places], entries_of(sample)
        known = plain(entries)
        sizes = [size_of(picture) for picture in pictures]
        rows = self._rows(pictures, known)
        plans = self._plans(pictures, sizes, known, rows)
        corrupt(leaves, places, plans if rows else plans * len(places))
        for i, leaf in enumerate(leaves):
            if isinstance(leaf, FOLLOWING):
                leaves[i] = follow_tensor(leaf, plans)
        out = _tree.tree_unflatten(leaves, spec)
        out = {key: aside[key] if key in aside else out[key] for key in sample} if aside else out
        changes = changed_entries(plans, known, rows, self.return_plan)
        return put(out, {k: v for k, v in changes.items() if not isinstance(entries.get(k), tv_tensors.TVTensor)})

    def _rows(self, pictures: list[Any], entries: Row) -> list[Row] | None:
        """Return what a batch says about each of its pictures, or `None` when the sample is a single one."""
        count = int(np.prod(tuple(pictures[0].shape[:-3]))) if hasattr(pictures[0], "shape") else 1
        many = is_many(entries.get(self.settings.id_key))
        if not (many or (count > 1 and not isinstance(pictures[0], tv_tensors.Video))):
            return None
        if len(pictures) > 1 and count > 1:
            raise ImageError(
                "a batch is one tensor [B, 3, H, W] or a list of pictures; this sample holds several tensors"
            )
        count *= len(pictures)
        names = [key for key in ("target", "elements", "step", "epoch", "action", "action_code") if key in entries]
        columns = {key: each_of(entries[key], count, key) for key in names}
        return [{key: column[i] for key, column in columns.items()} for i in range(count)]

    def _plans(self, pictures: list[Any], sizes: list[Size], entries: Row, rows: list[Row] | None) -> list[Plan]:
        epoch = int(self._epoch.item())
        if rows is None and len(set(sizes)) > 1:
            raise ImageError(f"the pictures of one sample differ in size: {sorted(set(sizes))}; give a list of ids")
        count = None if rows is None else len(rows)
        if self.id_from == "content":
            each = list(pictures[0]) if rows and len(pictures) == 1 else pictures
            keys = [content(picture) for picture in (each if rows else each[:1])]
        else:
            keys = self.settings.key(entries, batch=count)
        if rows is None:
            return [self.make_plan(sizes[0], entries, keys[0], epoch)]
        sizes = sizes * (len(rows) // len(sizes))
        return [self.make_plan(s, row, key, epoch) for s, row, key in zip(sizes, rows, keys, strict=True)]

    def make_plan(self, size: Size, row: Row, key: int | str, epoch: int) -> Plan:
        """Return the plan for one picture of `size` with the id `key`; `row` are the entries that describe it."""
        return self.settings.plan(size, row, key, epoch)


def _split(sample: Any) -> tuple[dict[str, Any], Any]:
    """Return the entries of a dictionary that are set aside, and the rest of the sample."""
    if type(sample) is not dict:
        return {}, sample
    entries = cast("dict[str, Any]", sample)
    aside = {k: v for k, v in entries.items() if k in _ASIDE and not isinstance(v, tv_tensors.TVTensor)}
    return aside, {k: v for k, v in entries.items() if k not in aside}


def planner_of(value: "Planner | Corrupt") -> Planner:
    """Return what plans: the planner itself, or that of a transform."""
    return value.settings.planner if isinstance(value, Corrupt) else value
