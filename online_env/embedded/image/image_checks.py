"""The findings of `hijack desktop doctor` about images: their folder and their problems."""

from collections.abc import Iterator
from pathlib import Path

from ...errors import DesktopError
from . import cache

# A name, whether it is well, what was found, the way out, and whether nothing starts without it.
Found = tuple[str, bool, str, str, bool]
_MEMORY = ("tmpfs", "ramfs")


def is_asked_for(image: str | None) -> bool:
    """Return whether a desktop starts from an image: by `image`, the environment, or `install`."""
    return cache.requested_name(image) != cache.HOST


def findings(image: str | None) -> Iterator[Found]:
    """Yield all findings; they are `required` only if a desktop is to start from an image.

    Args:
        image: its name; without it `cache.wanted` decides.
    """
    required = is_asked_for(image)
    yield _folder_finding(required)
    yield _image(image, required)


def _folder_finding(required: bool) -> Found:
    name = "image folder"
    folder = cache.images_folder()
    remedy = f"export {cache.VARIABLE}=FOLDER, with a folder on another disk"
    if cache.is_noexec(folder):
        return name, False, f"{folder}: no programs may run there (noexec)", remedy, required
    kind = file_system(folder)
    if kind in _MEMORY:
        detail = f"{folder}: in memory ({kind}): images take memory and are lost at a restart"
        return name, False, detail, remedy, False
    return name, True, f"{folder} ({kind})", "", False


def file_system(folder: Path, mounts: Path = Path("/proc/self/mounts")) -> str:
    """Return the kind of the file system that `folder` is on, or will be."""
    best = ("", "unknown")
    for line in mounts.read_text(encoding="utf-8", errors="replace").splitlines():
        _, mount_point, kind, *_ = line.split()
        is_above = folder.is_relative_to(mount_point)
        if is_above and len(mount_point) >= len(best[0]):
            best = (mount_point, kind)
    return best[1]


def _image(image: str | None, required: bool) -> Found:
    name = "image"
    build = "hijack desktop install"
    try:
        folder = cache.find_image_folder(image)
    except DesktopError as error:
        return name, False, str(error), build, True
    if folder is not None:
        return name, True, f"desktops start from {folder.name}", "", required
    listed = ", ".join(cache.names()) or "none"
    return name, True, f"desktops start from this machine's packages; images: {listed}", "", False
