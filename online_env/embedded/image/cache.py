"""The images of this machine, each in a folder that is named by its content.

    images/ID/manifest.json, files.jsonl, root/ (Debian), guest/ (Python packages)
    images/names/NAME     the id that the name stands for
    images/default        the name of the image that desktops start from by default
    images/packages/      Debian's packages that were fetched

A folder gets its name when it is complete. What a killed process left has another name, and the
next one that writes here removes it.
"""

import errno
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from hijack_data.errors import ParameterError, StorageError, suggest
from hijack_data.file_io import unwritable, write_atomic
from hijack_data.locking import LockedError, lock

from ...errors import DesktopImageError
from ..runtime import registry
from ..runtime.hidden_folders import LAYERS
from . import archive, debian, file_entries, manifest
from .manifest import Manifest

VARIABLE = "AGENTHIJACK_IMAGES"
CHOICE = "AGENTHIJACK_IMAGE"
HOST = "host"  # stands for the machine's own packages where a name is expected
ROOT = "root"
GUEST = "guest"
BUILDING = ".building-"
REMOVED = ".removed-"
_NAMES = "names"
_DEFAULT = "default"
_LETTERS = frozenset("abcdefghijklmnopqrstuvwxyz0123456789-.")
_LONGEST = 40
# What the files of an image take on a disk, beyond their sizes: blocks, folders.
_ROOM = 1.15
Report = Callable[[str], None]


def images_folder() -> Path:
    """The folder of the images: `$AGENTHIJACK_IMAGES`, or `images` beside the golden homes."""
    folder = os.environ.get(VARIABLE)
    return Path(folder).absolute() if folder else LAYERS / "images"


def ensure_images_folder() -> Path:
    """Return the folder of the images, made where it is missing.

    Others may not look into it: some programs of an image run as the owner of their files.

    Raises:
        DesktopImageError: The folder belongs to another user, or its disk runs no programs.
        HijackError: The folder cannot be written.
    """
    folder = images_folder()
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        for name in (_NAMES, "packages"):
            (folder / name).mkdir(exist_ok=True)
    except OSError as error:
        problem = unwritable(folder, error)
        raise problem from None
    if folder.stat().st_uid != os.geteuid():
        raise DesktopImageError(f"{folder} belongs to another user; set {VARIABLE} to a folder")
    if is_noexec(folder):
        raise DesktopImageError(
            f"{folder}: no programs may run from there (mounted with noexec); set {VARIABLE} to a"
            " folder on another disk"
        )
    return folder


def is_noexec(folder: Path) -> bool:
    """Return whether the file system of `folder`, or of what is above it, runs no programs."""
    while not folder.exists():
        folder = folder.parent
    return bool(os.statvfs(folder).f_flag & os.ST_NOEXEC)


@contextmanager
def cache_lock(report: Report) -> Iterator[Path]:
    """Hold the cache: one process at a time builds, imports or removes. Yields its folder.

    Args:
        report: called with the name of the process that this one waits for.

    Raises:
        DesktopImageError: The folder cannot be used.
    """
    folder = ensure_images_folder()
    path = folder / ".lock"
    try:
        file_lock = lock(path)
    except LockedError as error:
        report(f"waiting: {folder} is being written by {error.holder}")
        file_lock = lock(path, wait=True)
    with file_lock:
        file_lock.sign()
        for leftover in (*folder.glob(f"{BUILDING}*"), *folder.glob(f"{REMOVED}*")):
            file_entries.remove(leftover)
        yield folder


@contextmanager
def build_folder(folder: Path) -> Iterator[Path]:
    """Yield a folder to make an image in; nothing is left of it unless `publish` renamed it.

    Raises:
        StorageError: The disk is full.
        OSError: The folder cannot be written.
    """
    fresh = Path(tempfile.mkdtemp(prefix=BUILDING, dir=folder))
    try:
        yield fresh
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise StorageError(f"{fresh}: the disk is full; free some space") from None
        raise
    finally:
        file_entries.remove(fresh)


