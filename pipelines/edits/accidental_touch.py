"""Accidental touch in a recording: an inserted step at which a click opened a menu or dialog.

The spec is `hijack_data/corruptions/accidental_touch.py`, the effect on a live machine
`online_env/effects/accidental_touch.py`.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

from hijack_data.apps import normalize_app
from hijack_data.geometry import holds_middle
from hijack_data.pack import Asset, AssetPack
from hijack_data.plan import Effect, Paste
from hijack_data.rng import Stream
from hijack_data.types import Box, Point, Size

from .base import (
    NAME_APPS,
    Answer,
    Edit,
    EditedStep,
    Frame,
    NotApplicable,
    between_bars,
    name_programs,
    recorded_apps,
)
from .open_menus import menu_state

KINDS = ("menu", "dialog")
# Elements above this share of the screen are working areas, where a click opens nothing.
MAX_ELEMENT_SHARE = 0.02
# The application names under which menus of the panel and of the bare desktop are recorded.
PANEL = "desktop"
# The largest distance in pixels of a menu, or of a button's bubble, from the element that opened
# it.
MAX_OPENER_GAP_PX = 8
# Pixels by which the sides of an element may differ from those of the element that opened a
# picture; the heights of panels vary more.
SIDE_TOLERANCE_PX = 1
PANEL_SIDE_TOLERANCE_PX = 4
# On another desktop, an element may be this many times smaller or larger than the element that
# opened a picture.
MAX_SHRINK = 2.0
MAX_GROWTH = 1.5
# It stands in the bar of a window that fills the screen: within this share of the height from the
# top, beyond this share of the width, or as far from the left as it was, within so many pixels.
BAR_SHARE = 0.12
RIGHT_SHARE = 0.9
MAX_OFFSET_PX = 24
# The least contrast, in levels of grey, of the letters of an element that can be clicked; disabled
# elements have less.
MIN_CONTRAST = 100
# Words in the names of elements that refer to a file or a site of the recorded machine.
FILE_NAME = re.compile(r"[\w-]+\.[a-z]{1,5}\b")
PAGE_MARKS = ("Not secure", "Bookmark this tab")


@dataclass(frozen=True)
class _Opening:
    """A clicked element, and a recorded picture of what such a click opens."""

    element: Box
    asset: Asset


class TouchEdit(Edit):
    """Inserts a recorded menu or dialog at an element, and the action that closed it.

    An element is assumed to open what an element of its size opened in the recordings of the same
    application. Whether this very element does so is unknown, but a desktop really showed such a
    menu, and the recording shows how it is closed.
    """

    kind: ClassVar[str] = "touch"
    event: ClassVar[str] = "Something was clicked by accident, and a {} opened."
    answer: ClassVar[Answer] = "undo"
    inserted: ClassVar[bool] = True
    uses_elements: ClassVar[bool] = True
    version: ClassVar[int] = 2

    def apply(self, frame: Frame, effect: Effect) -> EditedStep:
        """Return the screen with the menu or dialog; see `Edit.apply`.

        Raises:
            NotApplicable: the event cannot be shown realistically; the message is the reason.
        """
        frame.check_desktop()
        elements = _clickable(frame, effect)
        _check_menus(frame)
        opening = _opening(frame, elements)
        asset = opening.asset
        element = opening.element
        if asset.recover is None:  # guaranteed by `_is_shown`
            raise NotApplicable(f"how {asset.id} is closed was not recorded")
        x, y = _corner_on_screen(asset, element, frame.scene.size)
        return self.make_step(
            ops=(Paste(asset.recipe(), ((x, y),)),),
            fidelity="composited",
            response=asset.recover.translate(x, y),
            boxes=[_move_box(target.box, x, y) for target in asset.targets],
            notes=(f"the element at {list(element)} was clicked",),
            detail="menu" if _touches_opener(asset) else "dialog",
        )

    def assumed_apps(self, pack: AssetPack, stream: Stream) -> Iterator[tuple[str, ...]]:
        """Yield the applications whose menus or dialogs were recorded."""
        return recorded_apps(pack, KINDS, stream)


def _move_box(box: Box, x: int, y: int) -> Box:
    return box[0] + x, box[1] + y, box[2] + x, box[3] + y


def _clickable(frame: Frame, effect: Effect) -> list[Box]:
    """Return the elements that an accidental click could hit, in the plan's order.

    Raises:
        NotApplicable: the event cannot be shown realistically; the message is the reason.
    """
    elements = list(_candidates(frame, effect))
    if not elements and frame.guess:
        elements = [(x1, y1, x2, y2) for x1, y1, x2, y2 in effect.params["boxes"]]
    if not elements:
        raise NotApplicable("no element but the target is known that could be clicked")
    return elements


def _check_menus(frame: Frame) -> None:
    """Refuse a screen on which a menu is, or may be, open already.

    Raises:
        NotApplicable: the event cannot be shown realistically; the message is the reason.
    """
    if frame.guess:
        return
    state = menu_state(frame)
    if state == "open":
        raise NotApplicable("a menu is open on this screen already, which a click would close")
    if state == "not known":
        raise NotApplicable(
            "a menu may be open on this screen: the action before it was a click, and the recording"
            " holds no elements"
        )


def _opening(frame: Frame, elements: Sequence[Box]) -> _Opening:
    """Return the opening at the first element that is known to open something.

    Raises:
        NotApplicable: the event cannot be shown realistically; the message is the reason.
    """
    recorded = [asset for kind in KINDS for asset in frame.pack.pictures(kind)]
    usable = [asset for asset in recorded if _usable(asset, frame)]
    for element in elements:
        fitting = [asset for asset in usable if _opens(element, asset, frame)]
        if fitting:
            return _Opening(element, frame.stream.choice(fitting))
    # A dialog stands in the middle of the screen, whatever opened it.
    dialogs = [asset for asset in frame.pack.pictures("dialog") if _is_shown(asset, frame)]
    if frame.guess and dialogs:
        return _Opening(elements[0], frame.stream.choice(dialogs))
    raise NotApplicable(_why_nothing_opens(frame))


def _why_nothing_opens(frame: Frame) -> str:
    if not frame.apps:
        return f"the recording names no application whose menus could open; {NAME_APPS}"
    if len(frame.apps) > 1:
        return (
            "the recording uses several applications, and which one this step shows is not recorded"
        )
    (app,) = frame.apps
    return (
        f"no element of this screen is known to open a menu or dialog that was recorded of {app}"
        f"{name_programs(frame.apps)}"
    )


def _candidates(frame: Frame, effect: Effect) -> Iterator[Box]:
    """Yield the elements, in the plan's order, at which the recorded action does not aim.

    Launchers of other applications are in the bars of a screen; `without_app` leaves them out, as
    on a live desktop.
    """
    height, width = frame.scene.size
    for x1, y1, x2, y2 in effect.params["boxes"]:
        box = (x1, y1, x2, y2)
        if holds_middle(box, frame.scene.target):
            continue
        if effect.params["without_app"] and _in_bar(box, frame.scene.size):
            continue
        is_large = (x2 - x1) * (y2 - y1) > MAX_ELEMENT_SHARE * width * height
        if not is_large and _stands_out(box, frame):
            yield box


def _stands_out(box: Box, frame: Frame) -> bool:
    """Return whether an element looks as if it could be clicked.

    An element that cannot, such as one behind a dialog, is greyed out.
    """
    x1, y1, x2, y2 = box
    levels = frame.image[max(y1, 0) : y2, max(x1, 0) : x2].mean(axis=2)
    if not levels.size:
        return False
    contrast = float(levels.max() - levels.min())
    return contrast >= MIN_CONTRAST


def _in_bar(box: Box, size: Size) -> bool:
    first, end = between_bars(size)
    middle = (box[1] + box[3]) // 2
    return not first <= middle < end


def _usable(asset: Asset, frame: Frame) -> bool:
    """Return whether a left click opened a picture, in an application of the recording."""
    if asset.opened_by is None or asset.opened_by.action.type != "click":
        return False
    return _is_shown(asset, frame)


def _is_shown(asset: Asset, frame: Frame) -> bool:
    """Return whether the recording can show a picture: it fits, belongs there and can be closed."""
    h, w = asset.size
    height, width = frame.scene.size
    if asset.recover is None or h > height or w > width:
        return False
    return _belongs_to_recording(asset, frame) and not _names_a_document(asset)


def _names_a_document(asset: Asset) -> bool:
    """Return whether a picture names a document or a page, which is not that of the recording."""
    listed = any(FILE_NAME.search(target.name) for target in asset.targets)
    return listed or asset.made_by.endswith(PAGE_MARKS)


def _belongs_to_recording(asset: Asset, frame: Frame) -> bool:
    """Return whether a picture is of our desktop's panel or of the recording's only application."""
    name = normalize_app(asset.app)
    if name == PANEL:
        return not frame.is_foreign
    if len(frame.apps) != 1:
        return False
    return name in frame.apps


def _opens(element: Box, asset: Asset, frame: Frame) -> bool:
    """Return whether an element is like the element that opened the picture."""
    opener = _opener(asset)
    if opener is None:
        return False
    if frame.is_foreign:
        return _is_similar(element, opener) and _in_window_bar(element, asset, frame)
    if normalize_app(asset.app) == PANEL:
        return _is_alike(element, opener, PANEL_SIDE_TOLERANCE_PX) and _in_bar(
            element, frame.scene.size
        )
    return _is_alike(element, opener, SIDE_TOLERANCE_PX)


def _is_alike(element: Box, opener: Box, tolerance: int) -> bool:
    """Return whether the sides of two boxes differ by at most `tolerance` pixels."""
    pairs = zip(_sides(element), _sides(opener), strict=True)
    return all(abs(side - opener_side) <= tolerance for side, opener_side in pairs)


def _is_similar(element: Box, opener: Box) -> bool:
    """Return whether an element, by its size, could be the opener on another desktop."""
    pairs = zip(_sides(element), _sides(opener), strict=True)
    return all(
        opener_side <= MAX_SHRINK * side and side <= MAX_GROWTH * opener_side
        for side, opener_side in pairs
    )


def _in_window_bar(element: Box, asset: Asset, frame: Frame) -> bool:
    """Return whether an element is where the opener would be in a window that fills the screen."""
    height, width = frame.scene.size
    if element[3] > BAR_SHARE * height:
        return False
    if _is_right(asset):
        return element[2] >= RIGHT_SHARE * width
    menus = [menu for menu in frame.pack.pictures("menu", asset.app) if _opener(menu) is not None]
    left = min(_opened_at(menu) for menu in menus or [asset])
    expected = _opened_at(asset) - left
    return abs(element[0] - expected) <= MAX_OFFSET_PX


def _opened_at(asset: Asset) -> int:
    """Return the distance from the left of its screen of the element that opened a picture."""
    opener = _opener(asset)
    return asset.box[0] + (0 if opener is None else opener[0])


def _is_right(asset: Asset) -> bool:
    """Return whether a picture was opened at its right end."""
    opener = _opener(asset)
    return opener is not None and 2 * opener[0] > asset.size[1]


def _sides(box: Box) -> tuple[int, int]:
    return box[2] - box[0], box[3] - box[1]


def _corner_on_screen(asset: Asset, element: Box, screen: Size) -> Point:
    """Return the corner of the picture on the screen.

    A dialog is in the middle. A menu hangs from the clicked element; if it would leave the screen,
    it opens upwards or is moved sideways, as toolkits do.
    """
    height, width = screen
    h, w = asset.size
    if not _touches_opener(asset):
        return (width - w) // 2, (height - h) // 2
    left, y = _offset(asset, element)
    x = element[0] + left
    above = element[1] - h
    if y + h > height and above >= 0:
        y = above
    return min(max(x, 0), width - w), min(max(y, 0), height - h)


def _touches_opener(asset: Asset) -> bool:
    """Return whether a picture touches the element that opened it, as a menu does."""
    box = _opener(asset)
    if box is None:
        return asset.kind == "menu"
    return abs(box[3]) <= MAX_OPENER_GAP_PX or abs(box[1] - asset.size[0]) <= MAX_OPENER_GAP_PX


def _offset(asset: Asset, element: Box) -> Point:
    """Return the column, relative to the element, and the row at which a menu begins.

    The vertical distance from the element is the recorded one. A menu that was opened at its right
    end ends where the element ends, whatever the width of the element here.
    """
    box = _opener(asset)
    if box is None:
        return 0, element[3]
    dx = -box[0]
    if _is_right(asset):
        dx += _sides(element)[0] - _sides(box)[0]
    is_above = box[1] >= asset.size[0] - MAX_OPENER_GAP_PX
    row = element[1] - box[1] if is_above else element[3] - box[3]
    return dx, row


def _opener(asset: Asset) -> Box | None:
    return None if asset.opened_by is None else asset.opened_by.target_box
