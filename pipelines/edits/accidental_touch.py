"""Accidental touch in a recording: a step on what a click by accident opened, undone as recorded.

The spec is `hijack_data/corruptions/accidental_touch.py`, the effect on a live machine
`online_env/effects/accidental_touch.py`.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

from hijack_data.apps import may_be_same, normalize_app
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
    recorded_apps,
)
from .open_menus import menu_state

KINDS = ("menu", "dialog")
# Larger elements are areas to work in, where a click opens nothing: a share of the screen.
LARGEST = 0.02
# What menus of the panel and of the bare desktop are recorded under.
PANEL = "desktop"
# Pixels that a menu, or the bubble of a button, may be away from what opened it.
TOUCH = 8
# Pixels by which an element may differ from the one that opened a picture; panels are as high as
# their owner likes.
ALIKE = 1
ALIKE_PANEL = 4
# On another desktop an element may be so many times smaller or larger than the one that opened a
# picture.
SMALLER = 2.0
LARGER = 1.5
# It stands in the bar of a window that fills the screen: within this share of the height from the
# top, beyond this share of the width, or as far from the left as it was, within so many pixels.
BARS = 0.12
RIGHT = 0.9
NEAR = 24
# Levels of grey by which the letters of an element stand out; those of one that cannot be clicked
# stand out less.
CONTRAST = 100
# A file or a site of the recorded machine, as elements name it.
NAMES = re.compile(r"[\w-]+\.[a-z]{1,5}\b")
OF_A_PAGE = ("Not secure", "Bookmark this tab")


@dataclass(frozen=True)
class _Opening:
    """An element that was clicked, and a recorded picture of what such a click opens."""

    element: Box
    asset: Asset


class TouchEdit(Edit):
    """Inserts a recorded menu or dialog at an element, and the action that closed it.

    An element opens what one of its size opened when it was recorded, in the same application. That
    this very element opens it is not known; that a desktop shows it so, and how it is closed, is.
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
            NotApplicable: the event cannot be shown truly; the message is the reason.
        """
        frame.check_desktop()
        elements = _clickable(frame, effect)
        notes = _check_menus(frame)
        opening = _opening(frame, elements)
        asset = opening.asset
        element = opening.element
        if asset.recover is None:  # `_is_shown` has seen to it
            raise NotApplicable(f"how {asset.id} is closed was not recorded")
        x, y = _place(asset, element, frame.scene.size)
        return self.made(
            ops=(Paste(asset.recipe(), ((x, y),)),),
            fidelity="composited",
            response=asset.recover.moved(x, y),
            boxes=[_moved(target.box, x, y) for target in asset.targets],
            notes=(f"the element at {list(element)} was clicked", *notes),
            shown="menu" if _hangs(asset) else "dialog",
        )

    def assumed_apps(self, pack: AssetPack, stream: Stream) -> Iterator[tuple[str, ...]]:
        """Yield the applications of which menus or dialogs were recorded."""
        return recorded_apps(pack, KINDS, stream)


def _moved(
    box: Box,
    x: int,
    y: int,
) -> Box:
    return box[0] + x, box[1] + y, box[2] + x, box[3] + y


def _clickable(frame: Frame, effect: Effect) -> list[Box]:
    """Return the elements that a click by accident could hit, in the plan's order.

    Raises:
        NotApplicable: the event cannot be shown truly; the message is the reason.
    """
    elements = list(_candidates(frame, effect))
    if not elements and frame.guess:
        elements = [(x1, y1, x2, y2) for x1, y1, x2, y2 in effect.params["boxes"]]
    if not elements:
        raise NotApplicable("no element but the target is known that could be clicked")
    return elements


def _check_menus(frame: Frame) -> tuple[str, ...]:
    """Return what a reader should know; refuse a screen where a menu is open, or may be.

    Raises:
        NotApplicable: the event cannot be shown truly; the message is the reason.
    """
    if frame.guess:
        return ()
    state = menu_state(frame)
    if state == "open":
        raise NotApplicable("a menu is open on this screen already, which a click would close")
    if state == "closed":
        return ()
    if frame.is_foreign:
        return ("whether a menu was open already is not recorded",)
    raise NotApplicable(
        "a menu may be open on this screen: the action before it was a click, and the recording"
        " holds no elements"
    )


def _opening(frame: Frame, elements: Sequence[Box]) -> _Opening:
    """Return what opens where: at the first element that is known to open something.

    Raises:
        NotApplicable: the event cannot be shown truly; the message is the reason.
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
    raise NotApplicable(_nothing(frame))


def _nothing(frame: Frame) -> str:
    if not frame.apps:
        return f"the recording names no application whose menus could open; {NAME_APPS}"
    if len(frame.apps) > 1:
        return (
            "the recording uses several applications, and which one this step shows is not recorded"
        )
    (app,) = frame.apps
    return f"no element of this screen is known to open a menu or dialog that was recorded of {app}"


def _candidates(frame: Frame, effect: Effect) -> Iterator[Box]:
    """Yield elements in the plan's order that are not what the recorded action aims at.

    Launchers of other applications are in the bars of a screen; `without_app` leaves them out, as
    it does live.
    """
    height, width = frame.scene.size
    for x1, y1, x2, y2 in effect.params["boxes"]:
        box = (x1, y1, x2, y2)
        if _is_aimed_at(box, frame.scene.target):
            continue
        if effect.params["without_app"] and _in_bar(box, frame.scene.size):
            continue
        is_large = (x2 - x1) * (y2 - y1) > LARGEST * width * height
        if not is_large and _stands_out(box, frame):
            yield box


