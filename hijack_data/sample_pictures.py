"""Which entries of a sample are its pictures, decided by name and shape.

A picture stands under a name of `PICTURE_KEYS`, also numbered (`image_0`) or with `prev_`,
`previous_`, `next_`, `current_`, `last_` or `first_` before it, or under an entry that is declared
`"picture"`. It is a PIL image or an array, tensor or JAX array with pixels. The container, the type
and the other entries of the sample change nothing. All pictures of a sample have one size and
follow one plan. An entry that has the shape of a picture, and neither the name nor a declaration,
is an error, because it would silently stay clean.
"""

import datetime
import re
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import chain
from numbers import Number
from os import PathLike
from typing import Any, TypeAlias, cast

import numpy as np
from PIL import Image

from ._apply import apply
from .backends import find_backend
from .errors import ImageError
from .plan import Plan
from .types import Size, size_text

PICTURE_KEYS = ("image", "images", "screenshot", "screenshots", "picture", "pictures", "pixels")
_NAME = re.compile(
    rf"(?:(?:prev|previous|next|current|last|first)_)?(?:{'|'.join(PICTURE_KEYS)})(?:_?\d+)?",
    re.IGNORECASE,
)
# The first item of a tuple is its picture; a sample that is a picture alone has this name, too.
FIRST_ITEM = "item 0"
_CHANNELS = (1, 3, 4)
# Numbers of other dtypes than uint8 have the shape of a picture from this side length on; key
# points `[N, 17, 3]` do not reach it.
_MIN_SIDE = 64
_SCALARS = frozenset([int, float, str, bool, type(None)])
_CONTAINERS = frozenset([dict, list, tuple])
_MAX_DEPTH = 64  # of containers that `is_plain` looks into
# How files of pictures begin: PNG, JPEG, GIF, WebP, BMP, TIFF.
_DATA_URL = "data:image/"
_FILES = (b"\x89PNG", b"\xff\xd8\xff", b"GIF8", b"RIFF", b"BM", b"II*\0", b"MM\0*")

Path: TypeAlias = tuple[Any, ...]


@dataclass(frozen=True)
class SamplePicture:
    """A picture of a sample, or a stack of pictures: its keys and indices, and the pixels."""

    path: Path
    pixels: Any

    @property
    def size(self) -> Size:
        """(height, width); `ImageError` or `ImageTypeError` if the picture cannot be used."""
        return picture_size(self.pixels)


def names_picture(path: str) -> bool:
    """Return whether the last part of a dotted path is the name of a picture."""
    return path == FIRST_ITEM or _NAME.fullmatch(path.rpartition(".")[2]) is not None


def is_tensor(value: object, *kinds: str) -> bool:
    """Return whether a value is one of these `tv_tensors` of torchvision, without importing it."""
    kind = type(value)
    return kind.__module__.startswith("torchvision.tv_tensors") and kind.__name__ in kinds


def is_array(value: object) -> bool:
    """Return whether a value is an array with axes, of any framework."""
    return bool(getattr(value, "ndim", 0)) and hasattr(value, "dtype")


def is_sequence(value: object) -> bool:
    """Return whether a value is a list or tuple."""
    return isinstance(value, list | tuple)


def is_plain(value: object) -> bool:
    """Return whether a value is made of Python's own dictionaries, lists, tuples and scalars alone.

    A text that is a picture, as a data URL, is none of these scalars.

    It looks at all values of one depth at once, which takes a tenth of a walk through them.
    """
    level: list[Any] = [value]
    for _ in range(_MAX_DEPTH):
        kinds = set(map(type, level))
        if not kinds <= _SCALARS | _CONTAINERS:
            return False
        if str in kinds and any(type(p) is str and p[:11] == _DATA_URL for p in level):
            return False
        if kinds <= _SCALARS:
            return True
        parts: list[Any] = [part for part in level if type(part) in _CONTAINERS]
        if dict in kinds:
            parts = [part.values() if type(part) is dict else part for part in parts]
        level = list(chain.from_iterable(parts))
    return False


def has_pixels(value: Any) -> bool:
    """Return whether a value under the name of a picture is one: an image, or 2 axes or more."""
    if isinstance(value, Image.Image):
        return True
    return is_array(value) and value.ndim >= 2 and not is_tensor(value, *FOLLOWING)


