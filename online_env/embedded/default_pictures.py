"""The pictures of the golden home, drawn here: wallpaper, lock screen and the user's face."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFilter

Colour: TypeAlias = tuple[int, int, int]
Floats: TypeAlias = npt.NDArray[np.float64]
Stop: TypeAlias = tuple[float, Colour]

HEIGHT, WIDTH = 1080, 1920  # no scaling on the usual screen
SIZE = (HEIGHT, WIDTH)
SKY: tuple[Stop, ...] = (
    (0.0, (24, 44, 84)),
    (0.35, (62, 96, 142)),
    (0.55, (166, 160, 172)),
    (0.68, (236, 190, 160)),
    (1.0, (250, 214, 176)),
)
GLOW: Colour = (255, 232, 200)
GLOW_X = 0.72
GLOW_WIDTH = 0.20
GLOW_Y = 0.56
GLOW_HEIGHT = 0.16
GLOW_STRENGTH = 0.75
FOOT = 0.16  # how far below its line a ridge has the colour of its foot
BELOW_ALL = 9.0
BLUR = 12
DARK = 0.55
SKIN: Colour = (236, 240, 246)
SHIRT: Colour = (74, 118, 168)
# Ordered dithering (Bayer), 4x4, in sixteenths.
DITHER = ((0, 8, 2, 10), (12, 4, 14, 6), (3, 11, 1, 9), (15, 7, 13, 5))


@dataclass(frozen=True, kw_only=True)
class Ridge:
    """A line of hills.

    Attributes:
        line: height of its middle, 0 at the top of the picture and 1 at its bottom.
        swing: how far it goes up and down.
        waves: of it over the width of the picture.
        phase: where its wave begins, in radians.
        top: colour at its line.
        foot: colour below.
    """

    line: float
    swing: float
    waves: float
    phase: float
    top: Colour
    foot: Colour

    def height_at(self, x: Floats) -> Floats:
        """Its line at `x`, both in shares of the picture."""
        turn = 2 * np.pi * self.waves * x + self.phase
        hills = 0.62 * np.sin(turn)
        slopes = 0.26 * np.sin(2.3 * turn + 1)
        rocks = 0.12 * np.sin(5.1 * turn + 2)
        return self.line + self.swing * (hills + slopes + rocks)


# From far to near.
RIDGES = (
    Ridge(line=0.60, swing=0.045, waves=1.7, phase=0.3, top=(142, 136, 164), foot=(196, 172, 172)),
    Ridge(line=0.67, swing=0.050, waves=2.3, phase=2.2, top=(104, 110, 150), foot=(160, 148, 166)),
    Ridge(line=0.75, swing=0.045, waves=1.5, phase=4.4, top=(66, 84, 126), foot=(112, 114, 146)),
    Ridge(line=0.84, swing=0.040, waves=2.6, phase=1.1, top=(36, 58, 94), foot=(66, 80, 116)),
    Ridge(line=0.93, swing=0.030, waves=1.9, phase=5.3, top=(16, 34, 60), foot=(30, 46, 74)),
)


def wallpaper() -> Image.Image:
    """Five misty ridges before an evening sky: RGB 1920x1080, the same bytes every time."""
    x = np.linspace(0, 1, WIDTH)[None, :]
    y = np.linspace(0, 1, HEIGHT)[:, None]
    picture = _gradient(SKY, np.broadcast_to(y, SIZE))
    _add_glow(picture, x, y)
    for ridge in RIDGES:
        _add_ridge(picture, ridge, x, y)
    return _to_image(picture)


def lock_picture(base: Image.Image) -> Image.Image:
    """Return the wallpaper as the lock screen shows it: blurred and darker."""
    small = base.resize((1280, 720), Image.Resampling.BOX)
    blurred = small.filter(ImageFilter.GaussianBlur(BLUR))
    large = blurred.resize(base.size, Image.Resampling.BICUBIC)
    return _to_image(np.asarray(large, np.float64) * DARK)


def face() -> Image.Image:
    """Return a plain avatar, RGB 192x192."""
    picture = Image.new("RGB", (768, 768), SHIRT)
    draw = ImageDraw.Draw(picture)
    draw.ellipse((254, 150, 514, 410), SKIN)
    draw.ellipse((134, 450, 634, 1000), SKIN)
    return picture.resize((192, 192), Image.Resampling.BOX)


def _add_glow(picture: Floats, x: Floats, y: Floats) -> None:
    across = (x - GLOW_X) / GLOW_WIDTH
    down = (y - GLOW_Y) / GLOW_HEIGHT
    glow = np.exp(-(across**2 + down**2))[..., None]
    missing = np.array(GLOW, np.float64) - picture
    picture += glow * missing * GLOW_STRENGTH


def _add_ridge(picture: Floats, ridge: Ridge, x: Floats, y: Floats) -> None:
    below = y - ridge.height_at(x)
    # one pixel wide edge, so it is smooth
    inside = np.clip(below * HEIGHT + 0.5, 0, 1)[..., None]
    stops = ((0.0, ridge.top), (FOOT, ridge.foot), (BELOW_ALL, ridge.foot))
    picture += inside * (_gradient(stops, below) - picture)


def _gradient(stops: tuple[Stop, ...], at: Floats) -> Floats:
    positions = [position for position, _ in stops]
    channels: list[Floats] = []
    for i in range(3):
        values = [colour[i] for _, colour in stops]
        channels.append(np.interp(at, positions, values))
    return np.stack(channels, -1)


def _to_image(picture: Floats) -> Image.Image:
    """Return a picture of whole numbers; an ordered pattern hides the bands of slow gradients."""
    tile = np.array(DITHER) / 16
    pattern = np.tile(tile, (HEIGHT // 4, WIDTH // 4))
    dithered = picture + pattern[..., None]
    return Image.fromarray(dithered.clip(0, 255).astype(np.uint8))
