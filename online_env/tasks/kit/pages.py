"""Pages and settings in Chromium, and its dialogs, by pointer and keyboard."""

import re
import time
from collections.abc import Collection

from ...errors import DesktopTimeoutError
from ..hand import BUTTONS, PAUSE, Hand, Name, Roles
from .browser import BAR

CHROME = "chrom"
LINKS = ("link", *BUTTONS)
_MENU_EDGE = 8  # px above the first item of a menu of the settings
_MENU_ITEM = 36  # px
_DOUBLE_CLICKS = 3
_OPENING_S = 5.0  # that a folder may take to open


def visit(hand: Hand, address: str, title: str) -> None:
    """Type an address, and wait for the page whose title begins so.

    A browser that shows its page alone has no bar: there the page must be the one that shows.
    """
    is_there = hand.see("document-web", _beginning(title), CHROME) is not None
    if is_there and hand.see("entry", BAR, CHROME) is None:
        return
    hand.find("entry", BAR, CHROME)
    hand.press("ctrl", "l")
    # Without Delete, the address bar may complete what was typed to another address.
    hand.run(f"pyautogui.write({address!r}); pyautogui.press('delete'); pyautogui.press('enter')")
    wait_for_page(hand, title)


def wait_for_page(hand: Hand, title: str) -> None:
    """Wait for the page whose title begins so."""
    for role in ("frame", "document-web"):
        hand.find(role, _beginning(title), CHROME)


def _beginning(title: str) -> re.Pattern[str]:
    return re.compile(re.escape(title))


def follow(hand: Hand, name: Name, title: str = "") -> None:
    """Click on a link or a button, and wait for the page whose title begins so."""
    hand.click_on(LINKS, name, CHROME, scroll=True)
    if title:
        wait_for_page(hand, title)


def enter(hand: Hand, name: Name, text: str, role: Roles = "entry") -> None:
    """Replace what a field holds; it may be further down."""
    hand.fill(name, text, CHROME, role, scroll=True)


def tick(hand: Hand, role: str, name: str) -> None:
    """Tick a box or a radio button, unless it is ticked."""
    node = hand.find(role, name, CHROME, scroll=True)
    if "checked" not in node.states:
        hand.click(node)
    hand.find(role, name, CHROME, "checked")


def untick(hand: Hand, role: str, names: Collection[str]) -> None:
    """Clear those of some boxes that were ticked by accident."""
    for node in hand.look():
        if node.role == role and node.name in names and "checked" in node.states:
            hand.click(hand.find(role, node.name, CHROME, "checked", scroll=True))
            hand.wait_until_gone(role, node.name, CHROME, "checked")


def pick(hand: Hand, button: Name, index: int) -> None:
    """Press a button of Chromium's own pages and click on an item of its menu.

    Args:
        hand: Whose.
        button: The name of the button, such as `"More actions for News"`.
        index: Which item, from 0; the tree has no places for them.
    """
    hand.click_on(BUTTONS, button, CHROME)
    menu = hand.wait_until_stable("menu", lambda: hand.find("menu", app=CHROME))
    left, top, right, _ = menu.box or (0, 0, 0, 0)
    down = top + _MENU_EDGE + _MENU_ITEM // 2 + _MENU_ITEM * index
    hand.run(f"pyautogui.click({(left + right) // 2}, {down})")


def open_folder(hand: Hand, folder: str) -> None:
    """Open a folder of the bookmarks bar in Chromium's bookmark manager, which shows.

    On a busy desktop the page may take a double click for two clicks, which only select the folder.

    Raises:
        DesktopTimeoutError: The folder does not open.
    """
    hand.click_on("tree-item", "Bookmarks bar")
    for _ in range(_DOUBLE_CLICKS):
        hand.double_click(hand.find("static", folder, CHROME))
        deadline = time.monotonic() + _OPENING_S
        while time.monotonic() < deadline:
            if hand.see(BUTTONS, f"More actions for {folder}", CHROME) is None:
                return
            time.sleep(PAUSE)
    raise DesktopTimeoutError(f"the folder {folder!r} of the bookmark manager does not open")
