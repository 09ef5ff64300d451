"""Find entries of a sample that could be labels although their format is not declared.

Resizing a picture would silently make such an entry wrong, so it is an error until the user
declares it. Most are recognised by name: `bbox`, `click`, `keypoints`. Entries with other names are
recognised by their values: pairs or groups of four numbers that could be pixels of the picture, one
value per pixel, the text of an answer with coordinates.
"""

import re
from collections.abc import Mapping, Set
from dataclasses import fields, is_dataclass
from itertools import pairwise
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from ..errors import shown
from ..types import SLACK, Action, Size
from .numbers import host_array
from .rows import holds_coordinates

_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")
# Text that consists of numbers, as in CSV files: "100", "100 200 30 40", "[100;200]".
_NUMBERS = re.compile(r"[\s\[(]*-?\d+(?:\.\d+)?(?:[\s,;]+-?\d+(?:\.\d+)?)*[\s\])]*")
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
# How the actions of models begin, whatever the name of the entry.
_SAID = re.compile(
    r"pyautogui\.\w+\(|\b(?:start_box|end_box)\s*=|<tool_call>|<\|?(?:box|point)(?:_start\|)?>"
    r"|\"coordinate\"\s*:|\b(?:left_|right_|double_)?click\("
)

_OPENED = ("O", "U", "S")  # dtype kinds of arrays whose items are examined one by one

# What the words in the name of an entry suggest.
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
# The sides of a box as well as those of the picture.
SIDES = frozenset(["width", "height", "w", "h"])
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
# Prose for people; coordinates in it need not follow the pixels.
PROSE = frozenset(
    "instruction instructions goal question query thought thoughts reasoning caption description".split()  # noqa: E501, SIM905
)


def find_undeclared(
    name: str, value: Any, size: Size, *, aims: bool = False
) -> tuple[str, Any] | None:
    """Return the path and the value of the first part of an entry that could be a label.

    `None` if there is none.

    Args:
        name: the key of the entry.
        value: any value; dictionaries and lists of dictionaries are searched.
        size: (height, width) of the picture before it was resized.
        aims: also find torchvision's boxes and key points, which follow the pixels by themselves
            but may or may not be the target of the sample.
    """
    return _find(name, frozenset[str](), value, size, aims)


def _words(name: str) -> frozenset[str]:
    found = [word.lower() for word in _WORD.findall(name)]
    joined = [a + b for a, b in pairwise(found) if b.isdigit()]
    return frozenset([*found, *joined])


def _find(
    path: str, above: frozenset[str], value: Any, size: Size, aims: bool
) -> tuple[str, Any] | None:
    name = path.rpartition(".")[2]
    words = _words(name)
    if value is None or (isinstance(value, bool | bytes) and not (words & (ACTIONS | ANSWERS))):
        return None
    if isinstance(value, Action):
        return path, value
    if type(value).__module__.startswith("torchvision.tv_tensors"):
        known = type(value).__name__ in ("BoundingBoxes", "KeyPoints")
        return (path, value) if aims and known and len(cast(Any, value)) else None
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    if isinstance(value, str):
        return (path, value) if _is_telling_text(name, above, value, size) else None
    value = _opened(cast(Any, value))
    if isinstance(value, Mapping):
        entries = cast("Mapping[Any, Any]", value).items()
        items = [(f"{path}.{key}", part) for key, part in entries]
        return _first(items, words | above, size, aims)
    if isinstance(value, list | tuple):
        parts = _as_numbers(cast("list[Any]", value))
        if any(not _is_numeric(part) for part in parts if part is not None):
            return _first([(path, part) for part in parts], above, size, aims)
        value = parts
    numbers = _numbers(value)
    if numbers is None or not numbers.size:
        return None
    return (path, value) if _could_be_label(name, above, numbers, size) else None


def _opened(value: Any) -> Any:
    """Return a container as a list or a mapping of its values; any other value stays unchanged."""
    if isinstance(value, Set):
        return list(cast("Set[Any]", value))
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: getattr(value, field.name) for field in fields(value)}
    known: Any = value
    if isinstance(value, np.ndarray) and known.dtype.kind in _OPENED:
        return known.tolist()
    if getattr(known, "is_nested", False):  # a tensor of tensors of different lengths
        return list(known.unbind())
    return known


def _as_numbers(parts: list[Any]) -> list[Any]:
    """Convert a list of numbers in text form to numbers; any other list stays unchanged."""
    if parts and all(isinstance(part, str) and _NUMBER.fullmatch(part) for part in parts):
        return [float(part) for part in parts]
    return parts


def _first(
    items: list[tuple[str, Any]], above: frozenset[str], size: Size, aims: bool
) -> tuple[str, Any] | None:
    for path, part in items:
        found = _find(path, above, part, size, aims)
        if found is not None:
            return found
    return None


def _is_telling_text(name: str, above: frozenset[str], text: str, size: Size) -> bool:
    words = _words(name)
    if words & PROSE:
        return False
    if _NUMBERS.fullmatch(text) and not HARMLESS.intersection(_last_word(name)):
        numbers = [float(number) for number in _NUMBER.findall(text)]
        if len(numbers) == 1:
            return _is_telling_number(words, numbers[0], size)
        if (words | above) & (PLACES | COORDINATES):
            return max(map(abs, numbers)) > 1
    is_named = bool((words | above) & (PLACES | ACTIONS | ANSWERS))
    return (is_named or _SAID.search(text) is not None) and holds_coordinates(text)


