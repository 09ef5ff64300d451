"""Parts from which screens of any size are laid out: wallpapers, and the desktop's icons."""

from collections.abc import Iterator, Sequence

import numpy as np

from hijack_data.types import Box, UInt8Array

from ...errors import DesktopError
from ...recording.captured_picture import ClickTarget, Picture
from ...recording.stage import RecordingStage
from .. import wallpapers
from ..desktop_looks import hide_icons, put_wallpaper
from . import UnrecordedScene

# Pixels around an icon's box in the tree that its label's shadow may reach.
SHADOW = 4


def record_wallpapers(stage: RecordingStage) -> Iterator[Picture | UnrecordedScene]:
    """Yield each wallpaper; the desktop must show it as drawn, except below its panel."""
    hide_icons(stage)
    stage.park()
    for name in wallpapers.NAMES:
        yield from UnrecordedScene.instead(f"wallpaper {name}", _wallpaper(stage, name))


def _wallpaper(stage: RecordingStage, name: str) -> Iterator[Picture]:
    expected = wallpapers.draw(name)
    put_wallpaper(stage, expected)
    end = stage.area()[3]
    screen = stage.settled()
    if screen.shape != expected.shape or not np.array_equal(screen[:end], expected[:end]):
        raise DesktopError("the desktop does not show it as it was drawn")
    made_by = "drawn by wallpapers.py; a desktop showed it centred"
    yield Picture("wallpaper", name, stage.screen, expected, made_by)


def record_icons(stage: RecordingStage) -> Iterator[Picture | UnrecordedScene]:
    """Yield the desktop's icons with their labels; the wallpaper behind them is transparent."""
    yield from UnrecordedScene.instead("icons of the desktop", _icons(stage))


def _icons(stage: RecordingStage) -> Iterator[Picture]:
    stage.park()
    height, width = stage.desktop.size
    screens: list[UInt8Array] = []
    for level in (0, 255):
        put_wallpaper(stage, np.full((height, width, 3), level, np.uint8))
        screens.append(stage.settled())
    icons = [target for target in stage.launcher_targets() if target.role == "icon"]
    if not icons:
        raise DesktopError("the desktop shows no icon")
    for icon in icons:
        yield _icon(icon, screens)


def _icon(icon: ClickTarget, screens: Sequence[UInt8Array]) -> Picture:
    left = icon.box[0] - SHADOW
    top = icon.box[1] - SHADOW
    right = icon.box[2] + SHADOW
    bottom = icon.box[3] + SHADOW
    on_black, on_white = (frame[top:bottom, left:right] for frame in screens)
    pixels = matte(on_black, on_white)
    box: Box = (left, top, right, bottom)
    made_by = f"the icon {icon.name} on a black and on a white wallpaper"
    return Picture("icon", icon.name.lower(), box, pixels, made_by, [icon])


def matte(on_black: UInt8Array, on_white: UInt8Array) -> UInt8Array:
    """Return what was drawn over both backgrounds, uint8 RGBA `[h, w, 4]`.

    Args:
        on_black: The picture over black, uint8 RGB `[h, w, 3]`.
        on_white: The same over white.
    """
    # How much of the background shows, 0 to 255.
    difference = on_white.astype(np.float64) - on_black
    alpha = np.clip(255 - difference.mean(axis=2), 0, 255)
    scale = 255 / np.maximum(alpha, 1)
    colour = np.clip(on_black * scale[..., None], 0, 255)
    pixels = np.dstack([colour, alpha]).round().astype(np.uint8)
    pixels[pixels[..., 3] == 0] = 0
    return pixels
