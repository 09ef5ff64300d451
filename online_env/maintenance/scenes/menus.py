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
from ...recording.captured_picture import ClickTarget, Picture
from ...recording.stage import RecordingStage, TopWindow, click, spot, write_code
from ...tasks.hand import Hand
from ...tasks.tree_nodes import TreeNode, read_tree
from . import UnrecordedScene
from .apps import APPS, App, browser, installed

CLICKED_WINDOW_BOX = (160, 60, 1460, 900)  # of the window in which the click lands
MIN_MENU_SIZE = (60, 44)  # width and height; anything smaller is a tooltip
OPEN_TIMEOUT_S = 8.0  # s until the tree has what a click opened
ITEMS = ("menu-item", "check-menu-item", "radio-menu-item", "menu")
CANCEL_NAMES = ("Cancel", "Close", "_Cancel", "_Close", "Done", "Got it")
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


def record(stage: RecordingStage) -> Iterator[Picture | UnrecordedScene]:
    """Yield what opens on a click in each application, last in the panel and the bare desktop."""
    apps_by_name = {app.name: app for app in APPS}
    apps_by_name["chromium"] = browser("http://wiki.test/wiki/Lighthouse")
    apps = tuple(apps_by_name[name] for name in CLICKS if name)
    installed_apps = {app.name: app for app in installed(stage, apps)}
    for name, rows in CLICKS.items():
        if name in installed_apps:
            yield from UnrecordedScene.instead(
                f"menus of {name}", _in_app(stage, installed_apps[name], rows)
            )
        elif not name:
            yield from _record_clicks(stage, "desktop", None, rows)


def _in_app(
    stage: RecordingStage, app: App, rows: Sequence[Sequence[Click]]
) -> Iterator[Picture | UnrecordedScene]:
    top = stage.place(app.open(stage), CLICKED_WINDOW_BOX)
    try:
        yield from _record_clicks(stage, app.name, top, rows)
    finally:
        stage.close(top)
        end(stage.desktop, app.process)


def _record_clicks(
    stage: RecordingStage, app: str, top: TopWindow | None, rows: Sequence[Sequence[Click]]
) -> Iterator[Picture | UnrecordedScene]:
    for clicks in rows:
        before = {window.key for window in stage.top_windows()}
        yield from UnrecordedScene.instead(
            _split_names(app, clicks), _picture(stage, app, top, clicks)
        )
        _clear(stage, before)
    if top is None:
        return
    for bubble_click in BUBBLES.get(app, ()):
        yield from UnrecordedScene.instead(
            _split_names(app, [bubble_click]), _bubble(stage, app, top, bubble_click)
        )


def _picture(
    stage: RecordingStage, app: str, top: TopWindow | None, clicks: Sequence[Click]
) -> Iterator[Picture]:
    stage.park()
    stage.settled()
    action: dict[str, Any] = {}
    new_window: TopWindow | None = None
    for number, next_click in enumerate(clicks):
        before = {window.key for window in stage.top_windows()}
        action = _aim(stage, next_click, new_window or top)
        stage.run(write_code(action))
        description = f"window after the click on {next_click.name or next_click.at}"
        new_window = stage.new(before, _large, description, 20.0 if number else 15.0)
        stage.park()
    if new_window is None:
        raise DesktopError(f"{app}: no click was asked for, so nothing opened")
    if top is not None and new_window.name.partition(".")[0] in LAUNCHERS:
        raise DesktopError(f"the click went past the window and opened one of {new_window.name}")
    number = new_window.id
    picture = stage.cut("menu", app, stage.top(new_window.key), _split_names(app, clicks))
    yield replace(
        picture,
        kind=_kind(new_window, picture.targets),
        recover=_leave(stage, lambda: stage.wait_until_gone(number), picture.targets),
        opened_by=action if len(clicks) == 1 else None,
    )


def _kind(window: TopWindow, targets: Sequence[ClickTarget]) -> str:
    """Return `menu` for a window of its own that has items, or no buttons; otherwise `dialog`."""
    if not window.free:
        return "dialog"
    roles = {target.role for target in targets}
    if roles.isdisjoint(ITEMS) and not roles.isdisjoint(BUTTONS):
        return "dialog"
    return "menu"


