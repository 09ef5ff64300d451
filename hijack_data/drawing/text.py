"""Fonts and text measurement: find a font's file, measure a text, find missing glyphs.

Planning a text takes most of its time for measuring, so widths are summed from cached pairs of
letters. With BASIC layout a letter's advance depends on the next letter alone (kerning), and all
advances are multiples of 1/64 pixel, so the sum equals FreeType's bit for bit; a test compares
them.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from operator import add
from pathlib import Path
from weakref import WeakKeyDictionary

from PIL import Image, ImageDraw, ImageFont

from ..errors import FontError

FONTS = Path(__file__).resolve().parents[1] / "fonts"
MAX_PAIRS = 1 << 14  # cached pairs of letters for one font at one size: about 2 MB
_Advances = dict[str, float]
_advances: "WeakKeyDictionary[ImageFont.FreeTypeFont, _Advances]" = WeakKeyDictionary()
_NO_GLYPH = "\U0010ffff"  # a noncharacter: every font draws its "missing glyph" box for it


def font_file(name: str) -> Path:
    """Return the file of a bundled font (`"DejaVuSans"`, `"DejaVuSansMono-Bold"`) or of a path.

    Raises:
        FontError: there is no such file.
    """
    path = _find_font(name)
    if path is None:
        bundled = ", ".join(sorted(p.stem for p in FONTS.glob("*.ttf")))
        advice = f"give the path of a .ttf or .otf file, or one of: {bundled}"
        raise FontError(f"font {name!r:.200} is not a file; {advice}")
    return path


def is_bundled(name: str) -> bool:
    """Return whether `name` is the name of a bundled font, such as `"DejaVuSans"`."""
    return name in {path.stem for path in FONTS.glob("*.ttf")}


def _find_font(name: str) -> Path | None:
    bundled = FONTS / f"{name}.ttf"
    try:
        path = bundled if "/" not in name and bundled.is_file() else Path(name).expanduser()
        return path if path.is_file() else None
    # Too long, contains a NUL, or `~` of an unknown user.
    except (OSError, ValueError, RuntimeError):
        return None


@lru_cache(maxsize=128)
def load_font(name: str, size: int) -> ImageFont.FreeTypeFont:
    """Load a font at `size` pixels, BASIC layout.

    Raises:
        FontError: there is no such file, or the file is not a font.
    """
    path = font_file(name)
    try:
        return ImageFont.truetype(str(path), size, layout_engine=ImageFont.Layout.BASIC)
    except (OSError, ValueError) as error:
        raise FontError(f"font {name!r}: {path} cannot be loaded as a font ({error})") from error


def line_height(font: ImageFont.FreeTypeFont) -> int:
    """Return the height of one line in pixels."""
    ascent, descent = font.getmetrics()
    return ascent + descent


def line_width(line: str, font: ImageFont.FreeTypeFont) -> float:
    """Return the width of one line in pixels.

    The width equals `font.getlength(line)`, without calling FreeType for each new line.
    """
    return sum(advances(line, font))


def advances(line: str, font: ImageFont.FreeTypeFont) -> list[float]:
    """Return how far each letter of a line moves the next one to the right, in pixels."""
    widths = _advances.get(font)
    if widths is None or len(widths) > MAX_PAIRS:
        widths = {}
        _advances[font] = widths
    # the last letter has no successor
    pairs = [*map(add, line, line[1:]), line[-1:]] if line else []
    try:
        return [widths[pair] for pair in pairs]
    except KeyError:
        for pair in set(pairs) - widths.keys():
            second = font.getlength(pair[1]) if len(pair) == 2 else 0.0
            widths[pair] = font.getlength(pair) - second
        return [widths[pair] for pair in pairs]


def measure(lines: Sequence[str], font: ImageFont.FreeTypeFont, edge: int = 0) -> tuple[int, int]:
    """Return the width and height in pixels of lines below one another, each with an outline.

    The outline is `edge` pixels wide.
    """
    width = max((math.ceil(line_width(line, font)) for line in lines), default=0)
    height = line_height(font) + 2 * edge
    return width + 2 * edge, height * len(lines)


def overhang(lines: Sequence[str], font: ImageFont.FreeTypeFont) -> int:
    """Return by how many pixels, at most, letters stick out of the box that `measure` gives."""
    height = line_height(font)
    largest = 0.0
    for line in lines:
        x1, y1, x2, y2 = font.getbbox(line)
        width = math.ceil(line_width(line, font))
        largest = max(largest, -x1, -y1, x2 - width, y2 - height)
    return math.ceil(largest)


def largest_fitting(
    lines: Sequence[str], font: str, width: int, height: int, high: int, low: int = 1
) -> int | None:
    """Return the largest font size in `[low, high]` at which the lines fit `width` x `height`.

    Returns `None` if no size fits.
    """
    return _largest_fitting(tuple(lines), font, width, height, high, low)


@lru_cache(maxsize=1024)
def _largest_fitting(
    lines: tuple[str, ...], font: str, width: int, height: int, high: int, low: int
) -> int | None:
    if low > high:
        return None
    if _fits(lines, font, high, width, height):  # the common case, which needs one measurement only
        return high
    if not _fits(lines, font, low, width, height):
        return None
    while low < high:
        middle = (low + high + 1) // 2
        if _fits(lines, font, middle, width, height):
            low = middle
        else:
            high = middle - 1
    return low


def _fits(lines: Sequence[str], font: str, size: int, width: int, height: int) -> bool:
    w, h = measure(lines, load_font(font, size))
    return w <= width and h <= height


def wrap(text: str, font: ImageFont.FreeTypeFont, width: int) -> list[str]:
    """Break each line of `text` at spaces so that no line is wider than `width`, if possible."""
    lines: list[str] = []
    for paragraph in text.split("\n"):
        line = ""
        for word in paragraph.split(" "):
            longer = f"{line} {word}" if line else word
            if line and line_width(longer, font) > width:
                lines.append(line)
                longer = word
            line = longer
        lines.append(line)
    return lines


@lru_cache(maxsize=4096)
def _has_glyph(name: str, char: str) -> bool:
    font = load_font(name, 24)
    return char.isspace() or _glyph_pixels(font, char) != _glyph_pixels(font, _NO_GLYPH)


def _glyph_pixels(font: ImageFont.FreeTypeFont, char: str) -> bytes:
    image = Image.new("L", (64, 64))
    ImageDraw.Draw(image).text((16, 16), char, fill=255, font=font)
    return image.tobytes()


def check_glyphs(text: str, font: str, parameter: str) -> None:
    """Check that a font has all letters of `text`, the value of a parameter.

    Raises:
        FontError: the font lacks letters; the message names the parameter and the letters.
    """
    missing = sorted({char for char in text if not _has_glyph(font, char)})
    if not missing:
        return
    listing = ", ".join(f"{char!r} (U+{ord(char):04X})" for char in missing[:5])
    if len(missing) > 5:
        listing += " ..."
    advice = "choose a font that has it or other text"
    raise FontError(f"{parameter}: font {font!r} has no glyph for {listing}; {advice}")