FOLLOWING = ("BoundingBoxes", "KeyPoints", "Mask")  # tensors that carry their format


def is_picture_shaped(value: Any, size: Size | None = None) -> bool:
    """Return whether a value under any other name could be a picture.

    It is a PIL image or the bytes of a picture's file, or has 3 axes or more with 1, 3 or 4
    channels: uint8 of any size, other dtypes from 64x64 on or of the `size` of the sample's
    picture. So could be a container of such a value that is neither list nor tuple, or text that
    is a data URL of a picture.
    """
    if isinstance(value, str):
        return value.startswith(_DATA_URL)
    if isinstance(value, bytes):
        return value.startswith(_FILES)
    if isinstance(value, Image.Image) or is_tensor(value, "Image", "Video"):
        return True
    if isinstance(value, Sequence | Set):
        return any(is_picture_shaped(part, size) for part in cast("Sequence[Any]", value))
    if not is_array(value) or value.ndim < 3 or is_tensor(value, *FOLLOWING):
        return False
    shape = tuple(value.shape)
    sides: list[Size] = []
    if shape[-3] in _CHANNELS:
        sides.append(shape[-2:])
    if shape[-1] in _CHANNELS:
        sides.append(shape[-3:-1])
    if str(value.dtype).rpartition(".")[2] == "uint8":
        return any(min(side) > 0 for side in sides)
    return any(min(side) >= _MIN_SIDE or side == size for side in sides)


def picture_size(picture: Any) -> Size:
    """Return `(height, width)` of a picture.

    Raises:
        ImageTypeError: it is of another kind, or its dtype is not uint8.
        ImageError: its shape is not that of a picture.
    """
    if isinstance(picture, Image.Image):
        return picture.height, picture.width
    backend = find_backend(picture)
    backend.check(picture)
    return backend.size(picture)


def find_pictures(
    entries: Mapping[str, Any], is_picture: Callable[[str], bool | None]
) -> tuple[list[SamplePicture], dict[str, Any]]:
    """Return the pictures of a sample, in its order, and the parts that could be pictures.

    Args:
        entries: the sample.
        is_picture: says for a dotted path whether its value is a picture; `None` if neither a name
            nor a declaration says it.

    Returns:
        the pictures, and by its dotted path each value that has the shape of a picture while
        nothing says whether it is one.

    Raises:
        ImageError: there is no picture.
    """
    pictures: list[SamplePicture] = []
    candidates: dict[str, Any] = {}
    for path, value in _arrays(entries, ()):
        name = dotted(path)
        answer = is_picture(name)
        if answer and has_pixels(value):
            pictures.append(SamplePicture(path, value))
        elif answer is None or (answer and not is_tensor(value, *FOLLOWING)):
            candidates.setdefault(name, value)
    size = _size_or_none(pictures[0].pixels) if pictures else None
    unclear = {
        name: value
        for name, value in candidates.items()
        if is_picture_shaped(value, size) or is_picture(name)
    }
    if not pictures:
        problem = _no_picture(entries, unclear)
        raise problem
    return pictures, unclear


def common_size(pictures: Sequence[SamplePicture]) -> Size:
    """Return the size of all pictures of a sample.

    Raises:
        ImageError: their sizes differ, so one plan cannot be for all of them.
    """
    sizes = [picture.size for picture in pictures]
    if len(set(sizes)) > 1:
        listed = ", ".join(
            f"{dotted(picture.path)} {size_text(size)}"
            for picture, size in zip(pictures, sizes, strict=True)
        )
        raise ImageError(
            f"the pictures of one sample differ in size ({listed}), but one plan is for all of"
            " them; resize them, give each a sample of its own, or declare those that shall stay"
            " clean: labels={...: 'leave'}"
        )
    return sizes[0]


def apply_plan(plan: Plan | list[Plan], pixels: Any) -> Any:
    """Apply a plan to a picture or stack, or one each to a batch; `tv_tensors` stay such."""
    if not is_tensor(pixels, "Image", "Video"):
        return apply(plan, pixels)
    from .torchvision_images import change_pixels  # here: it needs torch

    return change_pixels(pixels, lambda plain: apply(plan, plain))


