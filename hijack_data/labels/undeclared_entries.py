"""Which values of a sample are harmless when its picture is resized, and what to declare of others.

The world is closed: a value is harmless by its type or name, or it is declared, or it is an error.
Harmless are

* `None`, booleans, dates, empty lists and arrays,
* a single number under names of no place or size (`reward`, `num_steps`; not `x`, `width`, `area`),
* text in which fewer than two numbers stand; lists of such texts, if all together hold fewer,
* text under the names of prose (`PROSE`) and of identifiers (`IDENTIFIERS`),
* dictionaries and lists of these, but a dictionary inside the sample with several numbers is not.

Nothing else is: no list or array of numbers or booleans, no text with coordinates of any notation,
no unknown object.
"""

import datetime
import re
from collections.abc import Callable, Mapping, Sequence, Set
from functools import lru_cache
from itertools import chain, pairwise
from numbers import Number
from typing import Any, cast

import numpy as np
from PIL import Image

from ..errors import HijackError, LabelError, short_repr
from ..sample_pictures import FOLLOWING, is_array, is_picture_shaped, is_tensor
from ..types import Action, Size
from .formats import FORMATS
from .nested_numbers import host_array

# Names of text that people read; coordinates in it need not follow the pixels. The last word of a
# name counts.
PROSE = frozenset(
    [
        "instruction",
        "instructions",
        "goal",
        "question",
        "query",
        "thought",
        "thoughts",
        "reasoning",
        "caption",
        "description",
    ]
)
# Names of text that identifies something.
IDENTIFIERS = frozenset(["id", "ids", "uuid", "file", "filename", "url", "timestamp", "date"])
# Names of a single number that is no coordinate, whatever stands before (`target_id`).
_COUNTS = frozenset(
    ["id", "ids", "index", "idx", "class", "category", "label", "count", "num", "number", "score"]
)
# Words in the name of a single number that is a coordinate or a size.
_PLACE_WORDS = """
xy yx xyxy xywh x0 y0 x1 y1 x2 y2 x3 y3 x4 y4 cx cy dx dy px py rx ry sx sy ux uy vx vy
xmin ymin xmax ymax minx miny maxx maxy posx posy xpos ypos startx starty endx endy
left top right bottom row col column bbox bboxes box boxes rect rects rectangle roi rois
region regions bounds bounding quad polygon polygons segmentation contour point points pt pts
click clicks tap touch coordinate coordinates coord coords keypoint keypoints kp kpts
landmark landmarks position pos location cursor pointer mouse center centre
target targets element elements gt truth action actions arg args
width height size resolution shape area radius diameter side scroll drag swipe
"""
_PLACES = frozenset(_PLACE_WORDS.split())
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")
_NUMBER = re.compile(r"\d+(?:\.\d+)?")
# Text that is one number, maybe with its unit: "115", " -3.5", "20px".
_LONE_NUMBER = re.compile(r"\s*[-+]?(?:\d+(?:\.\d*)?|\.\d+)\s*(?:[a-zA-Z%]{0,3})\s*")
_PATHS = 4096  # dotted paths whose words are remembered
_DATES = (datetime.date, datetime.time, datetime.timedelta)


