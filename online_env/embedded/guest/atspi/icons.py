"""The icons on Xfce's desktop, read from the file in which xfdesktop keeps their places.

xfdesktop leaves them out of its tree. The grid is that of xfdesktop 4.18 (measured on screens of
1280x800, 1600x900 and 1920x1080, right within 2 pixels).
"""

import configparser
import os
import re
from pathlib import Path

from hijack_data.types import Box

from .reader import Application, AtspiNode
from .states import DESKTOP_ICON_STATES, ICON

NAME = "xfdesktop"
PLACES = Path(".config/xfce4/desktop/icons.screen.latest.rc")
SETTINGS = Path(".config/xfce4/xfconf/xfce-perchannel-xml/xfce4-desktop.xml")
ICON_SIZE = 48
MARGIN = 16
PADDING = 6
TEXT_SHARE = 1.9
LABEL = 26
_SIZE = re.compile(r'name="icon-size"[^>]*value="(\d{1,3})')


def add_icons(application: Application, workarea: Box) -> None:
    """Add the desktop's icons to the desktop's window, if `application` is xfdesktop."""
    if application.root.name != NAME or not application.root.children:
        return
    window = application.root.children[0]
    home = Path.home()
    places = configparser.RawConfigParser(strict=False, delimiters=("=",))
    try:
        places.read_string((home / PLACES).read_text("utf-8", "replace"))
        settings = (home / SETTINGS).read_text("utf-8", "replace")
    except (OSError, configparser.Error):
        return
    match = _SIZE.search(settings)
    size = int(match[1]) if match else ICON_SIZE
    for section in places.sections():
        name = _label(section, home)
        try:
            row = places.getint(section, "row")
            column = places.getint(section, "col")
        except (configparser.Error, ValueError):
            continue  # a heading of the file's version
        if name:
            icon = AtspiNode(("", section), name, ICON, DESKTOP_ICON_STATES, role_name="icon")
            icon.box = _cell(row, column, size, workarea)
            window.adopt(icon)


def _label(section: str, home: Path) -> str:
    """Return the text under an icon; empty if its file is gone."""
    if not section.startswith("/"):
        return section
    if section == str(home):
        return "Home"
    if section == "/":
        return "File System"
    if os.path.lexists(section):
        return os.path.basename(section)
    return ""


def _cell(row: int, column: int, size: int, workarea: Box) -> tuple[int, int, int, int]:
    """Icon and first line of text of a place in the grid: `x, y, width, height`."""
    left, top, right, bottom = workarea
    cell = size * TEXT_SHARE + 2 * PADDING
    x = left + _start(column, cell, right - left) + PADDING
    y = top + _start(row, cell, bottom - top) + PADDING
    width = round(size * TEXT_SHARE)
    height = size + LABEL
    return round(x), round(y), width, height


def _start(index: int, cell: float, length: int) -> float:
    """Return where a row or column begins.

    The rest of `length` goes between the cells, and what then is left to both ends.
    """
    room = length - 2 * MARGIN
    count = max(1, int(room // cell))
    gap = 0
    if count > 1:
        gap = int((room - count * cell) / (count - 1))
    leftover = room - count * cell - (count - 1) * gap
    return MARGIN + leftover / 2 + index * (cell + gap)