def swapped(value: Any, new: Mapping[int, Any]) -> Any:
    """Return a value with the objects inside it replaced; `new` maps the `id` of each."""
    if id(value) in new:
        return new[id(value)]
    if isinstance(value, Mapping):
        entries = cast("Mapping[Any, Any]", value).items()
        return {key: swapped(part, new) for key, part in entries}
    if isinstance(value, list | tuple):
        parts = [swapped(part, new) for part in cast("list[Any]", value)]
        return rebuilt(value, parts)
    if is_object_array(value):
        out = value.copy()
        for index, part in np.ndenumerate(value):
            out[index] = swapped(part, new)
        return out
    return value


def read_once(value: Any) -> Any:
    """Return a value with a dictionary for each mapping that makes its values at each look.

    What is put back later is found by its identity.
    """
    original: Any = value
    if is_plain(original):
        return original
    if isinstance(value, Mapping):
        new = {key: read_once(part) for key, part in original.items()}
        return original if all(new[key] is original[key] for key in new) else new
    if isinstance(value, list | tuple):
        parts = [read_once(part) for part in original]
        is_same = all(part is item for part, item in zip(parts, original, strict=True))
        return original if is_same else rebuilt(original, parts)
    return original


def rebuilt(like: Any, parts: list[Any]) -> Any:
    """Return parts as a list, tuple or named tuple."""
    if hasattr(like, "_fields"):
        return type(like)(*parts)
    return tuple(parts) if isinstance(like, tuple) else parts


def dotted(path: Path) -> str:
    """Return the keys of a path, without the places in lists, as declarations write them."""
    return ".".join(str(part) for part in path if not isinstance(part, int))


def _arrays(value: Any, path: Path) -> Iterator[tuple[Path, Any]]:
    """Yield with its path each part of a value that is no scalar and no container looked into."""
    if isinstance(value, Mapping):
        for key, part in cast("Mapping[Any, Any]", value).items():
            if path or not is_plain(part):
                yield from _arrays(part, (*path, str(key)))
    elif isinstance(value, list | tuple):
        for index, part in enumerate(cast("list[Any]", value)):
            if type(part) not in _SCALARS:
                yield from _arrays(part, (*path, index))
    elif is_object_array(value):
        for index, part in enumerate(value.flat):
            yield from _arrays(part, (*path, index))
    elif type(value) is str:
        if value.startswith(_DATA_URL):
            yield path, value
    elif type(value) not in _SCALARS and not _is_scalar(value):
        yield path, value


def _is_scalar(value: Any) -> bool:
    """Return whether a value is a number, a text, a date or a path, also one of NumPy or torch."""
    if isinstance(value, bytes):
        return False
    if isinstance(value, Number | str | np.generic | datetime.date | datetime.time | PathLike):
        return True
    if not hasattr(value, "dtype"):
        return False
    axes = getattr(value, "ndim", 0)
    is_text = getattr(value.dtype, "kind", "") in tuple("UST")
    return is_text or axes == 0 or (axes == 1 and len(value) == 0)


def is_object_array(value: Any) -> bool:
    """Return whether a value is a NumPy array of objects, as of lists of different lengths."""
    return isinstance(value, np.ndarray) and cast(Any, value).dtype == object


def _size_or_none(pixels: Any) -> Size | None:
    if isinstance(pixels, Image.Image):
        return pixels.height, pixels.width
    return find_backend(pixels).size(pixels) if pixels.ndim >= 3 else None


def _no_picture(entries: Mapping[str, Any], unclear: Mapping[str, Any]) -> ImageError:
    listed = ", ".join(f"{key} ({type(value).__name__})" for key, value in entries.items())
    advice = f"put it under one of {', '.join(PICTURE_KEYS)}, or name its entry with image_key="
    if unclear:
        advice += f", such as image_key={next(iter(unclear))!r}"
    return ImageError(
        f"the sample holds no picture, which is a PIL image, a NumPy or JAX array [H, W, 3] or a"
        f" tensor [3, H, W] (it holds: {listed or 'nothing'}); {advice}"
    )
