"""Coordinates inside text: the answers of grounding, as JSON fields or between tags.

| notation | numbers |
|---|---|
| `"bbox_2d": [x1, y1, x2, y2]`, `"point_2d": [x, y]`, in JSON | one box or point, or a list |
| `<box>(x1,y1),(x2,y2)</box>`, `[[x1,y1,x2,y2]]`, `x1 y1 x2 y2`; `<bbox>` | boxes |
| `<|box_start|>(x1,y1),(x2,y2)<|box_end|>` | boxes |
| `<point>x y</point>`, `[[x,y]]`; `<|point_start|>(x,y)<|point_end|>` | points |
| `<loc0123>`, `<loc_123>` | bins of the picture, the same at every size (format `loc`) |

The numbers change, every other character stays. A text with two further numbers, one of them
above 1, is an error, because two numbers can be a point in a notation that is not in this table;
quoted texts in JSON, such as a label, are no numbers.
"""

import re
from collections.abc import Callable
from typing import Any, cast

import numpy as np

from ..actions import Scaling
from ..actions.python_source import TextEdit, apply_edits
from ..errors import LabelError, short_repr
from ..smart_resize import smart_resize
from ..types import Size
from .base import Format, Location, Move, check_unit

RESIZED = -1
NOTATIONS = ("bbox_2d", "point_2d", "<box>", "<bbox>", "<point>")
_UNITS = {0: "", 1: "01", 1000: "1000", RESIZED: "_resized"}
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?", re.ASCII)
_MARK = re.compile(
    r"\"(?P<field>bbox_2d|point_2d)\"\s*:\s*(?P<list>\[[\s\d.,\[\]-]*\])"
    r"|<(?P<tag>box|bbox|point)>(?P<inside>[^<]*)</(?P=tag)>"
    r"|<\|(?P<token>box|point)_start\|>(?P<between>[^<]*)<\|(?P=token)_end\|>"
)
_ONLY_NUMBERS = re.compile(r"[\s\d.,()\[\]-]*")
_QUOTED = re.compile(r'"(?:[^"\\\n]|\\.)*"')
_LOC = re.compile(r"<loc_?(\d{1,4})>")


def grounding_format(unit: int) -> Format:
    """Return the format of text with marks; `unit` is 0, 1, 1000 or `RESIZED`."""

    def map_value(value: Any, move: Move) -> Any:
        def change(text: str) -> str:
            return _map_text(text, unit, move)

        return each_text(value, change)

    def locate(value: Any, size: Size) -> list[Location]:
        locations: list[Location] = []

        def collect(text: str) -> str:
            locations.extend(_locations(text, unit, size))
            return text

        each_text(value, collect)
        return locations

    return Format(f"grounding{_UNITS[unit]}", map_value, locate)


def loc_format() -> Format:
    """Return the format of text with `<loc...>` tokens, which are bins of the picture."""

    def check(text: str) -> str:
        if _LOC.search(text) is None:
            raise LabelError(f"holds no <loc...>: {short_repr(text)}")
        check_unplaced(_LOC.sub(" ", text))
        return text

    return Format("loc", lambda value, _: each_text(value, check))


def grounding_aliases() -> dict[str, str]:
    """Return the names under which each notation is declared as well: `bbox_2d1000` and so on."""
    names = {f"{n}{u}": f"grounding{u}" for n in NOTATIONS for u in _UNITS.values()}
    return {**names, "<loc>": "loc"}


def each_text(value: Any, change: Callable[[str], str]) -> Any:
    """Return a text, or a list or tuple of texts, each changed; bytes stay bytes.

    Raises:
        LabelError: the value is anything else.
    """
    if value is None:
        return None
    if isinstance(value, list | tuple):
        parts = [each_text(part, change) for part in cast("list[Any]", value)]
        return tuple(parts) if isinstance(value, tuple) else parts
    if isinstance(value, bytes):
        return str(change(value.decode("utf-8"))).encode("utf-8")
    if not isinstance(value, str):
        raise LabelError(f"must be text, got {short_repr(value)}")
    return change(value)