class Undeclared:
    """Collects the parts of a sample that are neither harmless nor declared.

    Args:
        skip: says for a dotted path whether its value is declared, or a picture.
        aims: collect torchvision's boxes and key points, too: they follow the pixels by themselves,
            but may be the target of the sample.

    Attributes:
        parts: the value of each part by its dotted path.
    """

    def __init__(self, skip: Callable[[str, Any], bool], *, aims: bool = False) -> None:
        self.parts: dict[str, Any] = {}
        self._skip = skip
        self._aims = aims

    def check(self, path: str, value: Any, *, single: bool = True) -> None:
        """Collect the parts of a value that are not harmless.

        Args:
            path: its dotted path.
            value: the value.
            single: whether it stands in a dictionary, and not among others in a list.
        """
        if value is None or self._skip(path, value) or isinstance(value, _DATES):
            return
        if isinstance(value, bool | np.bool_):
            if not single:
                self.parts.setdefault(path, value)
        elif isinstance(value, str | bytes):
            if not _is_harmless_text(path, value):
                self.parts.setdefault(path, value)
        elif _is_boxed(value):
            self.check(path, value.item(), single=single)
        elif _is_single_number(value):
            if not single or names_place(path):
                self.parts.setdefault(path, value)
        elif isinstance(value, Mapping):
            self._check_dictionary(path, cast("Mapping[Any, Any]", value))
        elif isinstance(value, list | tuple | Set):
            self._check_list(path, list(cast("list[Any]", value)), value)
        elif is_tensor(value, *FOLLOWING):
            if self._aims and is_tensor(value, "BoundingBoxes", "KeyPoints") and len(value):
                self.parts.setdefault(path, value)
        elif _is_array_of_texts(value):
            self._check_list(path, list(value.flat), value)
        elif not (is_array(value) and 0 in tuple(value.shape)):
            self.parts.setdefault(path, value)

    def _check_dictionary(self, path: str, entries: Mapping[Any, Any]) -> None:
        numbers: dict[str, Any] = {}
        for key, part in entries.items():
            inside = f"{path}.{key}"
            if not _is_harmless_key(path, key, part):
                self.parts.setdefault(path, entries)
            self.check(inside, part)
            if _is_number(part) and not _is_count(inside) and not self._skip(inside, part):
                numbers[inside] = part
        if len(numbers) > 1:
            self.parts.update(numbers)

    def _check_list(self, path: str, parts: list[Any], original: Any) -> int:
        """Check a list, and return how many numbers the texts in it hold."""
        if path not in self.parts and self._is_clear_list(path, parts):
            return 0
        numbers = 0
        for part in parts:
            if isinstance(part, Mapping):
                self._check_item(path, cast("Mapping[Any, Any]", part))
            elif isinstance(part, str | bytes):
                numbers += _numbers_in(part)
            elif isinstance(part, list | tuple):
                numbers += self._check_list(path, list(cast("list[Any]", part)), part)
            else:
                self.check(path, part, single=False)
        is_prose = _last_word(path) in PROSE | IDENTIFIERS
        if path in self.parts or (numbers > 1 and not is_prose):
            self.parts[path] = original  # not only the first item of it
        return numbers

    def _is_clear_list(self, path: str, parts: list[Any]) -> bool:
        """Return whether a list surely holds nothing to collect, and no number in a text.

        It judges the values of one path in all items at once, which takes a tenth of a look at
        each. Where it is not sure, `_check_list` looks at each.
        """
        kinds = set(map(type, parts)) - {type(None)}
        if kinds == {dict}:
            return self._are_clear_dictionaries(path, [part for part in parts if part is not None])
        if kinds == {str}:
            return _NUMBER.search("\n".join(filter(None, parts))) is None
        return not kinds

    def _are_clear_dictionaries(self, path: str, items: list[dict[Any, Any]]) -> bool:
        names = dict.fromkeys(chain.from_iterable(items))
        return all(
            type(name) is str
            and _numbers_in(name) < 2
            and self._is_clear_column(
                f"{path}.{name}", [item[name] for item in items if name in item]
            )
            for name in names
        )

    def _is_clear_column(self, path: str, values: list[Any]) -> bool:
        """Return whether the values of one name in several dictionaries are surely harmless."""
        if self._skip(path, None):
            return True
        for kind in set(map(type, values)) - {type(None), bool}:
            parts = [value for value in values if type(value) is kind]
            if kind is str:
                is_clear = _NUMBER.search("\n".join(parts)) is None or all(
                    _is_harmless_text(path, text) and (_is_count(path) or not _is_number(text))
                    for text in parts
                )
            elif kind in (int, float):
                is_clear = _is_count(path)
            elif kind in (list, tuple):
                is_clear = self._is_clear_list(path, list(chain.from_iterable(parts)))
            else:
                is_clear = kind is dict and self._are_clear_dictionaries(path, parts)
            if not is_clear:
                return False
        return True

    def _check_item(self, path: str, entries: Mapping[Any, Any]) -> None:
        """Check a dictionary in a list, whose numbers are those of a list, except for counts."""
        self._check_dictionary(path, entries)
        for key, part in entries.items():
            inside = f"{path}.{key}"
            if _is_number(part) and not _is_count(inside) and not self._skip(inside, part):
                self.parts.setdefault(inside, part)


