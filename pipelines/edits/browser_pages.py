"""Browser pages of any size: alone, or in a window as wide as the screen, above the panel."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np

from hijack_data.pack import Asset, AssetPack
from hijack_data.plan import Paste
from hijack_data.rng import Stream
from hijack_data.types import Box, Point, Size, size_text

from .screen_layout import ScreenLayout, bar, panel

# The least width of a strip of plain background that is repeated around a page.
STRIP = 16


def error_page(
    pack: AssetPack, size: Size, stream: Stream, apps: frozenset[str]
) -> ScreenLayout | None:
    """Lay out a browser with an error page: panel, title bar, tool bars, and the page.

    For each look, the pages recorded on the screen of the nearest height are used.
    """
    whole = [page for page in pack.pictures("error_page") if page.size[1] == page.screen[1]]
    whole.sort(key=lambda page: abs(page.screen[0] - size[0]))
    nearest: dict[str, int] = {}
    found: list[ScreenLayout] = []
    for page in whole:
        height = page.screen[0]
        if nearest.get(page.look, height) != height:
            continue
        layout = _window(pack, page, size)
        if layout:
            nearest[page.look] = height
            found.append(layout)
    return stream.choice(found) if found else None


def _window(pack: AssetPack, page: Asset, size: Size) -> ScreenLayout | None:
    """Return a recorded window on a screen of this size; `None` if its parts do not fit."""
    view = _view_of(pack, page)
    panel_asset = _panel_of(pack, page)
    if view is None or panel_asset is None:
        return None
    height, width = size
    top = view.box[1] - page.box[1]
    title = min((target.box[1] for target in page.targets), default=top)
    title_bar = bar(page, (0, title), 2, width, 0)
    tool_bars = bar(page, (title, top), 1, width, title)
    room = (height - panel_asset.size[0] - top, width)
    content = fitted(view, room, (0, top)) if min(room) > 0 else None
    under = panel(panel_asset, size)
    if title_bar is None or tool_bars is None or content is None or under is None:
        return None
    above = [target.box for target in page.targets if target.box[3] <= top]
    boxes = [tool_bars.box(box) for box in above]
    boxes += _on_page(page, top, width)
    boxes += [under.box(target.box) for target in panel_asset.targets]
    note = f"laid out at {size_text(size)} from {page.id}, {view.id}, {panel_asset.id}"
    return ScreenLayout(
        ops=(*title_bar.ops, *tool_bars.ops, *content, *under.ops),
        asset=page,
        mapped=tool_bars.mapped,
        boxes=tuple(boxes),
        notes=(note,),
    )


def _view_of(pack: AssetPack, page: Asset) -> Asset | None:
    """Return the picture of the page alone that was recorded with a window."""
    for view in pack.pictures("error_view", screen=page.screen):
        if view.look != page.look or view.size[1] != page.size[1]:
            continue
        if view.made_by.startswith(page.made_by):
            return view
    return None


def _panel_of(pack: AssetPack, page: Asset) -> Asset | None:
    """Return the panel that was recorded below a window: one of its buttons names the page."""
    for found in pack.pictures("panel", app=page.app):
        if found.recover is not None or found.look != page.look:
            continue
        if _address(found) == _address(page):
            return found
    return None


def _address(asset: Asset) -> str:
    """Return the address that the browser opened when a picture was recorded."""
    return asset.made_by.partition(" was asked for")[0]


def _on_page(page: Asset, top: int, width: int) -> list[Box]:
    """Return the clickable elements of the page itself, whose content stays in the middle."""
    cut = max(0, (page.size[1] - width) // 2)
    added = max(0, (width - page.size[1]) // 2)
    dx = added - cut
    boxes = [target.box for target in page.targets if target.box[1] >= top]
    return [(x1 + dx, y1, x2 + dx, y2) for x1, y1, x2, y2 in boxes]


@lru_cache(maxsize=256)
def fitted(asset: Asset, size: Size, at: Point = (0, 0)) -> tuple[Paste, ...] | None:
    """Return the operations that fit a recorded page to `size`: cropped, or with more background.

    The content of a page is at the top, in the middle of the window; only plain background is
    cropped or repeated.

    Args:
        asset: the recorded page.
        size: of the page (height, width).
        at: its corner on the screenshot.

    Returns:
        `None` if more than background would be cropped, or there is none to repeat.
    """
    height, width = size
    h, w = asset.size
    content = _content(asset)
    left = max(0, (w - width) // 2)
    right = min(w, left + width)
    bottom = min(h, height)
    if content.left < left or content.right > right or content.bottom > bottom:
        return None
    x, y = at
    corner = (x + max(0, (width - w) // 2), y)
    view = Paste(asset.recipe((left, 0, right, bottom)), (corner,))
    if w >= width and h >= height:
        return (view,)
    # the edge next to the continued background must itself be background
    is_framed = content.left > 0 and content.right < w
    strip = min(h - content.bottom, height)
    if strip < min(STRIP, height) or not (is_framed or w >= width):
        return None
    across = min(w, width)
    tile = asset.recipe((0, h - strip, across, h))
    places = product(_starts(height, strip), _starts(width, across))
    corners = tuple((x + column, y + row) for row, column in places)
    return Paste(tile, corners), view


def _starts(length: int, tile: int) -> list[int]:
    """Return the starts of tiles that cover a length; the last tile ends at its end."""
    return [*range(0, length - tile, tile), length - tile]


@dataclass(frozen=True)
class _Content:
    """The extent of a page's content: its columns (first, end), and the end of its rows."""

    left: int
    right: int
    bottom: int


@lru_cache(maxsize=64)
def _content(asset: Asset) -> _Content:
    """Return the part of a page that is not plain background."""
    pixels = asset.pixels()
    filled = (pixels != pixels[-1, 0]).any(axis=2)
    columns = np.flatnonzero(filled.any(axis=0))
    rows = np.flatnonzero(filled.any(axis=1))
    if not len(columns):
        middle = asset.size[1] // 2
        return _Content(middle, middle, 0)
    right = int(columns[-1]) + 1
    bottom = int(rows[-1]) + 1
    return _Content(int(columns[0]), right, bottom)
