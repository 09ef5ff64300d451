"""Find the pictures and coordinates in a sample, and change them."""

import hashlib
import importlib
from collections.abc import Mapping
from collections.abc import Sequence as SequenceOf
from dataclasses import replace
from typing import Any, TypeAlias, cast

import numpy as np
import torch
from PIL import Image

from .._apply import apply
from ..backends import backend_of
from ..errors import ImageError, LabelError, ParameterError, shown
from ..labels import Labels
from ..labels.base import Move
from ..labels.boxes import box_format
from ..labels.declared import OWN
from ..labels.numbers import to_host
from ..labels.undeclared import find_undeclared
from ..plan import Plan
from ..samples import PICTURE_KEYS, follow, is_many, visible_in
from ..types import Size

tv_tensors: Any = importlib.import_module("torchvision.tv_tensors")  # torchvision is not typed
v2: Any = importlib.import_module("torchvision.transforms.v2")
FOLLOWING = (tv_tensors.BoundingBoxes, tv_tensors.KeyPoints, tv_tensors.Mask)
DatasetRow: TypeAlias = Mapping[str, Any]


def pictures_of(paths: list[tuple[Any, Any]]) -> list[int]:
    """Return which leaves of a sample are its pictures.

    Raises:
        ImageError: the sample holds no picture.
    """
    explicit = (Image.Image, tv_tensors.Image, tv_tensors.Video)
    found = [i for i, (_, leaf) in enumerate(paths) if isinstance(leaf, explicit)]
    if not found:
        found = [
            i for i, (path, leaf) in enumerate(paths) if _is_array(leaf) and _names_a_picture(path)
        ]
    if not found:
        kinds = ", ".join(sorted({type(leaf).__name__ for _, leaf in paths}))
        raise ImageError(
            f"the sample holds no picture (it holds: {kinds or 'nothing'}); give a PIL image or"
            f" tv_tensors.Image, or put the tensor under one of {', '.join(PICTURE_KEYS)}"
        )
    return found


def _is_array(leaf: object) -> bool:
    return isinstance(leaf, torch.Tensor | np.ndarray) and not isinstance(leaf, tv_tensors.TVTensor)


def _names_a_picture(path: tuple[Any, ...]) -> bool:
    names = [
        getattr(part, "key", getattr(part, "idx", getattr(part, "name", None))) for part in path
    ]
    return not names or names == [0] or any(name in PICTURE_KEYS for name in names)


def entries_of(sample: Any) -> DatasetRow:
    """Return the dictionary of a sample: the sample itself, or the first one in a tuple."""
    parts: SequenceOf[Any] = cast(Any, sample) if isinstance(sample, list | tuple) else [sample]
    return next(
        (cast(DatasetRow, part) for part in parts if isinstance(part, Mapping)),
        cast(DatasetRow, {}),
    )


def plain(entries: DatasetRow) -> DatasetRow:
    """Return the entries with the `BoundingBoxes` that a planner reads as plain `xyxy` tensors."""
    read = {key for key in OWN if isinstance(entries.get(key), tv_tensors.BoundingBoxes)}
    return {key: _corners(value) if key in read else value for key, value in entries.items()}


def _corners(boxes: Any) -> Any:
    return v2.functional.convert_bounding_box_format(boxes, new_format="XYXY").as_subclass(
        torch.Tensor
    )


def check_orders(entries: DatasetRow, labels: Labels) -> None:
    """Check that no declaration contradicts the format stored in `BoundingBoxes`.

    Raises:
        LabelError: a declaration contradicts it.
    """
    for key, form in labels.declared.items():
        value = entries.get(key)
        if not isinstance(value, tv_tensors.BoundingBoxes) or key in labels.left:
            continue
        order = str(cast(Any, value).format.value).lower()
        if form.name != order:
            raise LabelError(
                f"the sample's entry {key!r} is a BoundingBoxes of format {order.upper()}, and it"
                f" is declared {form.name!r}; declare it {order!r}, or leave it out of labels="
            )


