"""Pictures of the pack that replace a whole screenshot: a screen, or a web page."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TypeAlias

from hijack_data.coords import CoordMap
from hijack_data.pack import Asset, AssetPack, RecordedAction
from hijack_data.plan import Op, Paste, Resample
from hijack_data.rng import Stream
from hijack_data.types import Box, Fidelity, Size, size_text

from .base import Frame, NotApplicable
from .browser_pages import fit_page
from .screen_layout import ScreenLayout

# The sides of two screens of the same shape may differ by this share after scaling: 1366x768 is not
# quite 16:9.
SHAPE_TOLERANCE = 0.01

LayOut: TypeAlias = Callable[[AssetPack, Size, Stream, frozenset[str]], ScreenLayout | None]


@dataclass(frozen=True, kw_only=True)
class ShownAsset:
    """One or several recorded pictures that fill a screenshot.

    Args:
        asset: the picture.
        ops: what draws it.
        fidelity: `recorded`, or `composited` if it was laid out or scaled.
        mapped: gives an action on `asset` as one on the screenshot.
        boxes: what can be clicked, in pixels of the screenshot.
        notes: how it was changed.
    """

    asset: Asset
    ops: tuple[Op, ...]
    fidelity: Fidelity
    mapped: Callable[[RecordedAction], RecordedAction]
    boxes: tuple[Box, ...] = ()
    notes: tuple[str, ...] = ()


def whole_screen(
    frame: Frame, kind: str, description: str, lay_out: LayOut, apps: frozenset[str] = frozenset()
) -> ShownAsset:
    """Return a recorded screen that fills the screenshot, one of `apps` if there is any.

    A screen recorded at this very size is preferred. Otherwise it is laid out from recorded parts,
    or scaled down from a larger one of the same shape, since recordings are often stored smaller
    than the screen was. A window that was recorded at full width is laid out at any size, or placed
    on the recorded desktop at its recorded position.

    Args:
        frame: the step.
        kind: of the pictures to take.
        description: names it in the reason why it cannot be shown.
        lay_out: lays out such a screen from recorded parts if none of that size was recorded.
        apps: applications to prefer.

    Raises:
        NotApplicable: none of these is possible.
    """
    frame.check_desktop()
    size = frame.scene.size
    pack = frame.pack
    recorded = [asset for asset in pack.pictures(kind, screen=size) if asset.size == size]
    if recorded:
        same_app = [asset for asset in recorded if asset.app in apps]
        return _show_layers([frame.stream.choice(same_app or recorded)], size)
    laid_out = lay_out(pack, size, frame.stream, apps)
    if laid_out is not None:
        return ShownAsset(
            asset=laid_out.asset,
            ops=laid_out.ops,
            fidelity="composited",
            mapped=laid_out.mapped,
            boxes=laid_out.boxes,
            notes=laid_out.notes,
        )
    large = [asset for asset in pack.pictures(kind) if _fits(asset.screen, size)]
    layers = [_layers(pack, asset) for asset in large]
    fitting = _nearest([candidate for candidate in layers if candidate])
    if not fitting:
        raise NotApplicable(
            f"no {description} was recorded on a screen of this size, and what was recorded"
            f" cannot be laid out on it; `hijack desktop record --assets DIR --only {kind} --sizes"
            f" {size_text(size)}` records one"
        )
    preferred = [candidate for candidate in fitting if candidate[-1].app in apps]
    return _show_layers(frame.stream.choice(preferred or fitting), size)


def _layers(pack: AssetPack, asset: Asset) -> list[Asset]:
    """Return the pictures that make a whole screen, lowest first; none for a narrower window."""
    if asset.size == asset.screen:
        return [asset]
    if asset.size[1] != asset.screen[1]:
        return []
    recorded = pack.pictures("desktop", screen=asset.screen)
    desktops = [below for below in recorded if below.size == below.screen]
    if not desktops:
        return []
    preferred = [below for below in desktops if below.app == asset.app]
    below = (preferred or desktops)[0]
    return [below, asset]


def _show_layers(layers: list[Asset], size: Size) -> ShownAsset:
    asset = layers[-1]
    ops: tuple[Op, ...] = tuple(Paste(layer.recipe(), (layer.box[:2],)) for layer in layers)
    coords = CoordMap(observation=asset.screen, screen=size)
    notes = [f"{asset.id} stands on {layer.id}" for layer in layers[:-1]]
    if asset.screen != size:
        ops = (Resample(asset.screen), *ops, Resample(size))
        recorded_size = size_text(asset.screen)
        new_size = size_text(size)
        notes.append(f"{asset.id} was scaled from {recorded_size} to {new_size}")
    return ShownAsset(
        asset=asset,
        ops=ops,
        fidelity="composited" if notes else "recorded",
        mapped=partial(_map_action, asset, coords),
        boxes=_targets(asset, coords),
        notes=tuple(notes),
    )


def _map_action(asset: Asset, coords: CoordMap, recorded: RecordedAction) -> RecordedAction:
    """Map an action on a recorded screen to the screenshot."""
    on_screen = recorded.translate(*asset.box[:2])
    box = None if on_screen.target_box is None else _boxes(coords, [on_screen.target_box])[0]
    return RecordedAction(coords.action_to_screen(on_screen.action), box)


def _targets(asset: Asset, coords: CoordMap) -> tuple[Box, ...]:
    """Return the clickable elements of a recorded screen, in pixels of the screenshot."""
    x, y = asset.box[:2]
    inside = [target.box for target in asset.targets]
    return _boxes(coords, [(x1 + x, y1 + y, x2 + x, y2 + y) for x1, y1, x2, y2 in inside])


def page_view(frame: Frame, kind: str, description: str) -> tuple[tuple[Op, ...], Asset]:
    """Return a recorded page that fills a screenshot of a page, cropped or continued.

    The content of a page is at the top, in the middle of the window; only plain background is
    cropped or added.

    Args:
        frame: the step.
        kind: of the pictures to take.
        description: names it in the reason why it cannot be shown.

    Raises:
        NotApplicable: no recorded page can be fitted.
    """
    size = frame.scene.size
    views = frame.pack.pictures(kind)
    views.sort(key=lambda asset: (abs(asset.size[1] - size[1]), asset.id))
    for asset in views:
        ops = fit_page(asset, size)
        if ops is not None:
            return ops, asset
    raise NotApplicable(f"no {description} was recorded that a page of this size can show")


def _fits(picture: Size, size: Size) -> bool:
    (h, w), (height, width) = picture, size
    return h >= height and w >= width and abs(w * height - h * width) <= SHAPE_TOLERANCE * h * width


def _nearest(layers: list[list[Asset]]) -> list[list[Asset]]:
    least = min((candidate[-1].screen for candidate in layers), default=None)
    return [candidate for candidate in layers if candidate[-1].screen == least]


def _boxes(coords: CoordMap, boxes: list[Box]) -> tuple[Box, ...]:
    return tuple((x1, y1, x2, y2) for x1, y1, x2, y2 in coords.boxes_to_screen(boxes).tolist())
