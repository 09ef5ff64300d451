"""Corrections of boxes that LibreOffice reports wrongly."""

from hijack_data.types import Box

from .reader import Application, AtspiNode, walk
from .states import MENU_BAR, ROOT_PANE, SHOWING
from .visibility import corners


def correct_libreoffice_boxes(application: Application) -> None:
    """Correct the windows of LibreOffice, which have a menu bar of the toolkit.

    LibreOffice learns only from a click that the bar takes room. Until then it reports the root
    pane below it, and all of its own that is in the pane, as too high by the height of the bar.
    The panel that the pane fills and the toolkit's fields in tool bars are reported rightly. The
    pane has a menu bar of LibreOffice's own, too: it is not drawn, although it says so.

    Args:
        application: Its nodes have their boxes.
    """
    for window in application.root.children:
        for pane in [node for node in walk(window) if node.role == ROOT_PANE]:
            _fill_parent(pane)
            _hide_second_bar(pane, window)


def _fill_parent(pane: AtspiNode) -> None:
    """Move a root pane that is as large as its parent to where that is."""
    if pane.parent is None or pane.box is None or pane.parent.box is None:
        return
    x, y, *size = pane.box
    left, top, *room = pane.parent.box
    if size == room and (x, y) != (left, top):
        _move(pane, (left - x, top - y), corners(pane.parent))


def _move(node: AtspiNode, by: tuple[int, int], room: Box) -> None:
    """Move a node and all below it, except for what lies in its parent only if it stays."""
    if node.box is not None:
        stays = corners(node)
        x, y, width, height = node.box
        node.box = (x + by[0], y + by[1], width, height)
        moved = corners(node)
        if _is_within(stays, room) and not _is_within(moved, room):
            node.box = (x, y, width, height)
            return
        room = moved
    for child in node.children:
        _move(child, by, room)


def _hide_second_bar(pane: AtspiNode, window: AtspiNode) -> None:
    """Take `showing` from the menu bar of a root pane, if its window has another one."""
    inside = [node for node in walk(pane) if node.role == MENU_BAR]
    bars = [node for node in walk(window) if node.role == MENU_BAR]
    if len(bars) == len(inside):
        return
    for bar in inside:
        for node in walk(bar):
            node.states &= ~SHOWING


def _is_within(box: Box, room: Box) -> bool:
    return room[0] <= box[0] and room[1] <= box[1] and box[2] <= room[2] and box[3] <= room[3]
