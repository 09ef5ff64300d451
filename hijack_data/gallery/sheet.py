"""The contact sheet: labelled pairs of pictures as one plain picture, such as for a README."""

from collections.abc import Sequence

import numpy as np

from .._apply import apply
from ..backends import find_backend
from ..drawing.text import check_glyphs, largest_fitting
from ..errors import ImageTypeError, ParameterError
from ..kernels.cpu.pixels import resample
from ..plan import Paste, Plan
from ..types import Size, UInt8Array, size_text

FONT = "DejaVuSans"
BACKGROUND = 246
INK = "#15181e"
MUTED = "#5b6472"
# Sizes of letters, and heights of rows, in pixels.
TITLE_SIZE = 22
CAPTION_SIZE = 17
LABEL_SIZE = 15
SMALLEST = 8
MARGIN = 24
TITLE_ROW = 40
CAPTION_ROW = 30
LABEL_ROW = 26
MIN_WIDTH = 320


def contact_sheet(
    rows: Sequence[tuple[str, UInt8Array, UInt8Array]],
    width: int = 1600,
    captions: Sequence[str] = (),
) -> UInt8Array:
    """Draw labelled before and after pairs under each other.

    Both pictures of a row have the same scale, so that a smaller picture looks smaller; no picture
    is enlarged. Raises `FontError` for a title or caption with letters that DejaVu Sans lacks, and
    `ImageError` or `ImageTypeError` for a picture that is not uint8 RGB.

    Args:
        rows: `(title, before, after)` each; the pictures are uint8 RGB `[H, W, 3]` and may differ
            in size.
        width: width of the sheet in pixels, at least 320.
        captions: one line for below each title, or an empty sequence.

    Returns:
        uint8 RGB `[H, width, 3]`.

    Raises:
        ParameterError: there are no rows, the number of captions differs from that of the rows, the
            sheet is too narrow, or a line does not fit.
    """
    if not rows:
        raise ParameterError("contact_sheet needs at least one row of (title, before, after)")
    if not MIN_WIDTH <= width <= 1 << 16:
        raise ParameterError(
            f"contact_sheet: width must be in [{MIN_WIDTH}, 65536] pixels, got {width}"
        )
    if captions and len(captions) != len(rows):
        raise ParameterError(
            f"contact_sheet: {len(captions)} captions for {len(rows)} rows; give one for each, or"
            " none"
        )
    below = captions or [""] * len(rows)
    parts: list[UInt8Array] = []
    for (title, before, after), caption in zip(rows, below, strict=True):
        parts.append(_row(title, before, after, width, caption))
    return np.concatenate([*parts, _blank(MARGIN, width)])


def _blank(height: int, width: int) -> UInt8Array:
    return np.full((height, width, 3), BACKGROUND, np.uint8)


def _row(title: str, before: UInt8Array, after: UInt8Array, width: int, caption: str) -> UInt8Array:
    inner = width - 2 * MARGIN
    panel = (inner - MARGIN) // 2
    widest = max(_size(before)[1], _size(after)[1])
    scale = min(1.0, panel / widest)
    labels = MARGIN + TITLE_ROW
    if caption:
        labels += CAPTION_ROW
    top = labels + LABEL_ROW
    shown_before = _shrunk(before, scale)
    shown_after = _shrunk(after, scale)
    sheet = _blank(top + max(len(shown_before), len(shown_after)), width)
    ops = _label(title, (MARGIN, MARGIN), inner, TITLE_SIZE, INK)
    ops += _label(caption, (MARGIN, MARGIN + TITLE_ROW), inner, CAPTION_SIZE, INK)
    left = MARGIN
    for name, picture, shown in (("before", before, shown_before), ("after", after, shown_after)):
        text = f"{name}  {size_text(_size(picture))}"
        ops += _label(text, (left, labels), panel, LABEL_SIZE, MUTED)
        h, w = _size(shown)
        sheet[top : top + h, left : left + w] = shown
        left += panel + MARGIN
    plan = Plan("contact_sheet", _size(sheet), ops=tuple(ops))
    return apply(plan, sheet, inplace=True)


def _size(picture: UInt8Array) -> Size:
    backend = find_backend(picture)
    if backend.name != "numpy" or picture.ndim != 3:
        raise ImageTypeError(
            f"contact_sheet takes NumPy pictures [H, W, 3], got {backend.name}"
            f" {list(picture.shape)}"
        )
    backend.check(picture)
    return backend.size(picture)


def _shrunk(picture: UInt8Array, scale: float) -> UInt8Array:
    height, width = _size(picture)
    size = (max(1, round(height * scale)), max(1, round(width * scale)))
    if size == (height, width):
        return picture
    return resample(picture, size)


def _label(text: str, at: tuple[int, int], width: int, size: int, color: str) -> list[Paste]:
    line = " ".join(text.split())
    if not line:
        return []
    check_glyphs(line, FONT, "contact_sheet title")
    best = largest_fitting([line], FONT, width, 4 * size, size, SMALLEST)
    if best is None:
        raise ParameterError(
            f"contact_sheet: the line {line!r} does not fit {width} pixels; shorten it"
        )
    recipe = {
        "draw": "text",
        "lines": [line],
        "font": FONT,
        "size": best,
        "color": color,
        "edge_color": color,
    }
    return [Paste(recipe, (at,))]