@lru_cache(_PATHS)
def names_place(path: str) -> bool:
    """Return whether a number under a dotted path could be a coordinate or a size by its names."""
    return not _is_count(path) and any(_is_place(word) for word in _words(path))


def _is_count(path: str) -> bool:
    return _last_word(path) in _COUNTS


def _is_place(word: str) -> bool:
    return word in _PLACES or (len(word) == 1 and word.isalpha())


def _words(path: str) -> set[str]:
    words = [word.lower() for word in _WORD.findall(path)]
    return {*words, *(a + b for a, b in pairwise(words) if b.isdigit())}


@lru_cache(_PATHS)
def _last_word(path: str) -> str:
    words = [word for word in _WORD.findall(path.rpartition(".")[2]) if not word.isdigit()]
    return words[-1].lower() if words else ""


def _is_array_of_texts(value: Any) -> bool:
    return isinstance(value, np.ndarray) and cast(Any, value).dtype.kind in "OUST"


def _is_boxed(value: Any) -> bool:
    """Return whether a value is an array of no axes that holds text or an object."""
    return _is_array_of_texts(value) and value.ndim == 0


def _is_single_number(value: Any) -> bool:
    if isinstance(value, Number):
        return not isinstance(value, complex)  # which holds two
    return getattr(value, "ndim", None) == 0 and getattr(value.dtype, "kind", "f") in "iufb"


def _is_number(value: Any) -> bool:
    """Return whether a value is one number, also as text."""
    if isinstance(value, bool | np.bool_):
        return False
    if isinstance(value, str):
        return _LONE_NUMBER.fullmatch(value) is not None
    return _is_single_number(value)


def _numbers_in(text: str | bytes) -> int:
    """Return how many numbers a text holds, up to 2; bytes that are no text count as 2."""
    if isinstance(text, bytes):
        try:
            text = text.decode("utf-8")
        except UnicodeDecodeError:
            return 2
    first = _NUMBER.search(text)
    if first is None:
        return 0
    return 1 if _NUMBER.search(text, first.end()) is None else 2


def _is_harmless_text(path: str, text: str | bytes) -> bool:
    count = _numbers_in(text)
    if count == 1:
        return not (_is_number(text) and names_place(path))
    return count == 0 or _last_word(path) in PROSE | IDENTIFIERS


def _is_harmless_key(path: str, key: Any, part: Any) -> bool:
    """Return whether the key of a dictionary names no place, as `"500,300"` or `(500, 300)` may."""
    if isinstance(key, str | bytes):
        return _numbers_in(key) < 2 or _is_harmless_text(path, key)
    if _is_single_number(key):
        return not _is_number(part) or _is_count(path)
    return key is None


# --- What to declare


def declarations(parts: Mapping[str, Any], size: Size) -> str:
    """Return `labels={...}` to paste: a format for each part, as its value and name suggest it."""
    lines: list[str] = []
    for path, value in parts.items():
        forms = suggested_formats(path, value, size)
        alternatives = f"; or {', '.join(map(repr, forms[1:]))}" if forms[1:] else ""
        lines.append(f"    {path!r}: {forms[0]!r},  # {_described(value)}{alternatives}")
    return "labels={\n" + "\n".join(lines) + "\n}"


def _described(value: Any) -> str:
    """Return a value in one line, to stand in a comment."""
    if isinstance(value, str | bytes) and is_picture_shaped(value):
        return "the file of a picture; decode it first, or leave it"
    if isinstance(value, Image.Image):
        return f"{value.width}x{value.height} image of mode {value.mode}"
    array: Any = value
    if is_array(array) and array.ndim > 1:
        return f"{type(array).__name__} of {array.dtype} {list(array.shape)}"
    return " ".join(short_repr(value).split())


