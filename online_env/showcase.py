"""All nine corruptions on one live desktop, each before and after, with the probes' findings."""

import time
from collections.abc import Iterator
from dataclasses import dataclass

from hijack_data.corruption import corruption_names, make_corruption
from hijack_data.gallery import contact_sheet
from hijack_data.types import UInt8Array

from .corrupting.desktop_corruption import corrupt_desktop
from .desktops.commands import launch
from .desktops.protocol import Desktop
from .effects import resume
from .environment.settle import Settle, wait_until_settled
from .errors import DesktopError, DesktopTimeoutError

PAGE = "http://shop.test/"
HEADLINE = "Things that last."  # of that page; its document is in the tree before anything is drawn
OTHER_PAGE = "http://wiki.test/"
BROWSER = "google-chrome"
PAGE_TIMEOUT_S = 90.0  # s for the first page to come
POLL_S = 0.1  # s between two looks for it
SETTLED = Settle(quiet=0.7, cap=5.0, look=0.1)


@dataclass(frozen=True, eq=False)
class ShowcaseEntry:
    """One corruption.

    Args:
        name: Its name.
        before: The screen before it, uint8 RGB `[H, W, 3]`.
        after: What an agent sees after it, likewise.
        ok: Whether every probe succeeded.
        saw: What the probes found.
    """

    name: str
    before: UInt8Array
    after: UInt8Array
    ok: bool
    saw: str


def show_nine(desktop: Desktop, seed: int = 3) -> Iterator[ShowcaseEntry]:
    """Apply each of the nine to a page in the desktop's browser, and undo it.

    Raises:
        DesktopError: The desktop cannot have a corruption, or an effect cannot be undone.
    """
    launch(desktop, BROWSER, PAGE)
    _wait_for_page(desktop)
    for name in corruption_names()[:9]:
        settled_screen(desktop)
        yield _show(desktop, name, seed)


def sheet(entries: list[ShowcaseEntry], width: int = 1600) -> UInt8Array:
    """Return the contact sheet, uint8 RGB `[H, width, 3]`."""
    rows = [(entry.name, entry.before, entry.after) for entry in entries]
    captions = [entry.saw if entry.ok else f"FAILED: {entry.saw}" for entry in entries]
    return contact_sheet(rows, width, captions)


def _show(desktop: Desktop, name: str, seed: int) -> ShowcaseEntry:
    applied = corrupt_desktop(desktop, make_corruption(name), seed=seed)
    after = applied.after
    if name == "network_error":
        _visit(desktop, OTHER_PAGE)  # the page that is open already stays
        after = settled_screen(desktop)
    elif applied.records:
        after = settled_screen(desktop)
    for record in reversed(applied.records):
        undone = resume(record, desktop).undo()
        if not undone.ok:
            raise DesktopError(f"{name} could not be taken back: {undone.problem}")
    if name in ("network_error", "accidental_touch"):
        # A touch may have minimised or closed the browser: a new start of it shows it in any case.
        desktop.run("pyautogui.press('esc')")
        launch(desktop, BROWSER, PAGE)
        _wait_for_page(desktop)
    return ShowcaseEntry(name, applied.before, after, applied.ok, applied.saw)


def _visit(desktop: Desktop, address: str) -> None:
    desktop.run(
        f"pyautogui.hotkey('ctrl', 'l'); time.sleep(0.3); pyautogui.write({address!r} + '\\n')"
    )
    time.sleep(SETTLED.quiet)


def settled_screen(desktop: Desktop) -> UInt8Array:
    """Return the screen once it has settled, or after some seconds, uint8 RGB `[H, W, 3]`."""
    return wait_until_settled(desktop, SETTLED, with_tree=False).frame


def _wait_for_page(desktop: Desktop) -> None:
    end = time.monotonic() + PAGE_TIMEOUT_S
    while HEADLINE not in desktop.accessibility():
        if time.monotonic() > end:
            raise DesktopTimeoutError(f"{BROWSER} did not show {PAGE} within {PAGE_TIMEOUT_S:g} s")
        time.sleep(POLL_S)
