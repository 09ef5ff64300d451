"""Read JSON files, and write files whole or not at all.

`write_atomic` and `replace_atomic` are the only writers by temporary file and rename, and
`read_versioned_json` is the only reader of files that carry a format and a version.
"""

import errno
import json
import os
import secrets
import shutil
import stat
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO, cast

from .errors import HijackError, ParameterTypeError, StorageError, short_repr

_STORAGE = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EFBIG})


def read_versioned_json(
    path: str | os.PathLike[str],
    *,
    format: str,
    version: int,
    description: str,
    error: type[HijackError] = HijackError,
    missing: str | None = None,
) -> dict[str, Any]:
    """Read a JSON file whose fields `format` and `version` name its layout.

    Args:
        path: the file.
        format: the required value of the field `format`.
        version: the newest version that the caller can read; 1 to this one are accepted.
        description: a description of the file for messages, such as `"the manifest of a dataset"`.
        error: the class of the errors raised.
        missing: the whole message for a missing file, instead of the usual one.

    Returns:
        The object, as read; only the two fields are checked.

    Raises:
        HijackError: `error`, a kind of it: the file is missing, unreadable, not JSON, or has
            another format or a version outside 1 to `version`.
    """
    try:
        data: object = json.loads(Path(path).read_bytes())
    except (FileNotFoundError, NotADirectoryError) as problem:
        raise error(missing or f"{path}: cannot be read ({problem.strerror})") from None
    except OSError as problem:
        raise error(f"{path}: cannot be read ({problem.strerror or problem})") from None
    except (ValueError, RecursionError) as problem:
        raise error(f"{path}: is not JSON ({str(problem)[:200]})") from None
    return check_versioned(
        data, format=format, version=version, source=str(path), description=description, error=error
    )


def check_versioned(
    data: object,
    *,
    format: str,
    version: int,
    description: str,
    source: str = "",
    error: type[HijackError] = HijackError,
) -> dict[str, Any]:
    """Check the fields `format` and `version` of JSON data, and return the data.

    The arguments are those of `read_versioned_json`; `source`, if given, begins the messages.

    Raises:
        HijackError: of the class `error`, if the data are not an object, have another format, or a
            version outside 1 to `version`.
    """
    stored = cast("dict[str, Any]", data) if isinstance(data, dict) else {}
    begin = f"{source}: " if source else ""
    if stored.get("format") != format:
        raise error(f"{begin}not {description} (field 'format' must be {format!r})")
    number = stored.get("version")
    if isinstance(number, bool) or not isinstance(number, int) or number < 1:
        raise error(
            f"{begin}version {short_repr(number)} is not a version; it must be an integer,"
            f" 1 to {version}"
        )
    if number > version:
        raise error(
            f"{begin}version {number} is newer than this library reads ({version}); upgrade"
            " agenthijack"
        )
    return stored


def is_full(error: OSError) -> bool:
    """Return whether a file cannot be written because the disk is full or fails."""
    return error.errno in _STORAGE


def unwritable(path: str | os.PathLike[str], error: OSError) -> HijackError:
    """Return the error to raise for a file that cannot be written.

    It is a `StorageError` if the disk is full, over its quota or broken, and a plain `HijackError`
    if the path is the problem.
    """
    kind = StorageError if is_full(error) else HijackError
    return kind(f"{path}: cannot be written ({error.strerror or error})")