def _numbers(value: Any) -> npt.NDArray[Any] | None:
    """Return the numbers of a value, or `None`."""
    if not _is_numeric(value):
        return None
    try:
        array = host_array(value)
    except (TypeError, ValueError, OverflowError, RuntimeError):
        return _joined(cast("list[Any]", value)) if isinstance(value, list | tuple) else None
    return array if array.dtype.kind in "iufb" else None


def _joined(parts: list[Any]) -> npt.NDArray[Any] | None:
    """Return the numbers of items that differ in shape, as rows if those have one length."""
    found = [_numbers(part) for part in parts]
    known = [np.atleast_1d(part) for part in found if part is not None and part.size]
    if not known:
        return None
    width = known[0].shape[-1]
    if all(part.shape[-1] == width for part in known):
        return np.concatenate([part.reshape(-1, width) for part in known])
    return np.concatenate([part.reshape(-1) for part in known])


def _is_numeric(value: Any) -> bool:
    """Return whether a value is a number, an array, or a list that begins with one.

    A PIL image does not count as one.
    """
    while isinstance(value, list | tuple):
        value = next((part for part in cast("list[Any]", value) if part is not None), "")
    if isinstance(value, int | float):
        return True
    dtype = getattr(value, "dtype", None)
    is_array = dtype is not None and hasattr(value, "shape")
    return is_array and getattr(dtype, "kind", None) not in _OPENED


def _could_be_label(
    name: str, above: frozenset[str], numbers: npt.NDArray[Any], size: Size
) -> bool:
    words = _words(name)
    last = _last_word(name)
    if size in (numbers.shape[:2], numbers.shape[-2:], numbers.shape[-3:-1]):
        return not _is_picture(numbers, size)
    if numbers.ndim == 0:
        return _is_telling_number(words, float(numbers), size)
    # smaller values are fractions or flags, which are the same at every size
    pixels = np.abs(numbers).max() > 1
    if not pixels or HARMLESS.intersection(last):
        return False
    if words & SIZES and numbers.ndim == 1 and tuple(numbers.tolist()) in (size, size[::-1]):
        return True
    if name == "labels" and numbers.ndim == 1:  # probably the classes of boxes
        return False
    if words & (PLACES | COORDINATES) or above & PLACES:
        return True
    if words & HARMLESS:
        return False
    if words & SIDES:
        return True
    in_groups = numbers.shape[-1] in (2, 4) and numbers.ndim <= 3
    return bool(in_groups and numbers.min() >= 0 and numbers.max() <= (1 + SLACK) * max(size))


def _is_picture(numbers: npt.NDArray[Any], size: Size) -> bool:
    """Return whether per-pixel values are colours; arrays with one channel, or many, are labels."""
    if numbers.ndim < 3 or numbers.dtype.kind == "b":
        return False
    channels = numbers.shape[-3] if numbers.shape[-2:] == size else numbers.shape[-1]
    return channels in (3, 4)


def _last_word(name: str) -> list[str]:
    return _WORD.findall(name.lower())[-1:]


def _is_telling_number(words: frozenset[str], number: float, size: Size) -> bool:
    if words & COORDINATES or (words & SIDES and not words & HARMLESS):
        return abs(number) > 1
    return bool(words & SIZES) and number in size


def how_to_declare(path: str, value: Any) -> str:
    """Return an example of a declaration for a message."""
    order = getattr(getattr(value, "format", None), "value", None)
    if order is not None:  # BoundingBoxes of torchvision
        return f"labels={{{path!r}: {str(order).lower()!r}}}"
    if isinstance(value, str | bytes | Mapping | Action):
        dialect = "pyautogui" if "pyautogui." in str(cast(Any, value)) else "openai"
        return f"labels={{{path!r}: {dialect!r}}} (or another dialect of actions)"
    numbers = _numbers(value)
    if numbers is None or numbers.ndim == 0:
        return f"labels={{{path!r}: 'x'}} (or 'y', 'dx', 'dy', 'width', 'height')"
    if numbers.shape[-1] == 4:
        return f"labels={{{path!r}: 'xyxy'}} (or 'xywh', 'cxcywh')"
    if numbers.ndim >= 3 and numbers.shape[-3] > 4:
        return f"labels={{{path!r}: 'mask'}} (its last axes have to be those of the picture)"
    if numbers.ndim >= 2 and numbers.shape[-1] > 4:
        return f"labels={{{path!r}: 'mask'}}"
    return f"labels={{{path!r}: 'point'}} (or 'xyxy', 'xywh', ...)"


def explained(path: str, value: Any, before: Size, after: Size) -> str:
    """Return the message for an undeclared label."""
    return (
        f"the sample's entry {path!r} ({shown(value)}) could be a label, and the picture goes from"
        f" {before[1]}x{before[0]} to {after[1]}x{after[0]}, but nothing says how it is written;"
        f" declare it, such as {how_to_declare(path, value)}, or {{{path!r}: 'leave'}} if it must"
        " not change"
    )
