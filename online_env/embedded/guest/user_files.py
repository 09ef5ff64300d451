"""Files of the desktop's user. The server has that user's rights only, so the kernel decides."""

import errno
import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

from ...errors import GuestError

CHUNK = 2**20
MAX_ENTRIES = 20_000
MAX_DEPTH = 64
NEW_FILE = 0o644
BAD_REQUEST = 400
FORBIDDEN = 403
NOT_FOUND = 404
FAILED = 500
NO_ROOM = 507


def expand(path: object) -> str:
    """Return a path with `~` and variables filled in, as OSWorld's server reads it.

    Raises:
        GuestError: It is not a path (400).
    """
    if not isinstance(path, str) or not path or "\0" in path:
        raise GuestError(
            f"a path must be a text without zero bytes, got {path!r:.200}", BAD_REQUEST
        )
    return os.path.expandvars(os.path.expanduser(path))


def refusal(path: str, problem: OSError) -> GuestError:
    """Return the answer if a file cannot be had: 404, 403, 507 (no room) or 500."""
    if isinstance(problem, FileNotFoundError | NotADirectoryError):
        return GuestError(f"File not found: {path}", NOT_FOUND)
    if isinstance(problem, PermissionError):
        reason = f"the desktop's user may not use {path}: {problem.strerror}"
        return GuestError(reason, FORBIDDEN)
    is_full = problem.errno in (errno.ENOSPC, errno.EDQUOT)
    status = NO_ROOM if is_full else FAILED
    return GuestError(f"{path}: {problem.strerror or problem}", status)


def open_file(path: str) -> tuple[BinaryIO, int]:
    """Open a regular file to read.

    Returns:
        The file, and its size in bytes.

    Raises:
        GuestError: There is none (404), the user may not read it (403), or it is not a file (400).
    """
    try:
        # Without O_NONBLOCK a pipe would wait for its writer.
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        file = os.fdopen(descriptor, "rb")
    except IsADirectoryError:
        raise GuestError(f"{path} is a folder, not a file", BAD_REQUEST) from None
    except OSError as problem:
        error = refusal(path, problem)
        raise error from None
    status = os.fstat(file.fileno())
    if not stat.S_ISREG(status.st_mode):
        file.close()
        raise GuestError(f"{path} is not a regular file", BAD_REQUEST)
    return file, status.st_size


def chunks(file: BinaryIO) -> Iterator[bytes]:
    """Yield the content of a file piece by piece; closes it."""
    with file:
        data = file.read(CHUNK)
        while data:
            yield data
            data = file.read(CHUNK)


def save(path: str, source: BinaryIO) -> int:
    """Write the content of `source` to `path`, whole or not at all.

    Folders on the way are made. An existing file keeps its mode, a symbolic link is followed.

    Args:
        path: of the file.
        source: read to its end.

    Returns:
        The number of bytes.

    Raises:
        GuestError: It cannot be written.
    """
    target = Path(os.path.realpath(path))
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        if target.is_dir():
            raise GuestError(f"{path} is a folder, not a file", BAD_REQUEST)
        mode = stat.S_IMODE(target.stat().st_mode) if target.exists() else NEW_FILE
        handle, name = tempfile.mkstemp(prefix=".upload-", dir=target.parent)
    except OSError as problem:
        error = refusal(path, problem)
        raise error from None
    try:
        with os.fdopen(handle, "wb") as part:
            shutil.copyfileobj(source, part, CHUNK)
            size = part.tell()
        os.chmod(name, mode)
        os.replace(name, target)
    except OSError as problem:
        os.unlink(name)
        error = refusal(path, problem)
        raise error from None
    return size


def listing(path: str) -> dict[str, Any]:
    """Return a folder as OSWorld's server describes it; links to folders are not entered.

    Returns:
        `type`, `name` and `children`, which are described in the same way.

    Raises:
        GuestError: It is not a folder (400).
    """
    if not os.path.isdir(path):
        raise GuestError("The provided path is not a directory", BAD_REQUEST)
    return _Listing().folder(path, 0)


class _Listing:
    """A description of a tree of folders, up to so many entries."""

    def __init__(self) -> None:
        self._left = MAX_ENTRIES

    def folder(self, path: str, depth: int) -> dict[str, Any]:
        children: list[dict[str, Any]] = []
        row: dict[str, Any] = {
            "type": "directory",
            "name": os.path.basename(path),
            "children": children,
        }
        try:
            with os.scandir(path) as entries:
                for entry in entries:
                    if self._left <= 0 or depth > MAX_DEPTH:
                        row["truncated"] = True
                        break
                    self._left -= 1
                    children.append(self._entry(entry, depth))
        except OSError as problem:
            return {"error": str(problem)}
        return row

    def _entry(self, entry: os.DirEntry[str], depth: int) -> dict[str, Any]:
        if entry.is_dir(follow_symlinks=False):
            return self.folder(entry.path, depth + 1)
        if entry.is_dir():
            return {"type": "directory", "name": entry.name, "children": []}
        return {"type": "file", "name": entry.name}