def publish(fresh: Path, image: Manifest) -> Path:
    """Give a complete image its place, unless it is there already and whole.

    Returns:
        That place.

    Raises:
        DesktopImageError: What is there is damaged, and a desktop runs from it.
    """
    final = fresh.parent / image.id
    if is_whole(final):
        return final
    if final.exists():
        _check_unused(image.id, image.id)
        _put_away(final)
    fresh.chmod(0o755)
    os.sync()
    fresh.rename(final)
    return final


def is_whole(folder: Path) -> bool:
    """Return whether there is an image at `folder`, with every file as its manifest says."""
    try:
        return folder.is_dir() and not verify(folder)
    except (DesktopImageError, OSError):
        return False


def write_name(folder: Path, name: str, image: str) -> None:
    """Let `name` stand for the image with the id `image`; before, it may have stood for another."""
    write_atomic(folder / _NAMES / check_name(name), f"{image}\n")


def check_name(name: str) -> str:
    """Return `name` if an image may be called so.

    Raises:
        ParameterError: It may not.
    """
    if not 1 <= len(name) <= _LONGEST or not set(name) <= _LETTERS or name[0] in "-.":
        raise ParameterError(
            f"image name {name!r} must be 1 to {_LONGEST} of a-z, 0-9, '-' and '.', and begin with"
            " a letter or digit"
        )
    if name == HOST:
        raise ParameterError(f"no image can be called {HOST!r}: that means the machine's packages")
    return name


def names() -> dict[str, str]:
    """Return the ids of the images by their names; names of images that are gone are left out."""
    folder = images_folder()
    mapping: dict[str, str] = {}
    for path in sorted((folder / _NAMES).glob("[!.]*")):
        image = path.read_text(encoding="ascii", errors="replace").strip()
        if image and (folder / image / manifest.NAME).is_file():
            mapping[path.name] = image
    return mapping


def images() -> dict[str, Manifest]:
    """Return the manifests of all images by their ids.

    Raises:
        DesktopImageError: One is damaged.
    """
    paths = sorted(images_folder().glob(f"[!.]*/{manifest.NAME}"))
    return {path.parent.name: manifest.read(path) for path in paths}


def resolve(name: str) -> Path:
    """Return the folder of an image, by its name or the beginning of its id.

    Raises:
        DesktopImageError: There is none, or several, or it is for another architecture.
    """
    ids_by_name = names()
    folder = images_folder()
    ids = [path.parent.name for path in sorted(folder.glob(f"[!.]*/{manifest.NAME}"))]
    matches = (
        [ids_by_name[name]]
        if name in ids_by_name
        else [i for i in ids if name and i.startswith(name)]
    )
    if len(matches) != 1:
        unnamed = [i for i in ids if i not in ids_by_name.values()]
        listed = ", ".join([*ids_by_name, *unnamed]) or "none"
        problem = f"{len(matches)} images begin with" if matches else "no image"
        raise DesktopImageError(
            f"{problem} {name!r}{suggest(name, list(ids_by_name))}; there are: {listed}. `hijack"
            " desktop image build` makes one, `hijack desktop image import FILE` reads one"
        )
    target = folder / matches[0]
    check_architecture(manifest.read(target / manifest.NAME), str(target))
    for part in (ROOT, GUEST):
        if not (target / part).is_dir():
            raise DesktopImageError(f"{target / part} is missing; build or import the image again")
    return target


def check_architecture(image: Manifest, label: str) -> None:
    """Check that this machine can run an image.

    Raises:
        DesktopImageError: It is for another architecture.
    """
    machine = os.uname().machine
    expected = debian.ARCHITECTURES.get(machine, machine)
    if image.architecture != expected:
        raise DesktopImageError(
            f"{label}: is for {image.architecture}, and this machine is {expected}; build one here"
            " with `hijack desktop image build`"
        )


def requested_name(name: str | None) -> str:
    """Return the name of the image for a desktop, or `host` for the machine's own packages.

    Args:
        name: the name, if one was given; else `$AGENTHIJACK_IMAGE` decides, then what
            `make_default` set, and at last it is `host`.
    """
    return name or os.environ.get(CHOICE) or _default() or HOST


