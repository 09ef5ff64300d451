"""Lay out screens of any size from recorded parts, as the desktop does; nothing is scaled.

A wallpaper is cropped around its middle, and a dialog is placed in the middle. A bar (panel, title
bar, tool bar) keeps its contents at the ends and in the middle; its plain stretches are repeated or
shortened. All places are whole pixels.
"""

from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np

from hijack_data.pack import Asset, AssetPack, RecordedAction
from hijack_data.plan import Paste
from hijack_data.rng import Stream
from hijack_data.types import Box, Size, UInt8Array, size_text

RowRange: TypeAlias = tuple[int, int]
Span: TypeAlias = tuple[int, int]

# At least this many equal columns are a plain stretch of a bar.
MIN_STRETCH_PX = 8
# The tip of the pointer may cover this many columns of a stretch.
POINTER_WIDTH_PX = 12
# Rows at the top of a panel that are its edge.
PANEL_EDGE_PX = 1
# How xfdesktop places icons of 48 pixels.
ICON_SLOT_PX = 103.2  # side of a slot
MIN_ICON_MARGIN_PX = 34  # least margin at both ends together
ICON_OFFSET_X_PX = 7  # where in its slot the box of an icon begins
ICON_OFFSET_Y_PX = 6


@dataclass(frozen=True)
class Stretch:
    """Equal columns of a bar.

    Args:
        span: all of them.
        tile: the longest part of them that is not covered.
    """

    span: Span
    tile: Span


