"""Which entries of a sample could be labels although nothing says how they are written.

A picture that is resized makes such an entry wrong without a trace, so it is an error until the
user says what it is. Names tell most: `bbox`, `click`, `keypoints`. Under other names the values
do: numbers in twos and fours that could be pixels of the picture, a value for each pixel, text of
an answer with coordinates in it.
"""

import re
from collections.abc import Mapping
from itertools import pairwise
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from ..errors import shown
from ..types import SLACK, Action, Size
from .numbers import to_host
from .rows import holds_coordinates

_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")

# What the words in the name of an entry tell.
PLACES = frozenset(
    [
        "bbox",
        "bboxes",
        "box",
        "boxes",
        "rect",
        "rects",
        "rectangle",
        "roi",
        "rois",
        "region",
        "regions",
        "bounds",
        "bounding",
        "xyxy",
        "xywh",
        "quad",
        "polygon",
        "polygons",
        "segmentation",
        "contour",
        "point",
        "points",
        "pt",
        "pts",
        "click",
        "clicks",
        "tap",
        "touch",
        "coordinate",
        "coordinates",
        "coord",
        "coords",
        "xy",
        "keypoint",
        "keypoints",
        "kp",
        "kpts",
        "landmark",
        "landmarks",
        "position",
        "pos",
        "location",
        "cursor",
        "pointer",
        "mouse",
        "center",
        "centre",
        "target",
        "targets",
        "element",
        "elements",
        "gt",
        "truth",
    ]
)
COORDINATES = frozenset(
    [
        "x",
        "y",
        "x0",
        "y0",
        "x1",
        "y1",
        "x2",
        "y2",
        "cx",
        "cy",
        "xmin",
        "ymin",
        "xmax",
        "ymax",
        "left",
        "top",
        "right",
        "bottom",
        "dx",
        "dy",
    ]
)
ACTIONS = frozenset("action actions code command commands call calls".split())  # noqa: SIM905
ANSWERS = frozenset(
    [
        "answer",
        "answers",
        "response",
        "responses",
        "completion",
        "completions",
        "output",
        "solution",
        "messages",
        "message",
        "conversations",
        "conversation",
        "assistant",
        "gpt",
        "reply",
        "expected",
        "label",
        "labels",
        "content",
        "value",
    ]
)
SIZES = frozenset("width height size resolution shape w h".split())  # noqa: SIM905
HARMLESS = frozenset(
    [
        "id",
        "ids",
        "index",
        "idx",
        "indices",
        "class",
        "classes",
        "category",
        "categories",
        "score",
        "scores",
        "confidence",
        "prob",
        "probs",
        "logits",
        "token",
        "tokens",
        "input",
        "attention",
        "embedding",
        "embeddings",
        "length",
        "lengths",
        "count",
        "num",
        "number",
        "time",
        "timestamp",
        "duration",
        "date",
        "epoch",
        "step",
        "seed",
        "version",
        "reward",
        "rewards",
        "weight",
        "weights",
        "grid",
        "thw",
        "iscrowd",
        "area",
        "visibility",
        "crowd",
        "split",
    ]
)
# What people write for other people; coordinates in it are nothing that has to follow.
PROSE = frozenset(
    "instruction instructions goal question query thought thoughts reasoning caption description".split()  # noqa: E501, SIM905
)


def find_undeclared(
    name: str,
    value: Any,
    size: Size,
) -> tuple[str, Any] | None:
    """Return the path and the value of the first part of an entry that could be a label.

    `None` if there is none.

    Args:
        name: the key of the entry.
        value: anything; dictionaries and lists of dictionaries are looked into.
        size: (height, width) of the picture before it was resized.
    """
    return _find(name, frozenset[str](), value, size)


def _words(name: str) -> frozenset[str]:
    found = [word.lower() for word in _WORD.findall(name)]
    joined = [a + b for a, b in pairwise(found) if b.isdigit()]
    return frozenset([*found, *joined])


def _find(
    path: str,
    above: frozenset[str],
    value: Any,
    size: Size,
) -> tuple[str, Any] | None:
    name = path.rpartition(".")[2]
    words = _words(name)
    if value is None or (isinstance(value, bool | bytes) and not (words & (ACTIONS | ANSWERS))):
        return None
    if isinstance(value, Action):
        return path, value
    if type(value).__module__.startswith("torchvision.tv_tensors"):
        return None  # these know themselves how they are written
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    if isinstance(value, str):
        return (path, value) if _is_telling_text(words, above, value) else None
    if isinstance(value, Mapping):
        entries = cast("Mapping[Any, Any]", value).items()
        return _first([(f"{path}.{key}", part) for key, part in entries], words | above, size)
    if isinstance(value, list | tuple):
        parts = cast("list[Any]", value)
        if any(isinstance(part, Mapping | str | bytes | Action) for part in parts):
            return _first([(path, part) for part in parts], above, size)
    numbers = _numbers(cast(Any, value))
    if numbers is None or not numbers.size:
        return None
    return (path, cast(Any, value)) if _could_be_label(name, above, numbers, size) else None