def suggested_formats(path: str, value: Any, size: Size) -> list[str]:
    """Return formats that an undeclared value could have, the likeliest first."""
    order = getattr(getattr(value, "format", None), "value", None)
    if order is not None:  # BoundingBoxes of torchvision
        return [str(order).lower()]
    if isinstance(value, Action):
        return ["action"]
    if isinstance(value, str | bytes | Sequence | Set) and is_picture_shaped(value):
        return ["leave"]
    if is_picture_shaped(value, size):
        return _picture_formats(value, size)
    if isinstance(value, str | bytes | Mapping):
        return [*_dialects(value, size), "leave"]
    if isinstance(value, list | tuple) and any(
        isinstance(part, str | Mapping) for part in cast("list[Any]", value)
    ):
        return [*_dialects(value[0], size), "leave"]
    if _is_single_number(value):
        return _single_formats(path)
    try:
        numbers = host_array(value)
    except (TypeError, ValueError, OverflowError, RuntimeError):
        return ["leave"]
    return _array_formats(path, numbers, size)


def _picture_formats(value: Any, size: Size) -> list[str]:
    if isinstance(value, Image.Image):
        shape: tuple[int, ...] = (value.height, value.width, len(value.getbands()))
        is_colour = value.mode == "RGB"
    else:
        shape = tuple(value.shape)
        is_colour = str(value.dtype).endswith("uint8")
    if size not in (shape[-2:], shape[-3:-1]):
        return ["leave", "picture", "mask"]
    return ["picture", "mask", "leave"] if is_colour else ["mask", "leave", "picture"]


def _single_formats(path: str) -> list[str]:
    words = _words(path)
    for form, names in (
        ("x", {"x", "x1", "x2", "cx", "left", "right", "xmin", "xmax"}),
        ("y", {"y", "y1", "y2", "cy", "top", "bottom", "ymin", "ymax"}),
        ("dx", {"w", "width", "dx"}),
        ("dy", {"h", "height", "dy"}),
    ):
        if words & names:
            return [form, "leave"]
    return ["leave", "x", "y", "dx", "dy"]


def _array_formats(path: str, numbers: Any, size: Size) -> list[str]:
    if numbers.dtype.kind not in "iufb" or numbers.ndim == 0 or not numbers.size:
        return ["leave"]
    if numbers.shape[-2:] == size:
        return ["mask", "leave"]
    if numbers.dtype.kind == "b" or _last_word(path) in PROSE | IDENTIFIERS | _COUNTS:
        return ["leave"]
    if numbers.shape == (2,) and tuple(numbers.tolist()) in (size, size[::-1]):
        return ["hw" if tuple(numbers.tolist()) == size else "wh", "leave"]
    unit = "01" if np.abs(numbers).max() <= 1 else ""
    boxes = [f"xyxy{unit}", f"xywh{unit}", f"cxcywh{unit}"]
    points = [f"xy{unit}"]
    is_place = names_place(path)
    if numbers.shape[-1] == 4:
        return [*boxes, *points, "leave"]
    if numbers.shape[-1] == 2:
        return [*points, "leave"]
    if is_place and numbers.shape[-1] == 3 and not unit:
        return ["xyv", "leave"]
    if is_place and numbers.size % 2 == 0:
        return [*points, "leave"]
    return ["leave"]


def _dialects(value: Any, size: Size) -> list[str]:
    """Return the formats of actions and texts that read a value and find a point in it."""
    readers: list[str] = []
    for name, form in FORMATS.items():
        try:
            if form.locate(value, size):
                readers.append(name)
        except (HijackError, TypeError, ValueError, AttributeError):
            continue  # this format does not read the value
    return readers


def undeclared_error(
    parts: Mapping[str, Any], size: Size, after: Size, is_extended: bool
) -> LabelError:
    """Return the error for undeclared parts of a sample.

    Args:
        parts: their values by their dotted paths.
        size: (height, width) of the picture.
        after: its size after the plan.
        is_extended: whether other entries are declared.
    """
    names = ", ".join(map(repr, parts))
    if size != after:
        question = (
            f"the picture goes from {size[1]}x{size[0]} to {after[1]}x{after[0]}, and nothing says"
            " whether these entries of the sample must follow its pixels"
        )
    else:
        question = (
            "nothing says whether these entries of the sample are pictures, which follow the plan"
        )
    return LabelError(
        f"{question}: {names}. {'Add to your declarations' if is_extended else 'Declare them'}, and"
        " check every line: the formats are suggestions, and 'leave' passes an entry as it is,"
        f" which is wrong for one that holds a place:\n{declarations(parts, size)}"
    )