@dataclass(frozen=True, kw_only=True)
class ScreenLayout:
    """A screen composed of recorded parts.

    Args:
        ops: what draws it.
        asset: the part whose recorded actions apply.
        mapped: gives an action on `asset` as one on the screenshot.
        boxes: what can be clicked, in pixels of the screenshot.
        notes: the parts that were used.
    """

    ops: tuple[Paste, ...]
    asset: Asset
    mapped: Callable[[RecordedAction], RecordedAction]
    boxes: tuple[Box, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Bar:
    """Rows of a picture at another width.

    Args:
        ops: what draws it.
        cuts: where the pieces begin that are moved by the distances in `moves`, from left to right.
        dy: how far it is moved down.
    """

    ops: tuple[Paste, ...]
    cuts: tuple[int, ...]
    moves: tuple[int, ...]
    dy: int

    def box(self, box: Box) -> Box:
        """Map a box of the picture to the screenshot.

        A box that spans a plain stretch grows with it.
        """
        left, top, right, bottom = box
        last = self._x(right - 1)
        return self._x(left), top + self.dy, last + 1, bottom + self.dy

    def mapped(self, recorded: RecordedAction) -> RecordedAction:
        """Map an action on one piece of the picture to the screenshot."""
        x = recorded.action.x or 0
        return recorded.translate(self._x(x) - x, self.dy)

    def _x(self, x: int) -> int:
        piece = bisect_right(self.cuts, x) - 1
        return x + self.moves[piece]


def lock_screen(
    pack: AssetPack, size: Size, stream: Stream, apps: frozenset[str]
) -> ScreenLayout | None:
    """Lay out a locked screen: a wallpaper, and the dialog in the middle."""
    dialogs = [asset for asset in pack.pictures("lock_dialog") if _holds(size, asset.size)]
    wallpapers = _wallpapers(pack, size)
    if not dialogs or not wallpapers:
        return None
    below = stream.choice(wallpapers)
    dialog = stream.choice(dialogs)
    height, width = size
    h, w = dialog.size
    x = (width - w) // 2
    y = (height - h) // 2
    return ScreenLayout(
        ops=(_middle(below, size), Paste(dialog.recipe(), ((x, y),))),
        asset=dialog,
        mapped=partial(RecordedAction.translate, dx=x, dy=y),
        boxes=tuple(_move_box(target.box, x, y) for target in dialog.targets),
        notes=_notes(size, below, dialog),
    )


def desktop(
    pack: AssetPack, size: Size, stream: Stream, apps: frozenset[str]
) -> ScreenLayout | None:
    """Lay out a desktop whose windows are minimised, with one of `apps` if there is any.

    The layout consists of wallpaper, icons, and the panel of a recorded desktop, whose buttons name
    its windows.
    """
    wallpapers = _wallpapers(pack, size)
    if not wallpapers:
        return None
    full_screens = [asset for asset in pack.pictures("desktop") if asset.size == asset.screen]
    recorded = [asset for asset in full_screens if asset.recover]
    preferred = [asset for asset in recorded if asset.app in apps]
    first = _first_panel(preferred or recorded, size, stream)
    if first is None:
        return None
    below = stream.choice(wallpapers)
    asset, panel_bar = first
    top = _panel_top(asset)
    height = top + PANEL_EDGE_PX + panel_bar.dy
    icons = list(_icons(pack.pictures("icon"), (height, size[1])))
    on_panel = [target.box for target in asset.targets if target.box[1] >= top]
    return ScreenLayout(
        ops=(_middle(below, size), *(paste for paste, _ in icons), *panel_bar.ops),
        asset=asset,
        mapped=panel_bar.mapped,
        boxes=(*(box for _, box in icons), *map(panel_bar.box, on_panel)),
        notes=_notes(size, below, asset),
    )


def _first_panel(assets: Sequence[Asset], size: Size, stream: Stream) -> tuple[Asset, Bar] | None:
    """Draw recorded desktops until the panel of one fits."""
    remaining = list(assets)
    while remaining:
        asset = remaining.pop(stream.integer(0, len(remaining) - 1))
        panel_bar = panel(asset, size)
        if panel_bar:
            return asset, panel_bar
    return None


def panel(asset: Asset, size: Size) -> Bar | None:
    """Lay out a recorded panel along the lower edge of a screen; `None` if none fits."""
    top = _panel_top(asset)
    end = asset.size[0]
    height = end - top
    if not 0 < height < size[0]:
        return None
    return bar(asset, (top, end), 1, size[1], size[0] - height)


def _panel_top(asset: Asset) -> int:
    """Return the first row of the panel, which is its edge.

    The panel is found by its clickable elements, which reach down to the edge of the picture.
    """
    end = asset.size[0]
    tops = [target.box[1] for target in asset.targets if target.box[3] == end]
    return min(tops) - PANEL_EDGE_PX if tops else end


@lru_cache(maxsize=512)
def bar(asset: Asset, rows: RowRange, gaps: int, width: int, y: int) -> Bar | None:
    """Lay out rows of a picture at another width, with their top at `y`.

    Args:
        asset: the picture, as wide as its screen.
        rows: first and end, in pixels of the picture.
        gaps: how many plain stretches are made longer or shorter: 1 between two ends, 2 around a
            middle.
        width: in pixels.
        y: of the screenshot.

    Returns:
        `None` if there are no such stretches, or the pieces would overlap.
    """
    recorded_width = asset.size[1]
    stretches = _longest(_plain(asset, rows), gaps)
    if len(stretches) < gaps:
        return None
    pieces = _pieces(stretches, recorded_width)
    moves = _moves(gaps, width - recorded_width)
    spans = [_shift(piece, move) for piece, move in zip(pieces, moves, strict=True)]
    spaces = [(left[1], right[0]) for left, right in pairwise(spans)]
    if any(_length(space) < 0 for space in spaces):
        return None
    ops: list[Paste] = []
    for stretch, space in zip(stretches, spaces, strict=True):
        if _length(space):
            ops.append(_fill(asset, rows, stretch.tile, space, y))
    for piece, span in zip(pieces, spans, strict=True):
        if _length(piece) > 0:
            ops.append(Paste(_part(asset, piece, rows), ((span[0], y),)))
    middles = [(start + end) // 2 for start, end in (stretch.span for stretch in stretches)]
    return Bar(ops=tuple(ops), cuts=(0, *middles), moves=moves, dy=y - rows[0])


def _longest(stretches: Sequence[Stretch], count: int) -> list[Stretch]:
    """Return the `count` longest stretches, from left to right."""
    by_length = sorted(stretches, key=lambda stretch: _length(stretch.span))
    return sorted(by_length[-count:], key=lambda stretch: stretch.span)


def _pieces(stretches: Sequence[Stretch], width: int) -> list[Span]:
    """Return the columns before, between and after plain stretches."""
    starts = [0, *(stretch.span[1] for stretch in stretches)]
    ends = [*(stretch.span[0] for stretch in stretches), width]
    return list(zip(starts, ends, strict=True))


def _moves(gaps: int, longer: int) -> tuple[int, ...]:
    """Return how far the pieces move: half of the distance in the middle, all of it at the end."""
    if gaps == 1:
        return 0, longer
    return 0, longer // 2, longer


def _shift(span: Span, by: int) -> Span:
    return span[0] + by, span[1] + by


def _part(asset: Asset, columns: Span, rows: RowRange) -> dict[str, Any]:
    """Return the recipe of a part of a picture."""
    left, right = columns
    top, bottom = rows
    return asset.recipe((left, top, right, bottom))


def _fill(asset: Asset, rows: RowRange, run: Span, gap: Span, y: int) -> Paste:
    """Fill a gap with a plain stretch, repeated; the last one ends where the gap does."""
    length = min(_length(run), _length(gap))
    start, end = gap
    last = end - length
    corners = [(x, y) for x in range(start, last, length)]
    recipe = _part(asset, (run[0], run[0] + length), rows)
    return Paste(recipe, (*corners, (last, y)))


@lru_cache(maxsize=256)
def _plain(asset: Asset, rows: RowRange) -> tuple[Stretch, ...]:
    """Return the stretches of equal columns.

    The tip of the pointer does not end one.
    """
    part = asset.pixels()[rows[0] : rows[1]]
    stretches: list[Stretch] = []
    for run in _alike(part):
        last = stretches[-1] if stretches else None
        if last is not None and _continues(last, run, part):
            longest = max(last.tile, run, key=_length)
            stretches[-1] = Stretch((last.span[0], run[1]), longest)
        else:
            stretches.append(Stretch(run, run))
    return tuple(stretches)


def _alike(part: UInt8Array) -> list[Span]:
    """Return the runs of at least `MIN_STRETCH_PX` equal columns."""
    equals_next = (part[:, 1:] == part[:, :-1]).all(axis=(0, 2))
    padded = np.concatenate([[False], equals_next, [False]])
    edges = np.flatnonzero(np.diff(padded.astype(np.int8)))
    runs = [(int(start), int(end) + 1) for start, end in edges.reshape(-1, 2)]
    return [run for run in runs if _length(run) >= MIN_STRETCH_PX]


def _continues(last: Stretch, run: Span, part: UInt8Array) -> bool:
    """Return whether a run is of the same colours as the stretch before it, and close to it."""
    if run[0] - last.span[1] > POINTER_WIDTH_PX:
        return False
    equal_pixels = part[:, run[0]] == part[:, last.tile[0]]
    return bool(equal_pixels.all())


def _length(span: Span) -> int:
    return span[1] - span[0]


def _wallpapers(pack: AssetPack, size: Size) -> list[Asset]:
    return [asset for asset in pack.pictures("wallpaper") if _holds(asset.size, size)]


def _holds(outer: Size, inner: Size) -> bool:
    return inner[0] <= outer[0] and inner[1] <= outer[1]


def _middle(asset: Asset, size: Size) -> Paste:
    """Cut a wallpaper around its middle."""
    height, width = size
    left = (asset.size[1] - width) // 2
    top = (asset.size[0] - height) // 2
    recipe = asset.recipe((left, top, left + width, top + height))
    return Paste(recipe, ((0, 0),))


def _icons(icons: Sequence[Asset], area: Size) -> Iterator[tuple[Paste, Box]]:
    """Place icons below each other where the desktop has its first column."""
    height, width = area
    _, left = _slots(width)
    rows, top = _slots(height)
    ordered = sorted(icons, key=lambda icon: icon.box[1])
    for icon, row in zip(ordered, rows, strict=False):
        box = icon.targets[0].box
        x = int(left + ICON_OFFSET_X_PX) - box[0]
        y = int(top + row + ICON_OFFSET_Y_PX) - box[1]
        yield Paste(icon.recipe(), ((x, y),)), _move_box(box, x, y)


def _slots(length: int) -> tuple[list[float], float]:
    """Return where the slots of a row or column begin after the margin, and the margin."""
    count = max(int((length - MIN_ICON_MARGIN_PX) / ICON_SLOT_PX), 1)
    free = length - count * ICON_SLOT_PX
    gaps = count - 1
    space = int((free - MIN_ICON_MARGIN_PX) / gaps) if gaps else 0
    starts = [number * (ICON_SLOT_PX + space) for number in range(count)]
    margin = (free - gaps * space) / 2
    return starts, margin


def _move_box(box: Box, x: int, y: int) -> Box:
    left, top, right, bottom = box
    return left + x, top + y, right + x, bottom + y


def _notes(size: Size, *parts: Asset) -> tuple[str, ...]:
    names = ", ".join(part.id for part in parts)
    return (f"laid out at {size_text(size)} from {names}",)
