"""The base of all transforms: it takes a sample or batch apart, plans and applies."""

from __future__ import annotations

import importlib
from typing import Any, cast

import torch

from ..chained_draws import check_chain, find_draws, note_chain
from ..compose import sometimes
from ..epochs import RepeatNotice
from ..errors import ParameterError
from ..labels import Declared
from ..labels.dataset_rows import check_drawn
from ..labels.label_declarations import FIXED_ENTRIES
from ..labels.torchvision_labels import follow_tensor, v2
from ..plan import Plan
from ..planner import Planner
from ..sample_pictures import (
    FOLLOWING,
    SamplePicture,
    common_size,
    find_pictures,
    is_tensor,
    swapped,
)
from ..samples import SamplePlanner, corrupted_pixels, is_many, make_labels, scalar
from ..types import Size
from .sample_parts import (
    DatasetRow,
    apply_to_array,
    batch_length,
    check_pictures,
    joined,
    plain,
    sample_content_id,
    unpack,
    value_per_picture,
)


def _keep(plans: list[Plan], *, collate_fn_map: object = None) -> list[Plan]:
    """Collate plans: make torch's default collate return the plans of a batch as a list."""
    return list(plans)


# torch documents this registry as the way to extend collating
_collate: Any = importlib.import_module("torch.utils.data._utils.collate")
_collate.default_collate_fn_map[Plan] = _keep

_REMEDY = (
    "call transform.set_epoch(epoch) before each epoch, put 'epoch' into the samples, or call"
    " set_epoch(0) once if the same corruptions are meant"
)


