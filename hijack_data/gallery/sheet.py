"""The contact sheet: labelled pairs of pictures as one plain picture, for README files and terminals."""

from collections.abc import Sequence

import numpy as np

from ..apply import apply
from ..backends import backend_of
from ..corruption import size_text
from ..errors import ImageTypeError, ParameterError
from ..kernels.numpy import resample
from ..plan import Paste, Plan
from ..text import check_glyphs, largest_fitting
from ..types import Size, UInt8Array

FONT = "DejaVuSans"
BACKGROUND, INK, MUTED = 246, "#15181e", "#5b6472"
TITLE_SIZE, CAPTION_SIZE, LABEL_SIZE, SMALLEST = 22, 17, 15, 8
MARGIN, TITLE_ROW, CAPTION_ROW, LABEL_ROW = 24, 40, 30, 26
MIN_WIDTH = 320


def contact_sheet(
    rows: Sequence[tuple[str, UInt8Array, UInt8Array]], width: int = 1600, captions: Sequence[str] = ()
) -> UInt8Array:
    """Draw labelled before and after pairs under each other.

    Both pictures of a row are shown at one scale, so that a smaller picture looks smaller; none is enlarged.

    Args:
        rows: `(title, before, after)` each; the pictures are uint8 RGB `[H, W, 3]` and may differ in size.
        width: width of the sheet in pixels, at least 320.
        captions: one line below each title, or none at all.

    Returns:
        uint8 RGB `[H, width, 3]`.

    Raises:
        ParameterError: no rows, captions that are not one for each, a sheet too narrow, or a line too long for it.
        FontError: a title or caption with letters that DejaVu Sans lacks.
        ImageError, ImageTypeError: a picture that is not uint8 RGB.
    """
    if not rows:
        raise ParameterError("contact_sheet needs at least one row of (title, before, after)")
    if not MIN_WIDTH <= width <= 1 << 16:
        raise ParameterError(f"contact_sheet: width must be in [{MIN_WIDTH}, 65536] pixels, got {width}")
    if captions and len(captions) != len(rows):
        raise ParameterError(
            f"contact_sheet: {len(captions)} captions for {len(rows)} rows; give one for each, or none"
        )
    below = captions or [""] * len(rows)
    parts = [_row(*row, width, caption) for row, caption in zip(rows, below, strict=True)]
    foot = np.full((MARGIN, width, 3), BACKGROUND, np.uint8)
    return np.concatenate([*parts, foot])


def _row(title: str, before: UInt8Array, after: UInt8Array, width: int, caption: str) -> UInt8Array:
    panel = (width - 3 * MARGIN) // 2
    scale = min(1.0, panel / max(_size(before)[1], _size(after)[1]))
    shown = [_shrunk(picture, scale) for picture in (before, after)]
    labels = MARGIN + TITLE_ROW + (CAPTION_ROW if caption else 0)
    top = labels + LABEL_ROW
    sheet = np.full((top + max(p.shape[0] for p in shown), width, 3), BACKGROUND, np.uint8)
    ops = [_label(title, (MARGIN, MARGIN), width - 2 * MARGIN, TITLE_SIZE, INK)]
    ops.append(_label(caption, (MARGIN, MARGIN + TITLE_ROW), width - 2 * MARGIN, CAPTION_SIZE, INK))
    for column, (name, picture) in enumerate(zip(("before", "after"), (before, after), strict=True)):
        left = MARGIN + column * (panel + MARGIN)
        text = f"{name}  {size_text(_size(picture))}"
        ops.append(_label(text, (left, labels), panel, LABEL_SIZE, MUTED))
        h, w = _size(shown[column])
        sheet[top : top + h, left : left + w] = shown[column]
    return apply(Plan("contact_sheet", _size(sheet), ops=tuple(op for op in ops if op)), sheet, inplace=True)


def _size(picture: UInt8Array) -> Size:
    backend = backend_of(picture)
    if backend.name != "numpy" or picture.ndim != 3:
        raise ImageTypeError(f"contact_sheet takes NumPy pictures [H, W, 3], got {backend.name} {list(picture.shape)}")
    backend.check(picture)
    return backend.size(picture)


def _shrunk(picture: UInt8Array, scale: float) -> UInt8Array:
    height, width = (max(1, round(side * scale)) for side in _size(picture))
    return picture if (height, width) == _size(picture) else resample(picture, (height, width))


def _label(text: str, at: tuple[int, int], width: int, size: int, color: str) -> Paste | None:
    line = " ".join(text.split())
    if not line:
        return None
    check_glyphs(line, FONT, "contact_sheet title")
    best = largest_fitting([line], FONT, width, 4 * size, size, SMALLEST)
    if best is None:
        raise ParameterError(f"contact_sheet: the line {line!r} does not fit {width} pixels; shorten it")
    recipe = {"draw": "text", "lines": [line], "font": FONT, "size": best, "color": color, "edge_color": color}
    return Paste(recipe, (at,))
