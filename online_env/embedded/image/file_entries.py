"""The files of an image: their list, their times, and what was changed since.

Owners are not kept: all files of an image are root's, whoever built it.
"""

import hashlib
import json
import os
import shutil
import stat
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from ...errors import DesktopImageError

# The time of folders, and of files that were made while the image was built.
EPOCH = 1_700_000_000
_KINDS = {stat.S_IFDIR: "folder", stat.S_IFREG: "file", stat.S_IFLNK: "link"}


@dataclass(frozen=True)
class Entry:
    """A file, a folder or a link of an image.

    Attributes:
        path: below the image's folder, with `/` between the parts.
        kind: `file`, `folder` or `link`.
        mode: the permissions; 0 for a link.
        size: of a file in bytes.
        time: of a file, in seconds since 1970.
        content: of a file its SHA-256, of a link its target; else empty.
    """

    path: str
    kind: str
    mode: int = 0
    size: int = 0
    time: int = 0
    content: str = ""

    def to_json(self) -> str:
        """One line."""
        fields = [self.path, self.kind, self.mode, self.size, self.time, self.content]
        return json.dumps(fields) + "\n"


def listing(entries: Iterable[Entry]) -> str:
    """Return the list of the files, as it is kept beside the manifest."""
    return "".join(entry.to_json() for entry in entries)


def parse(text: str, label: str) -> list[Entry]:
    """Return the entries of a `listing`.

    Raises:
        DesktopImageError: A line is none, or its path leads out of the image.
    """
    entries: list[Entry] = []
    for number, line in enumerate(text.splitlines(), 1):
        try:
            entry = Entry(*json.loads(line))
            parts = entry.path.split("/")
        except (ValueError, TypeError, AttributeError, RecursionError):
            raise DesktopImageError(f"{label}:{number}: is no entry of a file") from None
        if entry.kind not in _KINDS.values() or {"", ".", ".."} & set(parts):
            raise DesktopImageError(f"{label}:{number}: {entry.path!r} cannot be in an image")
        entries.append(entry)
    return entries


def walk(top: Path) -> Iterator[Path]:
    """All that is below `top`, each folder before what it holds, in the order of the names."""
    with os.scandir(top) as entries:
        names = sorted(entry.name for entry in entries)
    for name in names:
        path = top / name
        yield path
        if path.is_dir() and not path.is_symlink():
            yield from walk(path)


def read_entry(path: Path, top: Path) -> Entry:
    """Return the entry of one file as it is.

    Raises:
        DesktopImageError: It is a device, a socket or a pipe.
        OSError: It cannot be read.
    """
    status = path.lstat()
    kind = _KINDS.get(stat.S_IFMT(status.st_mode))
    name = path.relative_to(top).as_posix()
    if kind is None:
        raise DesktopImageError(f"{path}: is neither a file nor a folder nor a link")
    if kind == "link":
        return Entry(name, kind, content=os.readlink(path))
    mode = stat.S_IMODE(status.st_mode)
    if kind == "folder":
        return Entry(name, kind, mode)
    return Entry(name, kind, mode, status.st_size, int(status.st_mtime), digest(path))


def digest(path: Path) -> str:
    """Return the SHA-256 of a file, hexadecimal."""
    with open(path, "rb") as handle:
        return hashlib.file_digest(handle, "sha256").hexdigest()


def set_times(top: Path, began: float) -> None:
    """Give all below `top` permissions and times that do not depend on who built it, and when.

    Args:
        top: the image's folder.
        began: when the build began; what is younger was made by it and gets `EPOCH`.
    """
    for path in walk(top):
        if path.is_symlink():
            continue
        status = path.stat()
        is_folder = stat.S_ISDIR(status.st_mode)
        mode = stat.S_IMODE(status.st_mode)
        # Whoever uses the image owns its files, and must be able to read all of them.
        path.chmod(mode | (0o700 if is_folder else 0o400))
        if is_folder or status.st_mtime >= began:
            os.utime(path, (EPOCH, EPOCH))
        else:
            os.utime(path, (int(status.st_mtime), int(status.st_mtime)))


def differences(top: Path, entries: Iterable[Entry], beside: Iterable[str] = ()) -> Iterator[str]:
    """Yield what is not as `entries` say below `top`: one line for each file that is not.

    Modification times are not compared.

    Args:
        top: the image's folder.
        entries: all that should be in it.
        beside: paths that may be there, too.
    """
    expected = {entry.path: entry for entry in entries}
    listed = {*expected, *beside}
    for entry in expected.values():
        yield from _difference(top / entry.path, entry, top)
    for path in walk(top):
        if path.relative_to(top).as_posix() not in listed:
            yield f"{path}: is not a file of the image"


def _difference(path: Path, entry: Entry, top: Path) -> Iterator[str]:
    try:
        actual = read_entry(path, top)
    except (FileNotFoundError, NotADirectoryError):
        yield f"{path}: is missing"
        return
    except (OSError, DesktopImageError) as error:
        yield f"{path}: cannot be read ({error})"
        return
    if actual.kind != entry.kind:
        yield f"{path}: is a {actual.kind}, not a {entry.kind}"
    elif actual.size != entry.size:
        yield f"{path}: has {actual.size} bytes, not {entry.size}"
    elif actual.content != entry.content:
        yield f"{path}: has another content"
    elif actual.mode != entry.mode:
        yield f"{path}: has the permissions {actual.mode:o}, not {entry.mode:o}"


def remove(top: Path) -> None:
    """Remove a tree, folders without permission to write included; none there is fine."""
    if top.is_symlink() or not top.is_dir():
        top.unlink(missing_ok=True)
        return
    for folder, names, _ in os.walk(top):
        for name in names:
            path = Path(folder, name)
            if not path.is_symlink():
                path.chmod(0o700)
    shutil.rmtree(top)
