"""Pictures of the pack that take the place of a whole screenshot: a screen, or a web page."""

from dataclasses import dataclass

import numpy as np

from hijack_data.coords import CoordMap
from hijack_data.pack import Asset, AssetPack, Deed
from hijack_data.plan import Op, Paste, Resample
from hijack_data.types import Box, Fidelity, Size

from .base import Frame, NotApplicable

# Sides of two screens of one shape may differ by this share once they are scaled: 1366x768 is not quite 16:9.
SHAPE = 0.01
# The least strip of plain background that is repeated around a page.
STRIP = 16


@dataclass(frozen=True)
class Shown:
    """A recorded picture as it fills a screenshot.

    Args:
        asset: the picture.
        ops: what draws it.
        fidelity: `recorded`, or `composited` where it was scaled or cut.
        coords: from pixels of the screen that showed it to pixels of the screenshot.
        notes: what was done to it.
    """

    asset: Asset
    ops: tuple[Op, ...]
    fidelity: Fidelity
    coords: CoordMap
    notes: tuple[str, ...] = ()

    def deed(self, deed: Deed) -> Deed:
        """An action on the picture as one on the screenshot."""
        there = deed.moved(*self.asset.box[:2])
        box = None if there.target_box is None else _boxes(self.coords, [there.target_box])[0]
        return Deed(self.coords.action_to_screen(there.action), box)

    @property
    def boxes(self) -> tuple[Box, ...]:
        """What can be clicked, in pixels of the screenshot."""
        x, y = self.asset.box[:2]
        inside = [target.box for target in self.asset.targets]
        return _boxes(self.coords, [(x1 + x, y1 + y, x2 + x, y2 + y) for x1, y1, x2, y2 in inside])


def whole_screen(frame: Frame, kind: str, what: str, apps: frozenset[str] = frozenset()) -> Shown:
    """Return a recorded screen that fills the screenshot, one of `apps` if there is any.

    It is of the same size, or scaled down from one of the same shape: recordings are often stored smaller than the
    screen was. A window that was recorded at full width stands on a recorded desktop, where both really were. Raises
    `NotApplicable` when there is none; `what` names it in the reason.
    """
    frame.check_desktop()
    size = frame.scene.size
    layers = [_layers(frame.pack, asset) for asset in frame.pack.pictures(kind) if _fits(asset.screen, size)]
    fitting = _nearest([found for found in layers if found])
    if not fitting:
        raise NotApplicable(f"no {what} was recorded on a screen of this size, or on a larger one of its shape")
    return _shown(frame.stream.choice([found for found in fitting if found[-1].app in apps] or fitting), size)


def _layers(pack: AssetPack, asset: Asset) -> list[Asset]:
    """Return pictures that make a whole screen, from below; none for a window that is not as wide."""
    if asset.size == asset.screen:
        return [asset]
    if asset.size[1] != asset.screen[1]:
        return []
    desktops = [below for below in pack.pictures("desktop", screen=asset.screen) if below.size == below.screen]
    own = [below for below in desktops if below.app == asset.app]
    return [*(own or desktops)[:1], asset] if desktops else []


def _shown(layers: list[Asset], size: Size) -> Shown:
    asset = layers[-1]
    pastes = tuple(Paste(layer.recipe(), (layer.box[:2],)) for layer in layers)
    coords = CoordMap(observation=asset.screen, screen=size)
    notes = tuple(f"{asset.id} stands on {layer.id}" for layer in layers[:-1])
    if asset.screen == size:
        return Shown(asset, pastes, "composited" if notes else "recorded", coords, notes)
    note = f"{asset.id} was scaled from {_text(asset.screen)} to {_text(size)}"
    return Shown(asset, (Resample(asset.screen), *pastes, Resample(size)), "composited", coords, (*notes, note))


def page_view(frame: Frame, kind: str, what: str) -> tuple[tuple[Op, ...], Asset]:
    """Return what fills a screenshot of a page with a recorded one: cut, or continued by its own plain background.

    A page's content stands in the middle of the window, from the top; only plain background is cut off. Raises
    `NotApplicable` when nothing recorded can be fitted so; `what` names it in the reason.
    """
    size = frame.scene.size
    views = sorted(frame.pack.pictures(kind), key=lambda asset: (abs(asset.size[1] - size[1]), asset.id))
    for asset in views:
        ops = _fitted(asset, size)
        if ops is not None:
            return ops, asset
    raise NotApplicable(f"no {what} was recorded that a page of this size can show")


def _fits(picture: Size, size: Size) -> bool:
    (h, w), (height, width) = picture, size
    return h >= height and w >= width and abs(w * height - h * width) <= SHAPE * h * width


def _nearest(layers: list[list[Asset]]) -> list[list[Asset]]:
    least = min((found[-1].screen for found in layers), default=None)
    return [found for found in layers if found[-1].screen == least]


def _boxes(coords: CoordMap, boxes: list[Box]) -> tuple[Box, ...]:
    return tuple((x1, y1, x2, y2) for x1, y1, x2, y2 in coords.boxes_to_screen(boxes).tolist())


def _fitted(asset: Asset, size: Size) -> tuple[Op, ...] | None:
    """Return the operations, or `None` when more than background would be cut off or there is none to continue."""
    (height, width), (h, w) = size, asset.size
    pixels = asset.pixels()
    plain = (pixels == pixels[-1, 0]).all(axis=2)
    left = max(0, (w - width) // 2)
    right, bottom = min(w, left + width), min(h, height)
    if not (plain[:, :left].all() and plain[:, right:].all() and plain[bottom:].all()):
        return None
    at = (max(0, (width - w) // 2), 0)
    view = Paste(asset.recipe((left, 0, right, bottom)), (at,))
    if w >= width and h >= height:
        return (view,)
    strip = _strip(plain)
    joins = plain[:, [0, -1]].all() or w >= width  # what meets the continued background must be background
    if strip < STRIP or not joins:
        return None
    tile = asset.recipe((0, h - strip, w, h))
    corners = tuple((x, y) for y in range(0, height, strip) for x in range(0, width, w))
    return Paste(tile, corners), view


def _strip(plain: "np.ndarray[tuple[int, int], np.dtype[np.bool_]]") -> int:
    """Return how many rows at the bottom are background from end to end."""
    filled = np.flatnonzero(~plain.all(axis=1))
    return len(plain) if not filled.size else len(plain) - 1 - int(filled[-1])


def _text(size: Size) -> str:
    return f"{size[1]}x{size[0]}"