def _bubble(
    stage: RecordingStage, app: str, top: TopWindow, bubble_click: Click
) -> Iterator[Picture]:
    """Yield what opens inside the window: the node of the tree that was not there before.

    Raises:
        DesktopError: Nothing opened.
    """
    stage.park()
    stage.settled()
    before = {node.box for node in read_tree(stage.desktop.accessibility())}
    action = _aim(stage, bubble_click, top)
    stage.run(write_code(action))
    stage.park()

    def is_new_bubble(node: TreeNode) -> bool:
        return node.role in BUBBLE_ROLES and node.box is not None and node.box not in before

    hand = Hand(stage.desktop, OPEN_TIMEOUT_S)
    box = hand.wait(f"bubble after the click on {bubble_click.name}", is_new_bubble).box
    window_picture = stage.cut("dialog", app, stage.top(top.key), _split_names(app, [bubble_click]))
    if box is None:
        raise DesktopError(f"the tree gives no box for what {bubble_click.name} opened")
    picture = window_picture.part("dialog", box, opened_by=action)
    # Without the elements that lie below it.
    new_targets = [target for target in picture.targets if target.box not in before]
    recover = _leave(stage, lambda: _no_bubble(stage, box), new_targets)
    yield replace(picture, targets=new_targets, recover=recover)


def _no_bubble(stage: RecordingStage, box: Box) -> bool:
    stage.settled()
    elements = read_tree(stage.desktop.accessibility())
    return not any(node.box == box and node.role in BUBBLE_ROLES for node in elements)


def _aim(stage: RecordingStage, aimed_click: Click, on: TopWindow | None) -> dict[str, Any]:
    """Return the click as an action, on a window, or on the desktop and its panel.

    Raises:
        DesktopError: There is no such element.
    """
    surface = stage.screen if on is None else on.box
    if aimed_click.at is not None:
        x, y = spot(surface, aimed_click.at)
        return {"type": aimed_click.kind, "x": x, "y": y}

    def owner(window: TopWindow | None) -> bool:
        return on is None or (window is not None and window.key == on.key)

    end = time.monotonic() + OPEN_TIMEOUT_S
    while True:
        targets = stage.targets(surface, owner)
        for target in targets:
            if target.name == aimed_click.name and aimed_click.role in ("", target.role):
                return click(aimed_click.kind, target)
        if time.monotonic() > end:
            break
    target_names = ", ".join(sorted({f"{t.role} {t.name!r}" for t in targets if t.name}))
    description = f"{aimed_click.role or 'element'} {aimed_click.name!r}"
    raise DesktopError(f"there is no {description}; there are: {target_names:.900}")


def _leave(
    stage: RecordingStage, is_gone: Callable[[], bool], targets: Sequence[ClickTarget]
) -> dict[str, Any]:
    """Close what is open as a person would; return the action that did it.

    Raises:
        DesktopError: Nothing closes it.
    """
    buttons = [t for name in CANCEL_NAMES for t in targets if t.name == name and t.role in BUTTONS]
    actions = [click("click", button) for button in buttons[:1]]
    actions.append(ESCAPE)
    for action in actions:
        stage.run(write_code(action))
        if is_gone():
            return action
    raise DesktopError("neither its button nor Escape closes it")


def _clear(stage: RecordingStage, before: set[int]) -> None:
    """Close whatever is left, so that the next click finds the application as it was."""
    for _ in range(3):
        windows = [top for top in stage.top_windows() if top.key not in before and _large(top)]
        if not windows:
            return
        stage.run(write_code(ESCAPE))
        if windows[-1].client:
            stage.close(windows[-1])


def _large(top: TopWindow) -> bool:
    x1, y1, x2, y2 = top.box
    return x2 - x1 >= MIN_MENU_SIZE[0] and y2 - y1 >= MIN_MENU_SIZE[1]


def _split_names(app: str, clicks: Sequence[Click]) -> str:
    places = {"chromium": "the page", "desktop": "the desktop"}
    default_name = places.get(app, "the window")
    parts = [
        f"{next_click.kind.replace('_', ' ')} on {next_click.name or default_name}"
        for next_click in clicks
    ]
    return f"{app}: {', then '.join(parts)}"