# torch.compile runs a transform as it is, because a corruption is planned on the host
_outside_of_graphs: Any = cast(Any, torch.compiler).disable


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
        return_plan: put the plan under `"plan"` and the visible share of the target under
            `"target_visible"` (of a drag, the lesser share of both ends; NaN without a target);
            with `"json"` the plan is text, which a dataset can store.
        id_key: name of the entry that holds the id.
        image_key: name of an entry that holds the picture, if none of `PICTURE_KEYS` is its name.
        p: probability that a sample is corrupted at all, 0..1.
        labels: which entries of a sample are labels, and in which format, such as `{"bbox": "xywh",
            "objects.points": "xy01", "action": "openai", "note": "leave"}`; see
            `hijack_data.labels`.
        target: the declared entry that must stay visible; see `hijack_data.labels.Labels`.

    A call takes one sample or a batch and returns a corrupted copy; see the module for the pictures
    and labels that a sample may hold. It raises `ParameterError`, `ImageError` or `ImageTypeError`
    for a sample that cannot be corrupted, and `LabelError` if an entry has the shape of a picture
    and is not known as one, if a plan moves pixels and entries are neither harmless nor declared,
    or if a label cannot follow.

    Raises:
        ParameterError: a value is out of its range, or an inner transform has settings of its own.
        ParameterTypeError: a value has the wrong type, or `planner` plans nothing.

    Examples:
        >>> corrupt = tr.Corrupt(hj.Marks(number=100), seed=3, label_policy="avoid")
        >>> sample = {"image": image, "id": "traj-3/0", "target": (220, 65)}
        >>> corrupt(sample)["image"].shape  # uint8 [3, H, W]
        torch.Size([3, 1080, 1920])
    """

    seeded = True  # whether plans are drawn from the seed; those of `Replay` are given

    def __init__(
        self,
        planner: Planner | Corrupt,
        *,
        seed: int = 0,
        id_from: str = "entry",
        label_policy: str = "keep",
        return_plan: bool | str = False,
        id_key: str = "id",
        image_key: str | None = None,
        p: float = 1.0,
        labels: Declared | None = None,
        target: str | None = None,
    ) -> None:
        super().__init__()  # pyright: ignore[reportUnknownMemberType]
        if id_from not in ("entry", "content"):
            raise ParameterError(f"id_from must be entry or content, got {id_from!r}")
        if return_plan not in (True, False, "json"):
            raise ParameterError(f"return_plan must be True, False or 'json', got {return_plan!r}")
        acting = sometimes(unwrap_planner(planner), p)
        label_set = make_labels(labels, target, image_key)
        self.settings = SamplePlanner(
            acting, scalar(seed, "seed", 0), label_policy, id_key, label_set
        )
        self.id_from = id_from
        ids = id_key if id_from == "entry" else f"the {id_from}"
        self._draws = find_draws(acting, self.settings.seed, ids)
        self.image_key = image_key
        self.return_plan = return_plan
        self._epoch: torch.Tensor = torch.zeros(
            1, dtype=torch.int64
        ).share_memory_()  # shared, so that DataLoader workers see changes
        self._repeats = RepeatNotice(_REMEDY)

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Share the epoch of a copy with workers, as that of the original is."""
        super().__setstate__(state)  # pyright: ignore[reportUnknownMemberType]
        self._epoch.share_memory_()

    def set_epoch(self, epoch: int) -> None:
        """Set the epoch of samples without an `epoch` entry; running workers see it, too."""
        self._epoch[0] = scalar(epoch, "epoch", 0)
        self._repeats.stop()

    def extra_repr(self) -> str:
        """Return the planner and the seed, for `repr`."""
        return f"{self.settings.planner}, seed={self.settings.seed}"

    @_outside_of_graphs
    def forward(self, *inputs: Any) -> Any:
        """Corrupt one sample or batch; the input is never modified."""
        entries, rebuild = unpack(inputs[0] if len(inputs) == 1 else inputs)
        check_drawn(entries)
        count = self._count(entries)
        if count is not None:
            return rebuild({**entries, **self._corrupt_batch(entries, count)})
        readable = plain(entries)
        changes = self.settings.corrupt(
            entries,
            readable,
            lambda size, pictures: self._plan(size, readable, pictures),
            seed=self._seed,
            draws=self._draws,
            return_plan=self.return_plan,
        )
        return rebuild({**entries, **changes})

    @property
    def _seed(self) -> int | None:
        return self.settings.seed if self.seeded else None

    def _count(self, entries: DatasetRow) -> int | None:
        """Return how many samples a batch holds; `None` for a single sample."""
        if self.id_from == "content":
            return batch_length(entries, find_pictures(entries, self.settings.labels.is_picture)[0])
        ids: Any = entries.get(self.settings.id_key)
        return len(ids) if is_many(ids) else None

    def _corrupt_batch(self, entries: DatasetRow, count: int) -> dict[str, Any]:
        """Return the entries of a batch that change: each row as if it were alone."""
        labels = self.settings.labels
        of_batch, _ = find_pictures(entries, labels.is_picture)
        arrays = check_pictures(entries, of_batch, count)
        pixels = (picture.pixels for picture in of_batch)
        chain = check_chain(self.settings.planner, self._draws, pixels)
        shared = {key for key, value in entries.items() if is_tensor(value, *FOLLOWING)}
        readable = plain(entries)
        rows = self._rows(readable, count, {picture.path[0] for picture in of_batch})
        pictures = [find_pictures(row, labels.is_picture) for row in rows]
        plans = [
            self._plan(common_size(row_pictures), row, row_pictures)
            for row, (row_pictures, _) in zip(rows, pictures, strict=True)
        ]
        changes: dict[str, Any] = {
            key: follow_tensor(entries[key], plans) for key in shared - labels.unchanged_paths
        }
        changes |= {key: apply_to_array(plans, entries[key]) for key in arrays}
        changed_rows: list[dict[str, Any]] = []
        for i, (plan, row, (row_pictures, unclear)) in enumerate(
            zip(plans, rows, pictures, strict=True)
        ):
            new = corrupted_pixels(plan, [p for p in row_pictures if p.path[0] not in arrays])
            keys = {picture.path[0] for picture in row_pictures} - set(arrays)
            out = {key: swapped(row[key], new) for key in keys}
            main = row_pictures[0]
            after = new.get(id(main.pixels))
            if after is None:
                after = changes[main.path[0]][i]
            out |= self.settings.follow(
                plan, {**row, **out}, main.pixels, after, self._seed, shared, unclear
            )
            if self.return_plan:
                out |= self.settings.plan_entries(plan, row, self.return_plan)
            changed_rows.append(out)
        for key in dict.fromkeys(key for out in changed_rows for key in out):
            values = [
                out.get(key, row.get(key)) for out, row in zip(changed_rows, rows, strict=True)
            ]
            changes[key] = joined(values, entries.get(key))
        of_batch, _ = find_pictures({**entries, **changes}, labels.is_picture)
        note_chain(chain, (picture.pixels for picture in of_batch))
        return changes

    def _rows(self, entries: DatasetRow, count: int, pictures: set[str]) -> list[DatasetRow]:
        """Return the entries of each sample of a batch.

        Raises:
            ParameterError: two samples have the same id, step and epoch.
        """
        columns = {
            key: list(value) if key in pictures else self._column(key, value, count)
            for key, value in entries.items()
        }
        rows: list[DatasetRow] = [
            {key: column[i] for key, column in columns.items()} for i in range(count)
        ]
        if self.id_from == "content" or not self.seeded:
            return rows
        keys = [
            (str(key), scalar(row.get("step"), "step", 0), scalar(row.get("epoch"), "epoch", 0))
            for key, row in zip(self.settings.keys(entries), rows, strict=True)
        ]
        twice = next((key for key in keys if keys.count(key) > 1), None)
        if twice is not None:
            raise ParameterError(
                f"ids: {twice[0]!r} appears twice; samples with one id get one plan, make ids"
                " unique"
            )
        return rows

    def _column(self, key: str, value: Any, count: int) -> list[Any]:
        """Return an entry of a batch as one value for each picture.

        A value that is not a list of `count` items applies to all pictures.
        """
        labels = {path.partition(".")[0] for path in self.settings.labels.formats}
        if key in (*FIXED_ENTRIES, "step", "epoch") or (
            key in labels and key not in self.settings.labels.unchanged_paths
        ):
            return [None] * count if value is None else value_per_picture(value, count, key)
        if is_tensor(value, *FOLLOWING) or not is_many(value) or len(value) != count:
            return [value] * count
        return list(value)

    def _plan(self, size: Size, row: DatasetRow, pictures: list[SamplePicture]) -> Plan:
        """Return the plan for the pictures, all of one `size`, of one sample."""
        if self.id_from == "content":
            key: int | str = sample_content_id(pictures)
        else:
            key = self.settings.key(row)
        if row.get("epoch") is None:
            self._repeats.note(key, row.get("step"))
        return self.settings.plan(size, row, key, int(self._epoch.item()))


def unwrap_planner(value: Planner | Corrupt) -> Planner:
    """Return the planner of a value, which is a planner or a transform.

    Raises:
        ParameterError: the transform has settings that only an outer transform can apply.
    """
    if not isinstance(value, Corrupt):
        return value
    settings = value.settings
    name = type(value).__name__
    if not value.seeded:
        raise ParameterError(
            f"{name} applies given plans, so it cannot be inside another transform"
        )
    inner: dict[str, tuple[Any, Any]] = {
        "seed": (settings.seed, 0),
        "label_policy": (settings.label_policy, "keep"),
        "target": (settings.labels.target, None),
        "id_key": (settings.id_key, "id"),
        "id_from": (value.id_from, "entry"),
        "return_plan": (value.return_plan, False),
        "image_key": (value.image_key, None),
        "labels": (settings.labels, None) if settings.labels.formats else (None, None),
    }
    for setting, (setting_value, default) in inner.items():
        if setting_value != default:
            raise ParameterError(
                f"{name} with {setting}={setting_value!r} is inside another transform, which"
                f" reads samples and draws for all of its parts; give {setting}= to the outer"
                " transform alone"
            )
    return settings.planner