def _is_aimed_at(box: Box, target: Box | None) -> bool:
    """Return whether an element holds the middle of the target."""
    if target is None:
        return False
    x = (target[0] + target[2]) // 2
    y = (target[1] + target[3]) // 2
    return box[0] <= x < box[2] and box[1] <= y < box[3]


def _stands_out(box: Box, frame: Frame) -> bool:
    """Return whether an element looks as if it could be clicked.

    One that cannot, such as one behind a dialog, is greyed out.
    """
    x1, y1, x2, y2 = box
    levels = frame.image[max(y1, 0) : y2, max(x1, 0) : x2].mean(axis=2)
    if not levels.size:
        return False
    contrast = float(levels.max() - levels.min())
    return contrast >= CONTRAST


def _in_bar(box: Box, size: Size) -> bool:
    first, end = between_bars(size)
    middle = (box[1] + box[3]) // 2
    return not first <= middle < end


def _usable(asset: Asset, frame: Frame) -> bool:
    """Return whether a left click opened it, and an application of the recording shows it."""
    if asset.opened_by is None or asset.opened_by.action.type != "click":
        return False
    return _is_shown(asset, frame)


def _is_shown(asset: Asset, frame: Frame) -> bool:
    """Return whether the recording can show it: it fits, belongs there and can be closed."""
    h, w = asset.size
    height, width = frame.scene.size
    if asset.recover is None or h > height or w > width:
        return False
    return _belongs(asset, frame) and not _names(asset)


def _names(asset: Asset) -> bool:
    """Return whether it names a document or a page, and so not the one of the recording."""
    listed = any(NAMES.search(target.name) for target in asset.targets)
    return listed or asset.made_by.endswith(OF_A_PAGE)


def _belongs(asset: Asset, frame: Frame) -> bool:
    """Return whether it is of the panel of our desktop, or of the recording's one application."""
    name = normalize_app(asset.app)
    if name == PANEL:
        return not frame.is_foreign
    if len(frame.apps) != 1:
        return False
    (app,) = frame.apps
    if frame.is_foreign:
        return may_be_same(app, name)
    return app == name


def _opens(
    element: Box,
    asset: Asset,
    frame: Frame,
) -> bool:
    """Return whether an element is like the one that opened it when it was recorded."""
    opener = _opener(asset)
    if opener is None:
        return False
    if frame.is_foreign:
        return _is_similar(element, opener) and _in_window_bar(element, asset, frame)
    if normalize_app(asset.app) == PANEL:
        return _is_alike(element, opener, ALIKE_PANEL) and _in_bar(element, frame.scene.size)
    return _is_alike(element, opener, ALIKE)


def _is_alike(
    element: Box,
    opener: Box,
    most: int,
) -> bool:
    """Return whether the sides of two boxes differ by at most so many pixels."""
    pairs = zip(_sides(element), _sides(opener), strict=True)
    return all(abs(one - other) <= most for one, other in pairs)


def _is_similar(element: Box, opener: Box) -> bool:
    """Return whether an element could be the same one on another desktop, by its size."""
    pairs = zip(_sides(element), _sides(opener), strict=True)
    return all(other <= SMALLER * one and one <= LARGER * other for one, other in pairs)


def _in_window_bar(
    element: Box,
    asset: Asset,
    frame: Frame,
) -> bool:
    """Return whether an element stands where the opener would in a window that fills the screen."""
    height, width = frame.scene.size
    if element[3] > BARS * height:
        return False
    if _is_right(asset):
        return element[2] >= RIGHT * width
    menus = [menu for menu in frame.pack.pictures("menu", asset.app) if _opener(menu) is not None]
    left = min(_opened_at(menu) for menu in menus or [asset])
    expected = _opened_at(asset) - left
    return abs(element[0] - expected) <= NEAR


def _opened_at(asset: Asset) -> int:
    """Return how far from the left of its screen the element was that opened a picture."""
    opener = _opener(asset)
    return asset.box[0] + (0 if opener is None else opener[0])


def _is_right(asset: Asset) -> bool:
    """Return whether a picture was opened at its right end."""
    opener = _opener(asset)
    return opener is not None and 2 * opener[0] > asset.size[1]


def _sides(box: Box) -> tuple[int, int]:
    return box[2] - box[0], box[3] - box[1]


def _place(
    asset: Asset,
    element: Box,
    screen: Size,
) -> Point:
    """Return the corner of the picture on the screen.

    A dialog is in the middle. A menu hangs from what was clicked; one that would leave the screen
    opens upwards, and is moved sideways, as toolkits do.
    """
    height, width = screen
    h, w = asset.size
    if not _hangs(asset):
        return (width - w) // 2, (height - h) // 2
    left, y = _offset(asset, element)
    x = element[0] + left
    above = element[1] - h
    if y + h > height and above >= 0:
        y = above
    return min(max(x, 0), width - w), min(max(y, 0), height - h)


def _hangs(asset: Asset) -> bool:
    """Return whether the picture ends where what opened it begins, as a menu does."""
    box = _opener(asset)
    if box is None:
        return asset.kind == "menu"
    return abs(box[3]) <= TOUCH or abs(box[1] - asset.size[0]) <= TOUCH


def _offset(asset: Asset, element: Box) -> Point:
    """Return how far right of the element the menu begins, and at which row.

    It is as far above or below the element as it was, and a menu that was opened at its right end
    ends with the element, however large that is here.
    """
    box = _opener(asset)
    if box is None:
        return 0, element[3]
    right = -box[0]
    if _is_right(asset):
        right += _sides(element)[0] - _sides(box)[0]
    is_above = box[1] >= asset.size[0] - TOUCH
    row = element[1] - box[1] if is_above else element[3] - box[3]
    return right, row


def _opener(asset: Asset) -> Box | None:
    return None if asset.opened_by is None else asset.opened_by.target_box
