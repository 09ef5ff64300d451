"""Pages in the browser: open an address, follow links, fill fields, choose, tick, press."""

import re
import time
from collections.abc import Mapping

from ..hand import BUTTONS, ENTRIES, PAUSE, Hand, Name, Roles, fits
from ..tree_nodes import TreeNode

APP = "chrom"
BAR = "Address and search bar"
FIELDS = ("entry", "combo-box", "spin-button", "text")
BOXES = ("radio-button", "check-box")
_LOADING_S = 4.0  # until a page that was asked for shows its heading
_TABBING = 2.0  # s until the next field has the focus
_MAX_SCROLLS = 30  # until a page must have come to its end


def visit(hand: Hand, address: str, heading: Name, *, in_new_tab: bool = False) -> None:
    """Open an address in the tab that shows or in a new one, and wait for a heading of the page."""
    hand.press("ctrl", "t" if in_new_tab else "l")
    hand.find("entry", BAR, app=APP, state="focused")
    hand.replace(address)
    hand.press("delete")  # what the browser completed
    hand.press("enter")
    hand.find("heading", heading, app=APP)


def begin(hand: Hand, address: str, heading: Name) -> None:
    """Go to a page, if it is not the one that shows, from its top.

    An oracle begins with it: at the start the page is open, later it may be another one.
    """
    deadline = time.monotonic() + _LOADING_S
    while time.monotonic() < deadline:
        bar = hand.see("entry", BAR, app=APP)
        if bar is not None and _shown_address(bar.text) not in ("", _shown_address(address)):
            break
        if hand.see("heading", heading, app=APP) is not None:
            return
        time.sleep(0.2)
    visit(hand, address, heading)


def _shown_address(address: str) -> str:
    """Return an address as the bar shows it."""
    return address.removeprefix("http://").rstrip("/")


def follow(hand: Hand, link: Name, heading: Name = None) -> None:
    """Click on a link, which may be further down, and wait for a heading of the page."""
    hand.click_on("link", link, app=APP, scroll=True)
    if heading is not None:
        hand.find("heading", heading, app=APP)


def push(hand: Hand, button: Name, heading: Name = None) -> None:
    """Press a button, which may be further down, and wait for a heading of the page."""
    hand.click_on(BUTTONS, button, app=APP, scroll=True)
    if heading is not None:
        hand.find("heading", heading, app=APP)


def enter(hand: Hand, field: Name, text: str) -> None:
    """Replace what a field holds, which may be further down."""
    hand.fill(field, text, app=APP, roles=FIELDS, scroll=True)


def enter_in_turn(hand: Hand, values: Mapping[str, str]) -> None:
    """Type into fields that follow one another, with the Tab key from each to the next.

    Args:
        hand: Whose.
        values: What to type, or the option of a drop-down list, by the name of the field.
    """
    for index, (field, text) in enumerate(values.items()):
        if index == 0 or not _comes_into_focus(hand, field):
            _go_to(hand, field)
        hand.type(f"{text}\t")


def _comes_into_focus(hand: Hand, field: str) -> bool:
    """Return whether a field has the focus, now or a moment later."""
    deadline = time.monotonic() + _TABBING
    while hand.see(FIELDS, field, APP, "focused") is None:
        if time.monotonic() > deadline:
            return False
        time.sleep(PAUSE)
    return True


def _go_to(hand: Hand, field: str) -> None:
    """Click on a field, which may be further down, so that typing replaces what it holds."""
    node = hand.find(FIELDS, field, app=APP, scroll=True)
    if node.role == "combo-box":
        hand.click_on("static", field, app=APP, scroll=True)  # the field itself opens its list
    else:
        hand.click(node)
    hand.find(FIELDS, field, APP, "focused")
    if node.role in ENTRIES:
        hand.press("ctrl", "a")


def select(hand: Hand, label: str, option: str) -> None:
    """Choose from a drop-down list by typing, without opening it.

    An open list may cover the pointer.
    """
    hand.click_on("static", label, app=APP, scroll=True)
    hand.find("combo-box", label, app=APP, state="focused")
    hand.type(option)


def tick(hand: Hand, label: Name) -> None:
    """Tick a box or a radio button, if it is not ticked."""
    if "checked" in hand.find(BOXES, label, app=APP, scroll=True).states:
        return
    hand.click_on(BOXES, label, app=APP, scroll=True)
    hand.find(BOXES, label, app=APP, state="checked")


def shows_text(hand: Hand, roles: Roles, name: Name) -> bool:
    """Return whether the page has a node, on the screen or further down; it is in sight then.

    What is not on the screen is not in the tree of this browser, so the page is scrolled.
    """
    before: list[TreeNode] = []
    for _ in range(_MAX_SCROLLS):
        time.sleep(0.3)  # a page comes, and scrolls, piece by piece
        nodes = page(hand)
        if any(fits(roles, name)(node) for node in nodes):
            return True
        if nodes and nodes == before:
            hand.run("pyautogui.scroll(50)")
            return False
        hand.run("pyautogui.scroll(-3)")
        before = nodes
    return False


def starting(*parts: str) -> re.Pattern[str]:
    """Return a pattern for a name that begins with some parts, a space between them."""
    return re.compile(re.escape(" ".join(parts)))


def page(hand: Hand) -> list[TreeNode]:
    """Return what shows of the page, without the browser's own parts, from top to bottom."""
    nodes = hand.look()
    document = next((node for node in nodes if node.role == "document-web" and node.box), None)
    if document is None or document.box is None:
        return []
    left, top, right, bottom = document.box
    inside = [node for node in nodes if node.box and APP in node.app.lower()]
    return [
        node
        for node in inside
        if left <= node.centre[0] <= right and top <= node.centre[1] <= bottom
    ]
