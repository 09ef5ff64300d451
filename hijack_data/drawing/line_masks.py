"""The coverage of one line of text, composed from cached glyphs.

If every letter starts on a whole pixel, the result equals Pillow's own; otherwise Pillow draws the
line.
"""

import itertools
from typing import TypeAlias

import numpy as np
from PIL import ImageDraw, ImageFont

from ..cache import Cache
from ..types import Point, UInt8Array
from .canvas import canvas, check_area
from .text import advances, load_font

CACHE_BYTES = 8 * 2**20
MARGIN = 2  # pixels around a line's measured box, in case a letter sticks out

# left, top and coverage of a letter in its line
_Letter: TypeAlias = tuple[int, int, UInt8Array]

_masks = Cache(CACHE_BYTES)


def line_mask(line: str, font: str, size: int) -> tuple[UInt8Array, Point]:
    """Return the coverage of one line, uint8 `[h, w]`, and its corner relative to (x, y)."""
    key = (line, font, size)
    found = _masks.get(key)
    if found is not None:
        return found
    made = _set_letters(line, font, size) if len(line) > 1 else None
    if made is None:
        made = _drawn_line(line, load_font(font, size))
    mask, _ = made
    mask.setflags(write=False)
    _masks.put(key, made, mask.nbytes)
    return made


def _drawn_line(line: str, font: ImageFont.FreeTypeFont) -> tuple[UInt8Array, Point]:
    """Draw a line with Pillow."""
    x1, y1, x2, y2 = (int(v) for v in font.getbbox(line))
    width = max(1, x2 - x1) + 2 * MARGIN
    height = max(1, y2 - y1) + 2 * MARGIN
    image = canvas("L", width, height)
    ImageDraw.Draw(image).text((MARGIN - x1, MARGIN - y1), line, fill=255, font=font)
    left, top, right, bottom = image.getbbox() or (0, 0, 0, 0)
    corner = (x1 - MARGIN + left, y1 - MARGIN + top)
    return np.array(image)[top:bottom, left:right], corner


def _set_letters(line: str, font: str, size: int) -> tuple[UInt8Array, Point] | None:
    """Compose a line from cached glyphs, placed as Pillow places them.

    Returns `None` if a letter of the line lies between two pixels.
    """
    if "\n" in line:  # Pillow breaks the line here
        return None
    starts = [0.0, *itertools.accumulate(advances(line, load_font(font, size)))][:-1]
    if not all(start.is_integer() for start in starts):
        return None
    known = {letter: line_mask(letter, font, size) for letter in set(line)}
    placed: list[_Letter] = []
    for start, letter in zip(starts, line, strict=True):
        mask, (left, top) = known[letter]
        if mask.size:
            placed.append((int(start) + left, top, mask))
    if not placed:
        return np.zeros((0, 0), np.uint8), (0, 0)
    return _joined(placed)


def _joined(letters: list[_Letter]) -> tuple[UInt8Array, Point]:
    """Return the joint coverage of letters, and its corner."""
    first = min(left for left, _, _ in letters)
    top = min(y for _, y, _ in letters)
    right = max(left + mask.shape[1] for left, _, mask in letters)
    bottom = max(y + mask.shape[0] for _, y, mask in letters)
    check_area(right - first, bottom - top)
    out = np.zeros((bottom - top, right - first), np.uint8)
    end = first
    for left, y, mask in letters:
        height, width = mask.shape
        row = y - top
        column = left - first
        below = out[row : row + height, column : column + width]
        below[:] = mask if left >= end else _over(mask, below)
        end = max(end, left + width)
    return out, (first, top)


def _over(mask: UInt8Array, below: UInt8Array) -> UInt8Array:
    """Blend the coverage of a letter over that of earlier letters."""
    added = np.multiply(mask, np.uint16(255), dtype=np.uint16)
    kept = np.multiply(below, 255 - mask, dtype=np.uint16)
    total = added + kept + 128
    return ((total + (total >> 8)) >> 8).astype(np.uint8)