def check_beside(sample: Any, plans: list[Plan]) -> None:
    """Check the unnamed items of a tuple next to the picture.

    Raises:
        LabelError: an item could be a label, and a plan moves pixels.
    """
    if not isinstance(sample, list | tuple) or all(plan.coords.is_identity for plan in plans):
        return
    plan = next(plan for plan in plans if not plan.coords.is_identity)
    for number, part in enumerate(cast("SequenceOf[Any]", sample)):
        if isinstance(part, Mapping | tv_tensors.TVTensor):
            continue
        found = find_undeclared(f"item {number}", part, plan.size)
        if found is not None:
            raise LabelError(
                f"item {number} of the sample ({shown(part)}) could be a label, and the picture is"
                " resized; give a dictionary, so that labels={...} can say how it is written"
            )


def put(out: Any, changes: dict[str, Any]) -> Any:
    """Return the sample with these entries changed.

    Raises:
        ParameterError: the sample has no dictionary for the entries.
    """
    if not changes:
        return out
    if isinstance(out, dict):
        return {**cast("dict[str, Any]", out), **changes}
    if not isinstance(out, list | tuple) or not any(
        isinstance(part, dict) for part in cast("SequenceOf[Any]", out)
    ):
        raise ParameterError("return_plan=True needs a dictionary in the sample to put the plan in")
    parts = list(cast("SequenceOf[Any]", out))
    at = next(i for i, part in enumerate(parts) if isinstance(part, dict))
    parts[at] = {**parts[at], **changes}
    return tuple(parts) if isinstance(out, tuple) else parts


def changed_entries(
    plans: list[Plan],
    entries: DatasetRow,
    rows: list[DatasetRow] | None,
    pictures: list[tuple[Any, Any]],
    labels: Labels,
    *,
    seed: int | None,
    return_plan: bool | str,
) -> dict[str, Any]:
    """Return the entries of a sample that the plans change.

    `pictures` holds the pictures before and after.
    """
    each = [entries] if rows is None else rows
    moved = [
        follow(plan, row, before, after, labels, seed)
        for plan, row, (before, after) in zip(plans, each, pictures, strict=True)
    ]
    changes: dict[str, list[Any]] = {}
    for key in {key for part in moved for key in part}:
        changes[key] = [part.get(key, row[key]) for part, row in zip(moved, each, strict=True)]
    if return_plan:
        changes["plan"] = [plan.to_json() if return_plan == "json" else plan for plan in plans]
        seen = [visible_in(plan, row, labels) for plan, row in zip(plans, each, strict=True)]
        if any(share is not None for share in seen):
            changes["target_visible"] = seen
    return {
        key: _joined(values, entries.get(key)) if rows else values[0]
        for key, values in changes.items()
    }


def _joined(values: list[Any], like: Any) -> Any:
    if not isinstance(like, torch.Tensor):
        return values
    return torch.stack(
        [torch.as_tensor(value, dtype=like.dtype, device=like.device) for value in values]
    )


def each_of(values: Any, count: int, what: str) -> list[Any]:
    """Return one value for each picture of a batch; a single integer applies to all.

    Raises:
        ParameterError: the number of values is not that of the pictures.
    """
    if not is_many(values) or len(values) != count:
        if isinstance(values, int):
            return [values] * count
        raise ParameterError(
            f"{what} must hold one entry for each of the {count} pictures of the batch, got"
            f" {values!r}"
        )
    return list(values)


def size_of(picture: Any) -> Size:
    """Return `(height, width)` of a picture.

    Raises `ImageError` or `ImageTypeError` if it is not a picture.
    """
    if isinstance(picture, Image.Image):
        return picture.height, picture.width
    backend = backend_of(picture)
    backend.check(picture)
    return backend.size(picture)


def content(picture: Any) -> str:
    """Return an id computed from all pixels: pictures that differ anywhere have different ids."""
    if isinstance(picture, torch.Tensor):
        planes = picture.as_subclass(torch.Tensor).movedim(-3, 0).cpu().numpy()
        picture = np.stack(list(planes), axis=-1)  # three times as fast as a transposed copy
    pixels = np.ascontiguousarray(np.asarray(picture))
    return hashlib.sha256(cast(Any, pixels)).hexdigest()[:32] + str(pixels.shape)