def _first(
    items: list[tuple[str, Any]],
    above: frozenset[str],
    size: Size,
) -> tuple[str, Any] | None:
    for path, part in items:
        found = _find(path, above, part, size)
        if found is not None:
            return found
    return None


def _is_telling_text(
    words: frozenset[str],
    above: frozenset[str],
    text: str,
) -> bool:
    if words & PROSE:
        return False
    return bool((words | above) & (PLACES | ACTIONS | ANSWERS)) and holds_coordinates(text)


def _numbers(value: Any) -> npt.NDArray[Any] | None:
    """Return the numbers of a value, or `None`; flattened if its parts differ in length."""
    if not _is_numeric(value):
        return None
    try:
        array: npt.NDArray[Any] = np.asarray(to_host(value))
    except (TypeError, ValueError, OverflowError, RuntimeError):
        several = cast("list[Any]", value) if isinstance(value, list | tuple) else []
        parts = [_numbers(part) for part in several]
        known = [part.reshape(-1) for part in parts if part is not None]
        return np.concatenate(known) if known else None
    return array if array.dtype.kind in "iufb" else None


def _is_numeric(value: Any) -> bool:
    """Return whether a value is a number, an array, or a list that begins with one.

    A picture of Pillow is not one of them.
    """
    while isinstance(value, list | tuple):
        value = next((part for part in cast("list[Any]", value) if part is not None), "")
    return isinstance(value, int | float | np.generic) or (
        hasattr(value, "dtype") and hasattr(value, "shape")
    )


def _could_be_label(
    name: str,
    above: frozenset[str],
    numbers: npt.NDArray[Any],
    size: Size,
) -> bool:
    words = _words(name)
    last = _WORD.findall(name.lower())[-1:]
    if numbers.ndim >= 2 and size in (numbers.shape[:2], numbers.shape[-2:]):
        is_picture = numbers.ndim >= 3 and (
            numbers.shape[:2] == size or numbers.shape[-3] in (3, 4)
        )
        return not is_picture
    if numbers.ndim == 0:
        return _is_telling_number(words, float(numbers), size)
    # what is smaller are fractions, or flags: the same at every size
    pixels = np.abs(numbers).max() > 1
    if not pixels or HARMLESS.intersection(last):
        return False
    if words & SIZES and numbers.ndim == 1 and tuple(numbers.tolist()) in (size, size[::-1]):
        return True
    if words & (PLACES | COORDINATES) or above & PLACES:
        return True
    if words & HARMLESS or (name == "labels" and numbers.ndim == 1):  # the classes of boxes
        return False
    in_groups = numbers.shape[-1] in (2, 4) and numbers.ndim <= 3
    return bool(in_groups and numbers.min() >= 0 and numbers.max() <= (1 + SLACK) * max(size))


def _is_telling_number(
    words: frozenset[str],
    number: float,
    size: Size,
) -> bool:
    if words & COORDINATES:
        return abs(number) > 1
    return bool(words & SIZES) and number in size


def how_to_declare(path: str, value: Any) -> str:
    """Return an example of a declaration for a message."""
    if isinstance(value, str | bytes | Mapping | Action):
        return f"labels={{{path!r}: 'openai'}} (or another dialect of actions)"
    numbers = _numbers(value)
    if numbers is None or numbers.ndim == 0:
        return f"labels={{{path!r}: 'x'}} (or 'y', 'dx', 'dy', 'width', 'height')"
    if numbers.shape[-1] == 4:
        return f"labels={{{path!r}: 'xyxy'}} (or 'xywh', 'cxcywh')"
    if numbers.ndim >= 2 and numbers.shape[-1] > 4:
        return f"labels={{{path!r}: 'mask'}}"
    return f"labels={{{path!r}: 'point'}} (or 'xyxy', 'xywh', ...)"


def explained(
    path: str,
    value: Any,
    before: Size,
    after: Size,
) -> str:
    """Return the message for an undeclared label."""
    return (
        f"the sample's entry {path!r} ({shown(value)}) could be a label, and the picture goes from"
        f" {before[1]}x{before[0]} to {after[1]}x{after[0]}, but nothing says how it is written;"
        f" declare it, such as {how_to_declare(path, value)}, or {{{path!r}: 'leave'}} if it must"
        " not change"
    )