def make_folder(folder: Path, file: Path | None = None) -> None:
    """Create a folder and those that it lies in, unless they are there.

    Args:
        folder: the folder.
        file: a file that will be written into it, which the error then names.

    Raises:
        HijackError: it cannot be created, as `unwritable` says.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        problem = unwritable(file or folder, error)
        raise problem from None


def open_regular(path: Path) -> BinaryIO:
    """Open an untrusted file for reading.

    Raises:
        OSError: the file cannot be opened, or is a pipe or a device, reading which might never end.
        IsADirectoryError: the path is a folder.
    """
    flags = os.O_RDONLY | getattr(os, "O_BINARY", 0) | getattr(os, "O_NONBLOCK", 0)
    handle = os.open(path, flags)
    mode = os.fstat(handle).st_mode
    if stat.S_ISREG(mode):
        return os.fdopen(handle, "rb")
    os.close(handle)
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    raise OSError(errno.EINVAL, "is not a regular file, and reading it might never end")


def read_regular(path: Path) -> bytes:
    """Return the content of an untrusted file; raises what `open_regular` raises."""
    with open_regular(path) as file:
        return file.read()


def write_atomic(path: str | os.PathLike[str], data: bytes | str) -> None:
    """Write a file whole or not at all: into a temporary file next to it, which is then renamed.

    Text is written as UTF-8. The errors are those of `replace_atomic`.

    Raises:
        HijackError: the text is not Unicode.
    """
    try:
        content = data.encode() if isinstance(data, str) else data
    except UnicodeEncodeError as error:
        raise HijackError(f"{path}: cannot be written, the text is not Unicode ({error})") from None
    replace_atomic(path, lambda temporary: temporary.write_bytes(content))


def replace_atomic(path: str | os.PathLike[str], write: Callable[[Path], object]) -> None:
    """Call `write` with a temporary path next to `path`, then rename that file to `path`.

    If anything fails, the temporary file is removed and `path` is unchanged. The content is on the
    disk before the file gets its name, and the name is on the disk before this function returns:
    after a power failure, the file is either the old or the new one, and whole. The permissions are
    those of a new file under the process's umask. A device or a pipe, such as `/dev/null`, is
    written to and never replaced.

    Raises:
        ParameterTypeError: `path` is not a path.
        HijackError: the folder is missing or read-only, the name is impossible, or it is a name in
            `/dev` or `/proc` for a file that is open; a `StorageError` if the disk is full or
            broken. Other errors of `write` are passed on.
    """
    try:
        target = Path(path)
    except TypeError:
        raise ParameterTypeError(f"a file is named by its path, got {short_repr(path)}") from None
    if _is_device(target):
        with tempfile.TemporaryDirectory() as folder:
            content = Path(folder) / "content"
            write(content)
            _copy_to_device(content, target)
        return
    try:
        temporary = _new_file_beside(target)
    except OSError as error:
        problem = unwritable(path, error)
        raise problem from None
    except ValueError as error:  # a NUL, or half a surrogate, in the name
        raise HijackError(f"{str(path)!r}: cannot be written ({error})") from None
    try:
        write(temporary)
        _to_disk(temporary, os.O_RDWR)
        temporary.replace(target)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        problem = unwritable(path, error)
        raise problem from None
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    with suppress(OSError):  # not every system can flush a folder
        _to_disk(target.parent, os.O_RDONLY)


def _is_device(target: Path) -> bool:
    """Return whether a path names a device, a pipe or a socket.

    Raises:
        HijackError: the path is another name for a file that a process has open, such as
            `/dev/stdout`; a rename would replace that name for the whole machine.
    """
    try:
        mode = target.stat().st_mode
        folder = target.parent.resolve()
    except (OSError, ValueError, RuntimeError):
        return False  # missing or not a valid name: writing will raise
    if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
        return True
    if target.is_symlink() and folder.parts[1:2] in (("dev",), ("proc",)):
        raise HijackError(
            f"{target}: is another name for a file that is open; name the file, or redirect what"
            " the command prints"
        )
    return False


def _copy_to_device(source: Path, target: Path) -> None:
    try:
        with source.open("rb") as content, target.open("wb") as device:
            shutil.copyfileobj(content, device)
    except OSError as error:
        raise unwritable(target, error) from None


def _new_file_beside(target: Path) -> Path:
    # Created by `open`, so that the kernel applies the umask; reading the umask to apply it here
    # would change it for the whole process.
    while True:
        path = target.with_name(f".{target.name}.{secrets.token_hex(4)}.tmp")
        try:
            handle = os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666)
        except FileExistsError:
            continue
        os.close(handle)
        return path


def _to_disk(path: Path, flags: int) -> None:
    handle = os.open(path, flags)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
