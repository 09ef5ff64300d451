"""Judge from elements and actions whether a menu is open on a recorded screen.

With a menu open, the next click closes it and does not open a second one. So the menu of an
accidental click is shown only where no menu is open.
"""

from collections.abc import Iterator, Sequence
from typing import Literal, TypeAlias

from hijack_data.types import Action, Box, Step

from ..readers.recorded_actions import AlteredStep
from .base import Frame

State: TypeAlias = Literal["open", "closed", "not known"]
# After these actions no menu is open; a click may have opened one.
CLOSING = frozenset({"type", "scroll", "drag", "double_click", "triple_click"})
CLOSING_KEYS = frozenset({"esc", "escape", "enter", "return", "ctrl", "control"})
ESCAPE = frozenset({"esc", "escape"})
# Pixels by which the sides of a menu's items may differ.
SIDE_TOLERANCE_PX = 2
# The least items of a menu; fewer elements may be something else.
MIN_ITEMS = 3
# Items that cannot be clicked leave gaps of at most this many heights of an item.
MAX_GAP_HEIGHTS = 1.5


def menu_state(frame: Frame) -> State:
    """Return whether a menu is open on the screen of a step."""
    last = _last_action(frame)
    if _is_escape(frame.step.action) or (last is not None and last.type == "right_click"):
        return "open"
    if frame.step.elements:
        return "open" if has_menu(frame.step.elements) else "closed"
    if last is None or last.type in CLOSING:
        return "closed"
    if last.type == "hotkey" and _keys(last) & CLOSING_KEYS:
        return "closed"
    return "not known"


def has_menu(elements: Sequence[Box]) -> bool:
    """Return whether elements look like an open menu: a column that lies over other elements.

    The column of a side bar or a table does not cover other elements.
    """
    columns = _columns(sorted(set(elements)))
    return any(_covers_others(column, elements) for column in columns)


def _last_action(frame: Frame) -> Action | None:
    """Return the last action before the step that did something on the screen, if there is one."""
    before: list[Step] = []
    for step in frame.trajectory:
        if step.index == frame.step.index:
            break
        before.append(step)
    for step in reversed(before):
        if isinstance(step, AlteredStep):
            return Action("other")  # something else arrived
        if getattr(step, "acts", True) and step.action.type != "wait":
            return step.action
    return None


def _is_escape(action: Action) -> bool:
    if action.type != "hotkey" or action.keys is None:
        return False
    return _keys(action) <= ESCAPE


def _keys(action: Action) -> set[str]:
    return {key.lower() for key in action.keys or ()}


def _columns(boxes: Sequence[Box]) -> Iterator[list[Box]]:
    """Yield columns of at least `MIN_ITEMS` similar boxes, one below the other."""
    remaining = list(boxes)
    while remaining:
        first = remaining[0]
        column = [box for box in remaining if _is_below(box, first)]
        remaining = [box for box in remaining if box not in column]
        column.sort(key=lambda box: box[1])
        yield from _runs(column)


def _is_below(first: Box, second: Box) -> bool:
    """Return whether two boxes begin and end at the same columns."""
    return (
        abs(first[0] - second[0]) <= SIDE_TOLERANCE_PX
        and abs(first[2] - second[2]) <= SIDE_TOLERANCE_PX
    )


def _runs(column: Sequence[Box]) -> Iterator[list[Box]]:
    run: list[Box] = []
    for box in column:
        if run and not _follows(run[-1], box):
            if len(run) >= MIN_ITEMS:
                yield run
            run = []
        run.append(box)
    if len(run) >= MIN_ITEMS:
        yield run


def _follows(above: Box, below: Box) -> bool:
    height = above[3] - above[1]
    difference = below[3] - below[1] - height
    gap = below[1] - above[3]
    return (
        abs(difference) <= SIDE_TOLERANCE_PX
        and -SIDE_TOLERANCE_PX <= gap <= MAX_GAP_HEIGHTS * height
    )


def _covers_others(column: Sequence[Box], elements: Sequence[Box]) -> bool:
    outside = [box for box in elements if box not in column]
    for item in column:
        for box in outside:
            if _overlap(item, box) and not _holds(item, box):
                return True
    return False


def _overlap(first: Box, second: Box) -> bool:
    """Return whether two boxes share more than an edge."""
    width = min(first[2], second[2]) - max(first[0], second[0])
    height = min(first[3], second[3]) - max(first[1], second[1])
    return width > SIDE_TOLERANCE_PX and height > SIDE_TOLERANCE_PX


def _holds(outer: Box, inner: Box) -> bool:
    begins = outer[0] <= inner[0] and outer[1] <= inner[1]
    ends = inner[2] <= outer[2] and inner[3] <= outer[3]
    return begins and ends
