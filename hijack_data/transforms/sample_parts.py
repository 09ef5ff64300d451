"""Take a sample apart into named entries, a batch into rows, and put the results back."""

import hashlib
from collections.abc import Callable, Mapping
from collections.abc import Sequence as SequenceOf
from typing import Any, TypeAlias, cast

import numpy as np
import torch
from PIL import Image

from ..batches import check_not_transposed
from ..errors import ImageError, ParameterError
from ..labels.label_declarations import FIXED_ENTRIES
from ..labels.torchvision_labels import corners
from ..plan import Plan
from ..sample_pictures import (
    FIRST_ITEM,
    PICTURE_KEYS,
    SamplePicture,
    apply_plan,
    is_array,
    is_tensor,
    read_once,
    rebuilt,
)
from ..samples import check_names, is_many

__all__ = ["PICTURE_KEYS", "DatasetRow", "unpack", "value_per_picture"]
DatasetRow: TypeAlias = Mapping[str, Any]
Rebuild: TypeAlias = Callable[[dict[str, Any]], Any]


def unpack(sample: Any) -> tuple[dict[str, Any], Rebuild]:
    """Return the entries of a sample, and a function that makes a sample of its kind of them.

    A sample is a mapping; a tuple or list, whose first mapping holds the entries and whose other
    items are named `item 0`, `item 1` and so on; or a picture alone, which is `item 0`.
    """
    if isinstance(sample, Mapping):
        check_names(cast("Mapping[Any, Any]", sample))
        return read_once(dict(cast("Mapping[str, Any]", sample))), lambda entries: entries
    is_sequence = isinstance(sample, list | tuple)
    parts: list[Any] = list(cast("list[Any]", sample)) if is_sequence else [sample]
    at = next((i for i, part in enumerate(parts) if isinstance(part, Mapping)), None)
    entries: dict[str, Any] = {} if at is None else read_once(dict(cast(DatasetRow, parts[at])))
    check_names(entries)
    names = [f"item {i}" for i in range(len(parts))]
    entries |= {
        name: part for i, (name, part) in enumerate(zip(names, parts, strict=True)) if i != at
    }

    def rebuild(entries: dict[str, Any]) -> Any:
        named = {key: value for key, value in entries.items() if key not in names}
        if at is None and named:
            raise ParameterError(
                "return_plan=True needs a dictionary in the sample to put the plan in"
            )
        new = [named if i == at else entries[name] for i, name in enumerate(names)]
        return rebuilt(sample, new) if is_sequence else entries[FIRST_ITEM]

    return entries, rebuild


def plain(entries: DatasetRow) -> DatasetRow:
    """Return the entries with the `BoundingBoxes` that a planner reads as plain `xyxy` tensors."""
    read = {key for key in FIXED_ENTRIES if is_tensor(entries.get(key), "BoundingBoxes")}
    return {key: corners(value) if key in read else value for key, value in entries.items()}


def value_per_picture(values: Any, count: int, name: str) -> list[Any]:
    """Return one value for each picture of a batch; a single integer applies to all.

    Raises:
        ParameterError: the number of values is not that of the pictures, or each array among them
            seems to hold one number for each picture.
    """
    if not is_many(values) or len(values) != count:
        if isinstance(values, int):
            return [values] * count
        raise ParameterError(
            f"{name} must hold one entry for each of the {count} pictures of the batch, got"
            f" {values!r}"
        )
    check_not_transposed(values, count, name)
    return list(values)


def batch_length(entries: DatasetRow, pictures: list[SamplePicture]) -> int | None:
    """Return how many samples a batch without ids holds; `None` for a single sample.

    It is a list of pictures, or an array with more axes than a picture that is no `Video`.
    """
    value = entries[pictures[0].path[0]]
    if isinstance(value, list | tuple):
        return len(cast("list[Any]", value))
    if is_array(value) and value.ndim > 3 and not is_tensor(value, "Video"):
        return int(value.shape[0])
    return None


def check_pictures(entries: DatasetRow, pictures: list[SamplePicture], count: int) -> list[str]:
    """Check that a batch holds pictures for each id; return its entries that are one array.

    Raises:
        ImageError: an array of a single picture, or a mapping, stands where a batch is needed.
        ParameterError: the number of pictures, or of lists or stacks of them, is not that of ids.
    """
    arrays: list[str] = []
    for key in dict.fromkeys(picture.path[0] for picture in pictures):
        value = entries[key]
        if isinstance(value, Image.Image | Mapping) or (is_array(value) and value.ndim < 4):
            raise ImageError(
                f"the sample has {count} ids, so its entry {key!r} must be a batch: a list of"
                " pictures or an array with one more axis, with one picture, list or stack for"
                " each id"
            )
        if len(value) != count:
            raise ParameterError(
                f"{count} ids for {len(value)} pictures under {key!r}: give one id for each"
                " picture, or for each list or stack of pictures that belong together"
            )
        if is_array(value) and str(value.dtype) != "object":
            arrays.append(key)
    return arrays


def apply_to_array(plans: list[Plan], pixels: Any) -> Any:
    """Apply one plan to each picture, or stack of pictures, of an array with a batch axis."""
    stack = int(np.prod(tuple(pixels.shape[1:-3])))
    if stack == 1 or len({plan.out_size for plan in plans}) == 1:
        return apply_plan([plan for plan in plans for _ in range(stack)], pixels)
    return [apply_plan(plan, pixels[i]) for i, plan in enumerate(plans)]


def joined(values: list[Any], like: Any) -> Any:
    """Return the values of a batch as one tensor or array if `like` is one and they fit."""
    if isinstance(like, torch.Tensor):
        return torch.stack(
            [torch.as_tensor(value, dtype=like.dtype, device=like.device) for value in values]
        )
    if isinstance(like, np.ndarray) and cast(Any, like).dtype.kind in "biuf":
        arrays = [np.asarray(value, cast(Any, like).dtype) for value in values]
        return np.stack(arrays) if len({array.shape for array in arrays}) == 1 else values
    if hasattr(cast(Any, like), "__array_namespace__") and like.ndim:  # JAX
        same_shape = len({tuple(value.shape) for value in values}) == 1
        return like.__array_namespace__().stack(values) if same_shape else values
    return values


def content(picture: Any) -> str:
    """Return an id computed from all pixels: pictures that differ anywhere have different ids."""
    if isinstance(picture, torch.Tensor):
        planes = picture.as_subclass(torch.Tensor).movedim(-3, 0).cpu().numpy()
        picture = np.stack(list(planes), axis=-1)  # three times as fast as a transposed copy
    pixels = np.ascontiguousarray(np.asarray(picture))
    return hashlib.sha256(cast(Any, pixels)).hexdigest()[:32] + str(pixels.shape)


def sample_content_id(pictures: SequenceOf[SamplePicture]) -> str:
    """Return an id computed from the pixels of all pictures of a sample."""
    ids = [content(picture.pixels) for picture in pictures]
    return ids[0] if len(ids) == 1 else hashlib.sha256("".join(ids).encode()).hexdigest()[:32]