def corrupt(leaves: list[Any], places: list[int], plans: list[Plan]) -> None:
    """Replace the pictures among the leaves by corrupted ones."""
    if len(places) == 1:
        leaves[places[0]] = _apply(plans if len(plans) > 1 else plans[0], leaves[places[0]])
        return
    for i, plan in zip(places, plans, strict=True):
        leaves[i] = _apply(plan, leaves[i])


def _apply(plan: Any, picture: Any) -> Any:
    if not isinstance(picture, tv_tensors.TVTensor):
        return apply(plan, picture)
    out = apply(plan, picture.as_subclass(torch.Tensor))
    if isinstance(out, list):
        return [tv_tensors.wrap(o, like=picture) for o in cast("list[Any]", out)]
    return tv_tensors.wrap(out, like=picture)


def follow_tensor(value: Any, plans: list[Plan]) -> Any:
    """Return boxes, key points or a mask mapped to the resized picture.

    They follow the geometry of all other labels.

    Raises:
        LabelError: the labels belong to a picture of another size.
        ParameterError: the pictures of a batch get different sizes.
    """
    _check_canvas(value, plans[0].size)
    if all(plan.coords.is_identity for plan in plans):
        return value
    moves = {Move(plan.size, plan.out_size) for plan in plans}
    if len(moves) > 1:
        raise ParameterError(
            f"a {type(value).__name__} cannot follow a batch whose pictures get different sizes"
        )
    (move,) = moves
    if isinstance(value, tv_tensors.Mask):
        return v2.functional.resize(
            value, list(move.after), interpolation=v2.InterpolationMode.NEAREST_EXACT
        )
    plain = value.as_subclass(torch.Tensor)
    if isinstance(value, tv_tensors.KeyPoints):
        return tv_tensors.KeyPoints(_points_moved(plain, move), canvas_size=move.after)
    order = str(value.format.value).lower()
    if order in ("xyxy", "xywh", "cxcywh"):
        boxes = box_format(order, 0, anywhere=True).moved(plain, move)
        return tv_tensors.BoundingBoxes(boxes, format=value.format, canvas_size=move.after)
    # Rotated boxes: let torchvision compute their corners.
    scaled = v2.functional.resize(
        tv_tensors.wrap(plain.to(torch.float64), like=value), list(move.after)
    )
    return tv_tensors.wrap(scaled.as_subclass(torch.Tensor).to(value.dtype), like=scaled)


def follow_inside(value: Any, plans: list[Plan]) -> Any:
    """Return an entry with all torchvision boxes, key points and masks inside it mapped."""
    if isinstance(value, FOLLOWING):
        return follow_tensor(value, plans)
    if not _holds_tensors(value):
        return value
    if isinstance(value, Mapping):
        entries = cast("Mapping[Any, Any]", value).items()
        return {key: follow_inside(part, plans) for key, part in entries}
    parts = [follow_inside(part, plans) for part in cast("list[Any]", value)]
    return tuple(parts) if isinstance(value, tuple) else parts


def _holds_tensors(value: Any) -> bool:
    if isinstance(value, Mapping):
        return any(_holds_tensors(part) for part in cast("Mapping[Any, Any]", value).values())
    if isinstance(value, list | tuple):
        return any(_holds_tensors(part) for part in cast("list[Any]", value))
    return isinstance(value, FOLLOWING)


def _check_canvas(value: Any, size: Size) -> None:
    is_mask = isinstance(value, tv_tensors.Mask)
    canvas = tuple(value.shape[-2:]) if is_mask else tuple(value.canvas_size)
    if canvas == tuple(size):
        return
    name = type(value).__name__
    height, width = canvas
    raise LabelError(
        f"a {name} belongs to a picture of {width}x{height} pixels, and the sample's has"
        f" {size[1]}x{size[0]}; resize both with one transform, or give the {name} the canvas that"
        " it is in"
    )


def _points_moved(points: torch.Tensor, move: Move) -> torch.Tensor:
    """Return key points after a change of size.

    Unlike clicked points, they may lie outside the picture.
    """
    numbers = to_host(points)
    if points.is_floating_point():
        return points.new_tensor(move.scaling.positions(numbers))
    free = replace(move.scaling, bounded=False, clamp=False)
    return points.new_tensor(free.points(numbers))