def could_be_point(text: str) -> bool:
    """Return whether a text has two numbers, of which one is above 1, in any notation."""
    largest = 0.0
    for count, match in enumerate(_NUMBER.finditer(text)):
        largest = max(largest, abs(float(match[0])))
        if count and largest > 1:
            return True
    return False


def check_unplaced(text: str) -> None:
    """Check the text that is left beside the marks.

    Raises:
        LabelError: it has two numbers that could be a point, and would stay as they are.
    """
    if could_be_point(_QUOTED.sub(" ", text)):
        raise LabelError(
            f"holds numbers outside of its marks: {short_repr(text.strip())}; declare a function"
            " that maps them, or 'leave' if they are no coordinates"
        )


def _marks(text: str) -> list[tuple[str, list[re.Match[str]], int]]:
    """Return of each mark its kind, box or point, its numbers, and where they begin.

    Raises:
        LabelError: the text has no mark, a mark is damaged, or other numbers could be a point.
    """
    marks: list[tuple[str, list[re.Match[str]], int]] = []
    text_between: list[str] = []
    position = 0
    for mark in _MARK.finditer(text):
        kind = mark["field"] or mark["tag"] or mark["token"]
        group = next(name for name in ("list", "inside", "between") if mark[name] is not None)
        inside = mark[group]
        numbers = list(_NUMBER.finditer(inside))
        width = 2 if kind.startswith("point") else 4
        if _ONLY_NUMBERS.fullmatch(inside) is None or not numbers or len(numbers) % width:
            raise LabelError(f"has the mark {short_repr(mark[0])}, which must hold {width} numbers")
        marks.append(("point" if width == 2 else "box", numbers, mark.start(group)))
        text_between.append(text[position : mark.start()])
        position = mark.end()
    text_between.append(text[position:])
    if not marks:
        raise LabelError(f"holds none of {', '.join(NOTATIONS)}: {short_repr(text)}")
    check_unplaced(" ".join(text_between))
    return marks


def _rows(kind: str, numbers: list[re.Match[str]], unit: int, size: Size) -> Any:
    """Return the numbers of a mark as rows, checked against their space.

    Raises:
        LabelError: the numbers do not fit their space, or corners are in the wrong order.
    """
    rows = np.array([float(n[0]) for n in numbers]).reshape(-1, 2 if kind == "point" else 4)
    picture_size = smart_resize(*size) if unit == RESIZED else size
    check_unit(rows, max(unit, 0), picture_size)
    if unit <= 0:
        bounds = Scaling(picture_size, picture_size, bounded=True)
        for row in rows.tolist():
            for index, value in enumerate(row):
                bounds.check(value, axis=1 - index % 2)
    if kind == "box" and (rows[:, 2:] < rows[:, :2]).any():
        raise LabelError(f"holds the box {rows[0].tolist()}, whose corners are in the wrong order")
    return rows


def _map_text(text: str, unit: int, move: Move) -> str:
    edits: list[TextEdit] = []
    scaling = move.scaling
    if unit == RESIZED:
        scaling = Scaling(smart_resize(*move.before), smart_resize(*move.after), bounded=True)
    for kind, numbers, start in _marks(text):
        rows = _rows(kind, numbers, unit, move.before)
        if unit > 0:
            continue
        is_whole = all("." not in number[0] for number in numbers)
        if not is_whole:
            mapped: Any = np.round(scaling.positions(rows), 2)
        elif kind == "point":
            mapped = scaling.points(rows)
        else:
            mapped = scaling.boxes(rows.astype(np.int64), clip=False)
        for number, value in zip(numbers, mapped.reshape(-1).tolist(), strict=True):
            edits.append(TextEdit(start + number.start(), start + number.end(), str(value)))
    return apply_edits(text, edits)


def _locations(text: str, unit: int, size: Size) -> list[Location]:
    height, width = size
    side = np.array([width, height])
    locations: list[Location] = []
    for kind, numbers, _ in _marks(text):
        rows = _rows(kind, numbers, unit, size)
        if unit > 0:
            rows = rows * np.tile(side, rows.shape[1] // 2) / unit
        elif unit == RESIZED:
            rows = Scaling(smart_resize(*size), size).positions(rows)
        locations += [Location(tuple(row)) for row in rows.tolist()]
    return locations