def _default() -> str:
    try:
        return (images_folder() / _DEFAULT).read_text(encoding="ascii").strip()
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        return ""


def make_default(name: str) -> None:
    """Let desktops start from the image `name`, or with `host` from the machine's packages.

    Raises:
        StorageError: The cache cannot be written.
    """
    if name != HOST:
        write_atomic(ensure_images_folder() / _DEFAULT, f"{name}\n")
        return
    (images_folder() / _DEFAULT).unlink(missing_ok=True)


def find_image_folder(name: str | None) -> Path | None:
    """Return the image for a desktop, or `None` for the machine's own packages.

    Args:
        name: as for `requested_name`.

    Raises:
        DesktopImageError: There is no such image.
    """
    resolved = requested_name(name)
    return None if resolved == HOST else resolve(resolved)


def check_room(folder: Path, size: float) -> None:
    """Check that a disk has room for an image.

    Raises:
        StorageError: It has not.
    """
    free = shutil.disk_usage(folder).free
    if free < size * _ROOM:
        raise StorageError(
            f"{folder}: {size * _ROOM / 1e6:.0f} MB are needed and {free / 1e6:.0f} MB are free;"
            f" free some, or set {VARIABLE} to a folder on another disk"
        )


def import_file(path: Path, name: str | None, report: Report) -> tuple[str, Manifest]:
    """Read an image from a file into the cache.

    Args:
        path: the file.
        name: what to call it; by its profiles, if not given.
        report: called with the name of the process that this one waits for.

    Returns:
        The name, and the manifest.

    Raises:
        DesktopImageError: The file is cut off, damaged, changed, or for another machine.
        StorageError: The disk has no room.
    """
    image = archive.read_manifest(path)
    check_architecture(image, str(path))
    image_name = check_name(name or default_name(image.profiles))
    with cache_lock(report) as folder:
        if not is_whole(folder / image.id):
            check_room(folder, image.size)
            with build_folder(folder) as fresh:
                publish(fresh, archive.unpack(path, fresh))
        write_name(folder, image_name, image.id)
    return image_name, image


def default_name(profiles: tuple[str, ...]) -> str:
    """Return the default name of an image: its profiles; `core` only if there is no other."""
    return "-".join(name for name in profiles if name != "core") or "core"


def verify(folder: Path) -> list[str]:
    """Return what is not as the manifest says in the image at `folder`: a line for each file.

    Raises:
        DesktopImageError: The manifest itself is damaged.
    """
    image = manifest.read(folder / manifest.NAME)
    if image.id != folder.name:
        return [f"{folder / manifest.NAME}: was changed: its id is {image.id}"]
    listed = folder / manifest.FILES
    if not listed.is_file() or file_entries.digest(listed) != image.files_sha256:
        return [f"{listed}: is missing or was changed"]
    entries = file_entries.parse(listed.read_text(encoding="utf-8"), str(listed))
    return list(file_entries.differences(folder, entries, (manifest.NAME, manifest.FILES)))


def remove(name: str, report: Report) -> str:
    """Remove an image and its names; returns its id.

    Raises:
        DesktopImageError: There is none, or a desktop runs from it.
    """
    with cache_lock(report) as folder:
        ids_by_name = names()
        image = ids_by_name.get(name) or resolve(name).name
        _check_unused(image, name)
        for alias, target in ids_by_name.items():
            if target == image:
                (folder / _NAMES / alias).unlink()
                if alias == _default():
                    make_default(HOST)
        _put_away(folder / image)
    return image


def _check_unused(image: str, name: str) -> None:
    """Check that no desktop runs from the image with this id, which the error calls `name`.

    Raises:
        DesktopImageError: A desktop runs from it.
    """
    users = [record["id"] for record in registry.records() if record.get("image") == image]
    if users:
        raise DesktopImageError(
            f"image {name!r} is in use by {', '.join(users)}; end them first: hijack desktop"
            f" down {users[0]}"
        )


def _put_away(image: Path) -> None:
    """Remove an image; by another name first, so that no half image is left by an interrupt."""
    target = image.with_name(f"{REMOVED}{image.name}")
    image.rename(target)
    file_entries.remove(target)
