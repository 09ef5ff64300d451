"""Wallpapers of the asset pack, drawn here: flat shapes, so that large ones take few bytes.

A desktop that centres its wallpaper shows the middle of it, pixel by pixel, on a screen of any size
that it covers.
"""

from collections.abc import Callable, Mapping

import numpy as np

from hijack_data.types import UInt8Array

from ..embedded.default_pictures import Colour, Floats

# Height and width: they cover a 4K screen, and one of 2560x1440 that stands upright.
SIZE = (2560, 3840)
# Unit of the drawings in pixels: the middle of 1920 units shows on an ordinary screen.
UNIT = 1080


def draw(name: str) -> UInt8Array:
    """Draw a wallpaper of `NAMES`: uint8 RGB `[2560, 3840, 3]`, the same bytes every time."""
    drawn = _DRAW[name]()
    return np.clip(drawn + 0.5, 0, 255).astype(np.uint8)


def _grid() -> tuple[Floats, Floats]:
    """Return coordinates in units from the middle: x `[1, W]` to the right, y `[H, 1]` down."""
    height, width = SIZE
    x = (np.arange(width) - (width - 1) / 2) / UNIT
    y = (np.arange(height) - (height - 1) / 2) / UNIT
    return x[None, :], y[:, None]


def _plain(top: Colour, bottom: Colour) -> Floats:
    """Return a slow gradient from top to bottom."""
    share = np.linspace(0, 1, SIZE[0])[:, None, None]
    above = (1 - share) * np.array(top, float)
    below = share * np.array(bottom, float)
    rows = np.floor(above + below)
    return np.broadcast_to(rows, (*SIZE, 3)).copy()


def _fill(picture: Floats, inside: Floats, colour: Colour) -> None:
    """Paint a shape, with an edge one pixel wide.

    Args:
        picture: Where to paint, `[H, W, 3]`.
        inside: The distance to the shape's edge in units, positive inside.
        colour: RGB.
    """
    cover = np.clip(inside * UNIT + 0.5, 0, 1)
    cover = np.broadcast_to(cover, SIZE)[..., None]
    picture += cover * (np.array(colour, float) - picture)


def _disc(x: Floats, y: Floats, centre: tuple[float, float], radius: float) -> Floats:
    """Return the distance to the edge of a disc, positive inside."""
    return radius - np.hypot(x - centre[0], y - centre[1])


def _ridge(x: Floats, level: float, swing: float, waves: float, phase: float) -> Floats:
    turn = 2 * np.pi * waves * x + phase
    slow = 0.6 * np.sin(turn)
    middle = 0.3 * np.sin(2.3 * turn + 1)
    fast = 0.1 * np.sin(5.1 * turn + 2)
    return level + swing * (slow + middle + fast)


def _dunes() -> Floats:
    """Sand by day."""
    x, y = _grid()
    picture = _plain((150, 202, 226), (244, 226, 196))
    _fill(picture, _disc(x, y, (0.45, -0.22), 0.11), (255, 246, 214))
    colours = ((232, 190, 140), (220, 168, 114), (204, 146, 94), (182, 122, 76))
    for number, colour in enumerate(colours):
        level = 0.08 + 0.13 * number
        waves = 0.42 + 0.1 * number
        ridge = _ridge(x, level, 0.09, waves, 1.7 * number)
        _fill(picture, y - ridge, colour)
    return picture


def _night() -> Floats:
    """Stars and a moon above a forest."""
    x, y = _grid()
    picture = _plain((8, 12, 30), (44, 58, 96))
    draws = np.random.Generator(np.random.Philox(7))
    rows = draws.integers(0, 1700, 420)
    columns = draws.integers(0, SIZE[1], 420)
    for row, column in zip(rows, columns, strict=True):
        picture[row : row + 2, column : column + 2] = (214, 222, 244)
    _fill(picture, _disc(x, y, (-0.5, -0.27), 0.085), (238, 236, 220))
    _fill(picture, _disc(x, y, (-0.465, -0.285), 0.08), (20, 28, 56))
    for number, colour in enumerate(((32, 44, 76), (22, 32, 58), (12, 20, 38))):
        tooth = (x * (17 + 5 * number)) % 1
        tips = 0.028 * np.abs(tooth - 0.5) * 2
        level = 0.16 + 0.12 * number
        waves = 0.5 + 0.2 * number
        ridge = _ridge(x, level, 0.06, waves, 2.1 * number)
        _fill(picture, y - ridge - tips, colour)
    return picture


def _sheets() -> Floats:
    """Sheets of paper laid across each other."""
    x, y = _grid()
    picture = _plain((38, 70, 83), (30, 58, 70))
    colours = (
        (42, 110, 118),
        (42, 157, 143),
        (138, 177, 125),
        (233, 196, 106),
        (244, 162, 97),
        (231, 111, 81),
    )
    along = x * np.cos(0.5) + y * np.sin(0.5)
    for number, colour in enumerate(colours):
        edge = -0.2 + 0.24 * number
        curl = 0.02 * np.sin(3 * y + number)
        _fill(picture, along - edge - curl, colour)
    return picture


def _contours() -> Floats:
    """The lines of a map."""
    x, y = _grid()
    across = np.sin(2.1 * x + 0.7)
    down = np.cos(2.7 * y - 0.4)
    slanted = 0.7 * np.sin(3.3 * x * 0.8 + 2.9 * y + 1.1)
    height = across + down + slanted
    picture = _plain((236, 240, 238), (222, 230, 228))
    to_right = np.gradient(height, 1 / UNIT, axis=1)
    downwards = np.gradient(height, 1 / UNIT, axis=0)
    steep = np.hypot(to_right, downwards) + 1e-3
    nearest = np.abs(((height * 3.5) % 1) - 0.5)
    off = nearest / (3.5 * steep)
    _fill(picture, 0.0014 - off, (150, 176, 170))
    return picture


def _evening() -> Floats:
    """Five ridges before an evening sky."""
    x, y = _grid()
    picture = _plain((24, 44, 84), (250, 214, 176))
    _fill(picture, _disc(x, y, (0.4, 0.02), 0.09), (255, 236, 208))
    colours = ((142, 136, 164), (104, 110, 150), (66, 84, 126), (36, 58, 94), (16, 34, 60))
    for number, colour in enumerate(colours):
        level = 0.1 + 0.08 * number
        waves = 0.9 + 0.3 * (number % 3)
        ridge = _ridge(x, level, 0.045, waves, 2.3 * number)
        _fill(picture, y - ridge, colour)
    return picture


def _slate() -> Floats:
    """Dark grey with one light corner."""
    x, y = _grid()
    picture = _plain((52, 56, 64), (40, 43, 50))
    for number, colour in enumerate(((58, 63, 72), (66, 72, 82), (77, 84, 95))):
        _fill(picture, _disc(x, y, (1.05, 0.75), 1.5 - 0.34 * number), colour)
    return picture


_DRAW: Mapping[str, Callable[[], Floats]] = {
    "dunes": _dunes,
    "night": _night,
    "sheets": _sheets,
    "contours": _contours,
    "evening": _evening,
    "slate": _slate,
}
NAMES = tuple(_DRAW)
