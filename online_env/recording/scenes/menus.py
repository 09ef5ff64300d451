"""Menus and dialogs that a misplaced click opens.

The key or click that closes each of them again is tried out.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from hijack_data.types import Box

from ...desktops.commands import end
from ...effects.elements import LAUNCHERS
from ...errors import DesktopError
from ...tasks.hand import Hand
from ...tasks.tree_nodes import TreeNode, read_tree
from ..picture import ClickTarget, Picture
from ..stage import RecordingStage, Top, click, code_of, spot
from . import Refused
from .apps import APPS, App, browser, installed

PLACE = (160, 60, 1460, 900)  # of the window in which the click lands
LEAST = (60, 44)  # width and height; anything smaller is a tooltip
PATIENCE = 8.0  # s until the tree has what a click opened
ITEMS = ("menu-item", "check-menu-item", "radio-menu-item", "menu")
LEAVE = ("Cancel", "Close", "_Cancel", "_Close", "Done", "Got it")
BUTTONS = ("push-button", "button")
ESCAPE = {"type": "hotkey", "keys": ["esc"]}


@dataclass(frozen=True)
class Click:
    """A click on an element, or at a place.

    Args:
        name: The name of the element.
        role: Its role; any if empty.
        kind: The type of the action.
        at: A place instead, in parts of width and height.
    """

    name: str = ""
    role: str = ""
    kind: str = "click"
    at: tuple[float, float] | None = None


def _menus(*names: str) -> tuple[tuple[Click, ...], ...]:
    return tuple((Click(name, "menu"),) for name in names)


def _right(x: float, y: float) -> tuple[Click, ...]:
    return (Click(kind="right_click", at=(x, y)),)


def _item(menu: str, item: str) -> tuple[Click, ...]:
    return Click(menu, "menu"), Click(item)


def _press(name: str) -> tuple[Click, ...]:
    return (Click(name),)


# The clicks by application; those of a row follow one another.
CLICKS: dict[str, tuple[tuple[Click, ...], ...]] = {
    "mousepad": (
        _right(0.5, 0.5),
        *_menus("File", "Edit", "Search", "Document"),
        _item("File", "Open..."),
        _item("File", "Save As..."),
        _item("Search", "Find and Replace..."),
        _item("Help", "About"),
    ),
    "geany": (
        _right(0.6, 0.4),
        *_menus("File", "Edit", "View", "Build"),
        _press("Open"),
        _press("Color Chooser"),
        _item("Help", "About"),
    ),
    "thunar": (
        _right(0.7, 0.8),
        *_menus("File", "View", "Go"),
        (Click("tides.py", kind="right_click"),),
        _item("Edit", "Preferences..."),
        _item("Help", "About"),
    ),
    "xfce4-terminal": (_right(0.5, 0.5), *_menus("File", "Edit", "Tabs"), _item("Help", "About")),
    "chromium": (_right(0.03, 0.6), _press("Chromium")),
    "libreoffice_writer": (
        _right(0.45, 0.45),
        *_menus("File", "Insert", "Table"),
        _item("Insert", "Image..."),
        _item("Format", "Character..."),
        _item("Edit", "Find and Replace..."),
    ),
    "libreoffice_calc": (
        _right(0.45, 0.6),
        *_menus("File", "Sheet", "Data"),
        _item("Format", "Cells..."),
        _item("Data", "Sort..."),
        _item("Insert", "Chart..."),
    ),
    # VLC had no accessibility tree when this was recorded, so the place of its menu bar is given.
    "vlc": ((Click("Media", at=(0.02, 0.045)),),),
    "": (_press("Applications"), _right(0.5, 0.5), (Click("Web Browser", kind="right_click"),)),
}
# These open bubbles, which are drawn inside the application's own window.
BUBBLES = {"chromium": (Click("Not secure"), Click("Bookmark this tab"), Click("You"))}
BUBBLE_ROLES = ("alert", "dialog")


def record(stage: RecordingStage) -> Iterator[Picture | Refused]:
    """Yield what opens on a click in each application, last in the panel and the bare desktop."""
    known = {app.name: app for app in APPS}
    known["chromium"] = browser("http://wiki.test/wiki/Lighthouse")
    wanted = tuple(known[name] for name in CLICKS if name)
    there = {app.name: app for app in installed(stage, wanted)}
    for name, rows in CLICKS.items():
        if name in there:
            yield from Refused.instead(f"menus of {name}", _in_app(stage, there[name], rows))
        elif not name:
            yield from _each(stage, "desktop", None, rows)


def _in_app(
    stage: RecordingStage, app: App, rows: Sequence[Sequence[Click]]
) -> Iterator[Picture | Refused]:
    top = stage.place(app.open(stage), PLACE)
    try:
        yield from _each(stage, app.name, top, rows)
    finally:
        stage.close(top)
        end(stage.desktop, app.process)


def _each(
    stage: RecordingStage, app: str, top: Top | None, rows: Sequence[Sequence[Click]]
) -> Iterator[Picture | Refused]:
    for clicks in rows:
        before = {other.key for other in stage.tops()}
        yield from Refused.instead(_words(app, clicks), _picture(stage, app, top, clicks))
        _clear(stage, before)
    if top is None:
        return
    for wanted in BUBBLES.get(app, ()):
        yield from Refused.instead(_words(app, [wanted]), _bubble(stage, app, top, wanted))


def _picture(
    stage: RecordingStage, app: str, top: Top | None, clicks: Sequence[Click]
) -> Iterator[Picture]:
    stage.park()
    stage.settled()
    action: dict[str, Any] = {}
    opened: Top | None = None
    for number, wanted in enumerate(clicks):
        before = {other.key for other in stage.tops()}
        action = _aim(stage, wanted, opened or top)
        stage.run(code_of(action))
        what = f"window after the click on {wanted.name or wanted.at}"
        opened = stage.new(before, _large, what, 20.0 if number else 15.0)
        stage.park()
    if opened is None:
        raise DesktopError(f"{app}: no click was asked for, so nothing opened")
    if top is not None and opened.name.partition(".")[0] in LAUNCHERS:
        raise DesktopError(f"the click went past the window and opened one of {opened.name}")
    number = opened.id
    picture = stage.cut("menu", app, stage.top(opened.key), _words(app, clicks))
    yield replace(
        picture,
        kind=_kind(opened, picture.targets),
        recover=_leave(stage, lambda: stage.gone(number), picture.targets),
        opened_by=action if len(clicks) == 1 else None,
    )


def _kind(opened: Top, targets: Sequence[ClickTarget]) -> str:
    """Return `menu` for a window of its own that has items, or no buttons; otherwise `dialog`."""
    if not opened.free:
        return "dialog"
    roles = {target.role for target in targets}
    if roles.isdisjoint(ITEMS) and not roles.isdisjoint(BUTTONS):
        return "dialog"
    return "menu"


def _bubble(stage: RecordingStage, app: str, top: Top, wanted: Click) -> Iterator[Picture]:
    """Yield what opens inside the window: the node of the tree that was not there before.

    Raises:
        DesktopError: Nothing opened.
    """
    stage.park()
    stage.settled()
    before = {node.box for node in read_tree(stage.desktop.accessibility())}
    action = _aim(stage, wanted, top)
    stage.run(code_of(action))
    stage.park()

    def opened(node: TreeNode) -> bool:
        return node.role in BUBBLE_ROLES and node.box is not None and node.box not in before

    hand = Hand(stage.desktop, PATIENCE)
    box = hand.wait(f"bubble after the click on {wanted.name}", opened).box
    whole = stage.cut("dialog", app, stage.top(top.key), _words(app, [wanted]))
    if box is None:
        raise DesktopError(f"the tree gives no box for what {wanted.name} opened")
    picture = whole.part("dialog", box, opened_by=action)
    # Without the elements that lie below it.
    own = [target for target in picture.targets if target.box not in before]
    recover = _leave(stage, lambda: _no_bubble(stage, box), own)
    yield replace(picture, targets=own, recover=recover)


def _no_bubble(stage: RecordingStage, box: Box) -> bool:
    stage.settled()
    found = read_tree(stage.desktop.accessibility())
    return not any(node.box == box and node.role in BUBBLE_ROLES for node in found)


def _aim(stage: RecordingStage, wanted: Click, on: Top | None) -> dict[str, Any]:
    """Return the click as an action, on a window, or on the desktop and its panel.

    Raises:
        DesktopError: There is no such element.
    """
    surface = stage.screen if on is None else on.box
    if wanted.at is not None:
        x, y = spot(surface, wanted.at)
        return {"type": wanted.kind, "x": x, "y": y}

    def owner(other: Top | None) -> bool:
        return on is None or (other is not None and other.key == on.key)

    end = time.monotonic() + PATIENCE
    while True:
        found = stage.targets(surface, owner)
        for target in found:
            if target.name == wanted.name and wanted.role in ("", target.role):
                return click(wanted.kind, target)
        if time.monotonic() > end:
            break
    seen = ", ".join(sorted({f"{t.role} {t.name!r}" for t in found if t.name}))
    what = f"{wanted.role or 'element'} {wanted.name!r}"
    raise DesktopError(f"there is no {what}; there are: {seen:.900}")


def _leave(
    stage: RecordingStage, gone: Callable[[], bool], targets: Sequence[ClickTarget]
) -> dict[str, Any]:
    """Close what is open as a person would; return the action that did it.

    Raises:
        DesktopError: Nothing closes it.
    """
    buttons = [t for name in LEAVE for t in targets if t.name == name and t.role in BUTTONS]
    actions = [click("click", button) for button in buttons[:1]]
    actions.append(ESCAPE)
    for action in actions:
        stage.run(code_of(action))
        if gone():
            return action
    raise DesktopError("neither its button nor Escape closes it")


def _clear(stage: RecordingStage, before: set[int]) -> None:
    """Close whatever is left, so that the next click finds the application as it was."""
    for _ in range(3):
        left = [top for top in stage.tops() if top.key not in before and _large(top)]
        if not left:
            return
        stage.run(code_of(ESCAPE))
        if left[-1].client:
            stage.close(left[-1])


def _large(top: Top) -> bool:
    x1, y1, x2, y2 = top.box
    return x2 - x1 >= LEAST[0] and y2 - y1 >= LEAST[1]


def _words(app: str, clicks: Sequence[Click]) -> str:
    places = {"chromium": "the page", "desktop": "the desktop"}
    place = places.get(app, "the window")
    parts = [f"{wanted.kind.replace('_', ' ')} on {wanted.name or place}" for wanted in clicks]
    return f"{app}: {', then '.join(parts)}"
