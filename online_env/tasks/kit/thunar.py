"""Thunar, the file manager, as a person uses it."""

import re
import time
from collections.abc import Sequence

from ...errors import DesktopTimeoutError
from ..hand import PAUSE, Hand

APP = "thunar"
ROWS = ("table-cell", "list-item")
TRIES = 3
LISTING_S = 1.0  # until a folder is surely listed


def go(hand: Hand, folder: str) -> None:
    """Show a folder, as a list: the accessibility tree has no icons.

    Args:
        hand: The hand.
        folder: Its path, from the root or relative to the home folder.
    """
    path = hand.path(folder)
    hand.press("ctrl", "l")
    hand.find("text", app=APP, state="focused")
    hand.type(f"{path}\n")
    hand.find("frame", re.compile(f"{re.escape(path.rpartition('/')[2])} - "), app=APP)
    as_list(hand)


def as_list(hand: Hand) -> None:
    """Show the folder as a list, if it is not."""
    if hand.see("directory-pane", "Details view", app=APP) is None:
        hand.press("ctrl", "2")
        hand.find("directory-pane", "Details view", app=APP)


def present(hand: Hand, *names: str) -> list[str]:
    """Return those of some names that the folder shows; if any lacks, look for a second."""
    deadline = time.monotonic() + LISTING_S
    while True:
        visible_names = {node.name for node in hand.look() if node.box and node.role in ROWS}
        present_names = [name for name in names if name in visible_names]
        if len(present_names) == len(names) or time.monotonic() > deadline:
            return present_names
        time.sleep(PAUSE)


def select(hand: Hand, *names: str) -> None:
    """Select files of the folder that shows, and nothing more.

    After rows were sorted, the accessibility tree may have the names of others for them, until the
    folder is loaded again; the status bar is right.

    Raises:
        DesktopTimeoutError: They cannot be selected.
    """
    for _ in range(TRIES):
        for index, name in enumerate(names):
            row = hand.find(ROWS, name, app=APP)
            if index:
                hand.add_click(row)
            else:
                hand.click(row)
        if _are_selected(hand, names):
            return
        reload(hand)
    raise DesktopTimeoutError(f"Thunar does not select {', '.join(names)}")


def reload(hand: Hand) -> None:
    """Load the folder again, so that the accessibility tree has the names that the rows have."""
    hand.press("ctrl", "r")
    time.sleep(LISTING_S)


def _are_selected(hand: Hand, names: Sequence[str]) -> bool:
    """Return whether the status bar shows within a second that these files are selected."""
    status = f'"{names[0]}" ' if len(names) == 1 else f"Selection: {len(names)} "
    deadline = time.monotonic() + LISTING_S
    while time.monotonic() < deadline:
        nodes = hand.look()
        bars = [node for node in nodes if node.role == "statusbar" and node.box]
        rows = {node.name for node in nodes if node.role in ROWS and "selected" in node.states}
        if rows.issuperset(names) and any(bar.name.startswith(status) for bar in bars):
            return True
        time.sleep(PAUSE)
    return False


def enter(hand: Hand, folder: str) -> None:
    """Go into a folder that shows."""
    hand.double_click(hand.find(ROWS, folder, app=APP))
    hand.find("frame", f"{folder} - Thunar", app=APP)


def up(hand: Hand, name: str) -> None:
    """Go to the parent folder, which has a name."""
    hand.press("alt", "up")
    hand.find("frame", f"{name} - Thunar", app=APP)


def make_folder(hand: Hand, name: str) -> None:
    """Make a folder in the one that shows, unless it is there."""
    if present(hand, name):
        return
    hand.press("ctrl", "shift", "n")
    hand.find("dialog", "Create New Folder", app=APP)
    hand.find("text", app=APP, state="focused")
    hand.replace(f"{name}\n")
    hand.find(ROWS, name, app=APP)


def rename(hand: Hand, old: str, new: str) -> None:
    """Give a file of the folder that shows another name, unless the old one is not there."""
    if not present(hand, old):
        return
    select(hand, old)
    hand.press("f2")
    hand.find(("text", "entry"), app=APP, state="focused")
    hand.replace(new)
    hand.press("enter")
    hand.find(ROWS, new, app=APP)


def paste(hand: Hand, *names: str) -> None:
    """Paste into the folder that shows; the files are there then.

    Thunar now and then misses some of several files that come at once, until it loads again.
    """
    hand.press("ctrl", "v")
    if len(present(hand, *names)) < len(names):
        reload(hand)
    for name in names:
        hand.find(ROWS, name, app=APP)


def move(hand: Hand, names: Sequence[str], folder: str) -> None:
    """Cut files in the folder that shows, and paste them in another; skip what is done.

    Args:
        hand: The hand.
        names: The names of the files.
        folder: Where to; it shows then. From the root, or relative to the home folder.
    """
    present_names = present(hand, *names)
    if present_names:
        select(hand, *present_names)
        hand.press("ctrl", "x")
    go(hand, folder)
    if present_names:
        paste(hand, *present_names)
