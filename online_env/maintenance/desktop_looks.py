"""Looks of a desktop: themes and wallpaper, put on while it runs."""

import io
import shlex
from dataclasses import dataclass

from PIL import Image

from hijack_data.types import UInt8Array

from ..desktops.commands import home
from ..recording.stage import RecordingStage
from . import wallpapers

BACKDROP = "/backdrop/screen0/monitorscreen/workspace0"
CENTRED = 1  # of xfdesktop's image styles
FILE = ".wallpaper.png"


@dataclass(frozen=True)
class Look:
    """How a desktop looks.

    Args:
        name: Its name, which `made_by` of a picture gives.
        theme: The GTK theme.
        frames: The theme of the window manager.
        wallpaper: One of `wallpapers.NAMES`, shown in the middle of the screen and unscaled.
        dark_panel: Whether the panel is dark whatever the theme.
    """

    name: str
    theme: str
    frames: str
    wallpaper: str
    dark_panel: bool = True

    def apply(self, stage: RecordingStage) -> None:
        """Give a desktop this look; open windows change, too."""
        put_wallpaper(stage, wallpapers.draw(self.wallpaper))
        _set(stage, "xsettings", "/Net/ThemeName", "string", self.theme)
        _set(stage, "xfwm4", "/general/theme", "string", self.frames)
        _set(stage, "xfce4-panel", "/panels/dark-mode", "bool", str(self.dark_panel).lower())
        _gsettings(stage, "org.mate.interface", "gtk-theme", self.theme)
        _gsettings(stage, "org.gnome.desktop.interface", "gtk-theme", self.theme)
        stage.settled()


GOLDEN = "golden"  # the look of the golden home
# The other looks.
LOOKS: tuple[Look, ...] = (
    Look("dark", "Greybird-dark", "Greybird-dark", "night"),
    Look("bright", "Adwaita", "Daloa", "dunes", dark_panel=False),
)


def put_wallpaper(stage: RecordingStage, picture: UInt8Array) -> None:
    """Show `picture`, uint8 RGB `[h, w, 3]`, as the wallpaper, and on the locked screen."""
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, "PNG", compress_level=1)
    path = f"{home(stage.desktop)}/{FILE}"
    stage.desktop.write_file(path, buffer.getvalue())
    _set(stage, "xfce4-desktop", f"{BACKDROP}/image-style", "int", str(CENTRED))
    # First another path: the desktop does not read a file of the same name again.
    _set(stage, "xfce4-desktop", f"{BACKDROP}/last-image", "string", "")
    _set(stage, "xfce4-desktop", f"{BACKDROP}/last-image", "string", path)
    _gsettings(stage, "org.mate.background", "picture-options", "centered")
    _gsettings(stage, "org.mate.background", "picture-filename", path)
    stage.settled()


def hide_icons(stage: RecordingStage) -> None:
    """Remove the icons from the desktop."""
    _set(stage, "xfce4-desktop", "/desktop-icons/style", "int", "0")
    stage.settled()


def _set(stage: RecordingStage, channel: str, key: str, kind: str, value: str) -> None:
    command = ["xfconf-query", "-c", channel, "-p", key, "-n", "-t", kind, "-s", value]
    stage.command(shlex.join(command))


def _gsettings(stage: RecordingStage, schema: str, key: str, value: str) -> None:
    stage.command(shlex.join(["gsettings", "set", schema, key, value]))
