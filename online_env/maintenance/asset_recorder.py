"""Record the asset pack: one desktop after the other, for each size and look."""

import itertools
import os
import shutil
import subprocess
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from hijack_data.errors import UnknownNameError, suggest
from hijack_data.pack import picture_kinds
from hijack_data.types import Size

from ..embedded.desktop import EmbeddedDesktop
from ..errors import DesktopError
from ..recording.captured_picture import Picture
from ..recording.stage import RecordingStage
from .asset_pack import AssetPackWriter
from .desktop_looks import GOLDEN, LOOKS, Look
from .scenes import (
    UnrecordedScene,
    apps,
    desktops,
    error_pages,
    lock_screens,
    menus,
    parts,
    windows,
)
from .wallpapers import SIZE as LARGE

SIZES: tuple[Size, ...] = ((1080, 1920), (768, 1366), (720, 1280), (1440, 2560))
EVERY_SIZE: tuple[Size, ...] = (*SIZES, LARGE)
LOOK_NAMES = (GOLDEN, *(look.name for look in LOOKS))
AssetScene: TypeAlias = Callable[[RecordingStage], Iterator[Picture | UnrecordedScene]]
Where: TypeAlias = Callable[[Size, str], bool]


def _golden(size: Size, look: str) -> bool:
    """Return whether it is the usual size, in the golden look."""
    return size == SIZES[0] and look == GOLDEN


def _golden_everywhere(size: Size, look: str) -> bool:
    """Return whether it is any size but the wallpapers' in the golden look, or the usual one."""
    if size == LARGE:
        return False
    return look == GOLDEN or size == SIZES[0]


def _large(size: Size, look: str) -> bool:
    """Return whether it is the size of the wallpapers, in the golden look."""
    return size == LARGE and look == GOLDEN


# Each scene, the kinds that it makes, and the sizes and looks in which it is recorded.
SCENES: tuple[tuple[AssetScene, frozenset[str], Where], ...] = (
    (lock_screens.record, frozenset({"lock_screen", "lock_dialog"}), _golden_everywhere),
    (desktops.record, frozenset({"desktop"}), _golden_everywhere),
    (error_pages.record, frozenset({"error_page", "error_view", "panel"}), _golden_everywhere),
    (menus.record, frozenset({"menu", "dialog"}), _golden),
    (windows.record, frozenset({"window"}), _golden_everywhere),
    (parts.record_icons, frozenset({"icon"}), _golden),
    (parts.record_wallpapers, frozenset({"wallpaper"}), _large),
)
PICTURED_PACKAGES = (
    "xfwm4",
    "xfce4-panel",
    "xfdesktop4",
    "mate-screensaver",
    "greybird-gtk-theme",
    "elementary-xfce-icon-theme",
    "chromium",
    "geany",
    "mousepad",
    "thunar",
    "xfce4-terminal",
    "libreoffice-writer",
    "libreoffice-calc",
    "vlc",
    "gimp",
    "ristretto",
    "evince",
    "xfce4-settings",
    "xfce4-appfinder",
    "libreoffice-impress",
)
_number = itertools.count(1)


def record_assets(
    folder: Path,
    only: Iterable[str] = (),
    sizes: Iterable[Size] = EVERY_SIZE,
    say: Callable[[str], object] = print,
    looks: Iterable[str] = (GOLDEN,),
) -> list[UnrecordedScene]:
    """Record the pack into `folder`.

    Args:
        folder: The pack's folder; pictures that are not recorded now stay.
        only: Kinds to record; all if empty.
        sizes: Sizes of the screens, `(height, width)`; fewer pictures are made on other than the
            usual one.
        say: Called with a line for each picture.
        looks: Looks of the desktop, from `LOOK_NAMES`.

    Returns:
        What could not be recorded.

    Raises:
        UnknownNameError: A kind or a look does not exist.
        DesktopError: No desktop starts at all.
    """
    kinds_wanted = _checked_names(only, picture_kinds(), "kind of picture")
    screens = list(sizes)
    styles = _looks(looks)
    pack = AssetPackWriter(folder, kinds_wanted, screens, styles)
    failures: list[UnrecordedScene] = []
    for look, size in itertools.product(styles, screens):
        scenes = [
            scene
            for scene, kinds, is_recorded in SCENES
            if kinds & kinds_wanted and is_recorded(size, look)
        ]
        for picture in _all(scenes, size, styles[look]):
            if isinstance(picture, UnrecordedScene):
                failures.append(picture)
                say(
                    f"NOT recorded at {size[1]}x{size[0]}, {look}: {picture.name}: {picture.reason}"
                )
            elif picture.kind in kinds_wanted:
                say(_added(pack, picture, size, look))
    total = pack.finish(_describe_desktop())
    say(f"{len(pack.entries)} pictures, {total / 1e6:.1f} MB in {folder}")
    return failures


def _added(pack: AssetPackWriter, picture: Picture, size: Size, look: str) -> str:
    """Add a picture to the pack; return a line about it."""
    entry = pack.add(picture, size, look)
    if entry is None:
        return f"the same again: {picture.kind}, {picture.made_by}"
    return f"{entry['id']}: {picture.made_by}"


def _checked_names(names: Iterable[str], choices: Sequence[str], noun: str) -> set[str]:
    """Return the names, or all of `choices` if none is given.

    Raises:
        UnknownNameError: A name is not one of them.
    """
    selection = set(names) or set(choices)
    for name in selection:
        if name not in choices:
            raise UnknownNameError(f"no {noun} {name!r}{suggest(name, choices)}")
    return selection


def _looks(names: Iterable[str]) -> dict[str, Look | None]:
    """Return the looks of these names in the table's order; `None` is the golden home as it is."""
    selection = _checked_names(names, LOOK_NAMES, "look")
    looks: dict[str, Look | None] = {GOLDEN: None}
    looks |= {look.name: look for look in LOOKS}
    return {name: look for name, look in looks.items() if name in selection}


def _all(
    scenes: Iterable[AssetScene], size: Size, look: Look | None
) -> Iterator[Picture | UnrecordedScene]:
    """Yield the scenes' pictures, each on a pristine desktop of that size and look."""
    for scene in scenes:
        name = f"rec-{os.getpid()}-{next(_number)}"
        try:
            with EmbeddedDesktop.up(size=size, name=name, time_out=60.0) as desktop:
                stage = RecordingStage(desktop, look.name if look else GOLDEN)
                apps.put_files(stage)
                if look is not None:
                    look.apply(stage)
                yield from scene(stage)
        except DesktopError as error:
            yield UnrecordedScene(f"the rest of {scene.__module__.rpartition('.')[2]}", str(error))


def _describe_desktop() -> dict[str, Any]:
    """Return the day, and the versions of what can be seen in the pictures."""
    versions: dict[str, str] = {}
    if shutil.which("dpkg-query"):
        command = ["dpkg-query", "-W", "-f=${Package} ${Version}\n", *PICTURED_PACKAGES]
        result = subprocess.run(command, capture_output=True, text=True, check=False)
        for line in result.stdout.splitlines():
            name, _, version = line.partition(" ")
            if version:
                versions[name] = version
    return {"date": time.strftime("%Y-%m-%d", time.gmtime()), "packages": versions}
