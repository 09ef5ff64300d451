"""The sources of the viewer: a dataset or a run, behind one set of attributes and methods."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from hijack_data.gallery.markup import pretty
from hijack_data.types import Box, UInt8Array

from .index import Index

Fields = list[tuple[str, str]]
# The value of the column `inserted` of an index for a step that is not in the recording.
INSERTED = "yes"


@dataclass(kw_only=True)
class Detail:
    """What the page shows of one row beside its pictures; every text is for people.

    Args:
        size: (width, height) of the picture in pixels, if known.
        fields: groups of (name, value) by title: everything in the row.
        notes: what matters most, (title, text).
        action: the action in one line.
        code: the action as code.
        points: the point (x, y) that the action aims at, and the end of a drag, in pixels of the
            picture.
        box: the target in pixels of the picture.
        plan: the plan, as JSON.
        no_before: why there is no picture before, or empty.
        problem: the part of the row that cannot be shown, and why.
    """

    size: tuple[int, int] | None = None
    fields: dict[str, Fields] = field(default_factory=dict[str, Fields])
    notes: Fields = field(default_factory=Fields)
    action: str = ""
    code: str = ""
    points: list[tuple[int, int]] = field(default_factory=list[tuple[int, int]])
    box: Box | None = None
    plan: str = ""
    no_before: str = ""
    problem: str = ""


class ViewerSource(Protocol):
    """An open folder whose rows can be shown.

    `labels` are the columns of the index that can be filtered by, with their titles; `chips` those
    of them that a tile shows. `problems` lists what could not be read. Methods may be called from
    several threads.
    """

    title: str
    facts: str
    problems: list[str]
    labels: dict[str, str]
    chips: tuple[str, ...]
    index: Index

    def detail(self, row: int) -> Detail:
        """Return everything known of a row of the index; an unreadable row is a `HijackError`."""
        ...

    def glance(self, row: int) -> Detail:
        """Return what a tile shows: size, action, points and box, or raise a `HijackError`."""
        ...

    def picture(self, row: int, before: bool) -> UInt8Array:
        """Return the picture of a row, or the one before the corruption, uint8 `[H, W, 3]`.

        A picture that cannot be read is a `HijackError`.
        """
        ...


def display_text(value: object) -> str:
    """Return a value for people: text as it is, anything else as JSON."""
    if isinstance(value, str):
        return value
    return _json(value)


def tidy(text: str) -> str:
    """Return JSON text over several lines, and other text as it is."""
    try:
        return _json(json.loads(text))
    except (ValueError, RecursionError):
        return text


def action_text(action: Mapping[str, Any]) -> str:
    """Return an action in words, such as `click at (3, 4)` or `type 'hello'`."""
    words = [str(action.get("type") or "no action")]
    if action.get("x") is not None:
        words.append(f"at ({action['x']}, {action['y']})")
    if action.get("x2") is not None:
        words.append(f"to ({action['x2']}, {action['y2']})")
    if action.get("text") is not None:
        words.append(repr(action["text"]))
    if action.get("keys"):
        words.append("+".join(map(str, action["keys"])))
    if action.get("amount") is not None:
        words.append(f"{action['amount']:g}")
    return " ".join(words)


def action_points(action: Mapping[str, Any]) -> list[tuple[int, int]]:
    """Return the point of an action, and the end of a drag."""
    points: list[tuple[int, int]] = []
    for names in (("x", "y"), ("x2", "y2")):
        x, y = map(action.get, names)
        if x is not None and y is not None:
            points.append((int(x), int(y)))
    return points


def _json(value: object) -> str:
    try:
        return pretty(value)
    except (TypeError, ValueError, RecursionError):
        return str(value)
