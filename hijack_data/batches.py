"""Corrupt a whole batch of pictures in one call, with its boxes and targets."""

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from PIL import Image

from ._apply import apply
from .backends import Backend, find_backend
from .errors import ImageTypeError, ParameterError, ParameterTypeError
from .plan import Plan
from .planner import Planner
from .safety import Safety, judge_all
from .sample_pictures import is_array
from .types import Box, BoxArray, Scene, Size, as_boxes, as_target


@dataclass(frozen=True, eq=False, kw_only=True)
class Corrupted:
    """A corrupted batch.

    Args:
        image: the pictures, of the input's kind; a list when their sizes differ.
        plans: what was done, one plan per picture.
        boxes: int32 `[N_i, 4]` for each picture, `xyxy` in pixels of the corrupted picture.
        targets: for each picture a box in pixels of the corrupted picture, or `None`.
        safety: what the corruption did to the labels of each picture.
    """

    image: Any
    plans: list[Plan]
    boxes: list[BoxArray]
    targets: list[Box | None]
    safety: list[Safety]


@dataclass(frozen=True, kw_only=True)
class _Labels:
    """The labels of one picture."""

    key: int | str
    step: int
    boxes: BoxArray
    target: Box | None
    end: Box | None


def corrupt_batch(
    planner: Planner,
    batch: Any,
    *,
    ids: Sequence[int | str],
    boxes: Sequence[Any] | None = None,
    targets: Sequence[Any] | None = None,
    ends: Sequence[Any] | None = None,
    seed: int,
    epoch: int = 0,
    steps: Sequence[int] | None = None,
) -> Corrupted:
    """Corrupt a batch with any planner; see `Augmentation.__call__` for the arguments.

    Raises:
        ParameterError: a list does not have one entry per picture, an id appears twice, or a value
            is out of range.
        ParameterTypeError: an argument has the wrong type.
        ImageTypeError: the pictures are of a kind that cannot be corrupted.
    """
    images = [_pixels(image) for image in _pictures(batch)]
    count = len(images)
    check_ids(ids, count)
    sizes = [_size(image) for image in images]
    picture_labels = _labels(sizes, ids=ids, boxes=boxes, targets=targets, ends=ends, steps=steps)
    plans: list[Plan] = []
    for size, labels in zip(sizes, picture_labels, strict=True):
        scene = Scene(size, labels.boxes, target=labels.target)
        plan = planner.plan(scene, seed=seed, sample=labels.key, step=labels.step, epoch=epoch)
        plans.append(plan)
    out = apply(plans, batch)
    after = [_pixels(out[i]) for i in range(count)]
    safety = judge_all(
        plans,
        images,
        after,
        targets=[labels.target for labels in picture_labels],
        ends=[labels.end for labels in picture_labels],
        boxes=[labels.boxes for labels in picture_labels],
    )
    pairs = list(zip(plans, picture_labels, strict=True))
    return Corrupted(
        image=out,
        plans=plans,
        boxes=[plan.coords.boxes_to_observation(labels.boxes) for plan, labels in pairs],
        targets=[moved_target(plan, labels.target) for plan, labels in pairs],
        safety=safety,
    )


def moved_target(plan: Plan, target: Box | None) -> Box | None:
    """Return a target box mapped to the corrupted picture; `None` stays `None`."""
    if target is None:
        return None
    x1, y1, x2, y2 = plan.coords.boxes_to_observation(as_boxes([target]))[0].tolist()
    return x1, y1, x2, y2


def check_ids(ids: object, count: int) -> None:
    """Check that `ids` holds one id for each of `count` pictures, each different.

    Raises:
        ParameterTypeError: `ids` is not a list of integers and strings.
        ParameterError: there are too many or too few ids, or one appears twice.
    """
    if not _is_list(ids):
        raise ParameterTypeError(
            f"ids must be a list with one id a picture, in their order, got {ids!r}"
        )
    keys = [_id_text(i) for i in cast("Sequence[Any]", ids)]
    if len(keys) != count:
        raise ParameterError(f"{len(keys)} ids for {count} pictures: give one id for each")
    if len(set(keys)) == count:
        return
    twice = next(key for key in keys if keys.count(key) > 1)
    raise ParameterError(
        f"ids: {twice!r} appears twice; samples with one id get one plan, make ids unique"
    )


def _labels(
    sizes: Sequence[Size],
    *,
    ids: Sequence[int | str],
    boxes: Sequence[Any] | None,
    targets: Sequence[Any] | None,
    ends: Sequence[Any] | None,
    steps: Sequence[int] | None,
) -> list[_Labels]:
    count = len(sizes)
    per_box = [as_boxes(value) for value in _one_per_picture(boxes, count, "boxes")]
    aims = zip(_one_per_picture(targets, count, "targets"), sizes, strict=True)
    per_target = [as_target(value, size) for value, size in aims]
    stops = zip(_one_per_picture(ends, count, "ends"), sizes, strict=True)
    per_end = [as_target(value, size) for value, size in stops]
    per_step = _one_per_picture(steps, count, "steps")
    keys = list(ids)
    return [
        _Labels(
            key=keys[i],
            step=per_step[i] or 0,
            boxes=per_box[i],
            target=per_target[i],
            end=per_end[i],
        )
        for i in range(count)
    ]


def _is_list(values: object) -> bool:
    if isinstance(values, str | bytes | Mapping | Set):
        return False
    return hasattr(values, "__len__")


def _id_text(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, bool) or not hasattr(value, "__index__"):
        raise ParameterTypeError(f"ids must hold integers or strings, got {value!r}")
    try:
        return str(value.__index__())
    # an array of several numbers, or an integer of thousands of digits
    except (TypeError, ValueError):
        description = type(value).__name__
        raise ParameterTypeError(
            f"ids must hold integers or strings, got a {description}"
        ) from None


def _one_per_picture(values: Sequence[Any] | None, count: int, name: str) -> list[Any]:
    if values is None:
        return [None] * count
    if not _is_list(values):
        raise ParameterTypeError(
            f"{name} must be a list with one entry a picture (None where unknown), got {values!r}"
        )
    if len(values) != count:
        raise ParameterError(
            f"{len(values)} {name} for {count} pictures: give one entry for each (None where"
            " unknown)"
        )
    check_not_transposed(values, count, name)
    return list(values)


def check_not_transposed(values: Any, count: int, name: str) -> None:
    """Check that the values of a batch are not perhaps one array for each number of a label.

    Raises:
        ParameterError: a part of them is a list of arrays of `count` numbers each.
    """
    if count > 1 and _may_be_transposed(values, count):
        raise ParameterError(
            f"{name} of a batch of {count} is a list of arrays of {count} numbers: are these the"
            " numbers of one picture each, or, as torch's default_collate makes of tuples and"
            " lists, one number of all pictures each? Collate it to one tensor, or to a list with"
            " a list of numbers for each picture"
        )


def _may_be_transposed(values: Any, count: int) -> bool:
    """Return whether a part of a value is a list of arrays of `count` numbers each."""
    if isinstance(values, Mapping):
        parts = list(cast("Mapping[Any, Any]", values).values())
    elif isinstance(values, list | tuple):
        parts = list(cast("list[Any]", values))
        if parts and all(is_array(part) and part.shape == (count,) for part in parts):
            return True
    else:
        return False
    return any(_may_be_transposed(part, count) for part in parts)


def _pixels(image: Any) -> Any:
    """Return a PIL image as an array, any other picture unchanged.

    Raises:
        ImageTypeError: pictures of this kind cannot be corrupted.
    """
    if "Tracer" in type(image).__name__:
        raise ImageTypeError(
            "plans are made on the host, so a batch cannot be corrupted while jax.jit or"
            " torch.compile traces it; plan outside, and inside apply the plans that"
            " hijack_data.jax_plans packs"
        )
    return np.asarray(image) if isinstance(image, Image.Image) else image


def _size(image: Any) -> Size:
    backend: Backend = find_backend(image)
    backend.check(image)
    return backend.size(image)


def _pictures(batch: Any) -> list[Any]:
    if isinstance(batch, list | tuple):
        return list(cast("Sequence[Any]", batch))
    if isinstance(batch, Image.Image):
        raise ImageTypeError(
            "a batch is an array of pictures or a list of them; give [picture] and one id"
        )
    find_backend(batch).check(batch)
    if len(batch.shape) != 4:
        raise ParameterError(
            f"a batch has 4 axes, got shape {list(batch.shape)}; add a leading axis for one picture"
        )
    return [batch[i] for i in range(batch.shape[0])]
