"""Safe reading of untrusted recordings: no path outside the source, no pickles, bounded sizes.

Nothing outside the source folder is opened, links to folders are not followed, only regular files
are opened, pickles are never opened, lines and files over `MAX_RECORD_BYTES` are not read into
memory, and anything that is not JSON is a `FieldError`.

A snapshot in the cache of the Hugging Face Hub is a folder of links into the `blobs` of its
repository: only those links may leave the source.
"""

import io
import json
import os
import stat
import struct
import warnings
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any, TypeAlias, cast

from PIL import Image

from hijack_data.errors import short_repr
from hijack_data.file_io import open_regular
from hijack_data.picture_io import FORMATS
from hijack_data.surrogates import has_half
from hijack_data.types import Size

from .fields import LONE_SURROGATE, FieldError, JsonObject, mapping

MAX_RECORD_BYTES = 50 * 2**20
MAX_HEAD_RECORDS = 20
MAX_FIELD_CHARS = 60  # characters of a field in a report
PICKLES = (".pkl", ".pickle", ".pkl.xz", ".pkl.gz", ".pt", ".pth", ".joblib", ".npy", ".npz")
PICKLE = (
    "a pickle (or a file that may hold one) is never opened: reading it would run what is in it"
)
# How an archive is unpacked, by the end of its name.
UNPACK_COMMANDS = {
    ".tar.zst": "tar --zstd -xf",
    ".tar": "tar -xf",
    ".tgz": "tar -xf",
    ".tar.gz": "tar -xf",
    ".tar.bz2": "tar -xf",
    ".tar.xz": "tar -xf",
    ".zip": "unzip",
    ".7z": "7z x",
    ".rar": "unrar x",
    ".gz": "gunzip -k",
    ".bz2": "bunzip2 -k",
    ".xz": "unxz -k",
    ".zst": "unzstd",
}
SCREENS = (".png", ".jpg", ".jpeg", ".webp", ".bmp", ".gif", ".tif", ".tiff")
NOT_UTF8 = "its name is not UTF-8; rename it"
CACHED = ("datasets--", "models--", "spaces--")
BLOBS = "blobs"
SNAPSHOTS = "snapshots"
REFS = "refs"
_CHUNK_BYTES = 1 << 20
_BROKEN = (
    OSError,
    SyntaxError,
    ValueError,
    EOFError,
    IndexError,
    KeyError,
    struct.error,
    zlib.error,
)


@dataclass(frozen=True)
class Part:
    """The files of a source for one reader, in the order of their names.

    `root` is the folder of the whole source; names in reports are relative to it.
    """

    root: Path
    files: tuple[Path, ...]


# The input of a reader: a file, a folder, or its part of a folder with several formats.
Source: TypeAlias = Path | Part


@dataclass(frozen=True)
class RecordLine:
    """One line that is not blank.

    Args:
        number: the number of the line in the file, from 1.
        offset: where it begins, in bytes.
        data: its bytes; `None` if there are more than `MAX_RECORD_BYTES`.
    """

    number: int
    offset: int
    data: bytes | None

    def record(self, *, unique: bool = True) -> JsonObject:
        """Return the JSON object in the line; `unique` as in `parse`.

        Raises:
            FieldError: the line is too long, or not a JSON object.
        """
        if self.data is None:
            raise FieldError("", f"longer than {MAX_RECORD_BYTES // 2**20} MiB")
        return mapping(parse(self.data, unique=unique), "")


def lines(path: Path, limit: int | None = None) -> Iterator[RecordLine]:
    """Yield the lines of a file, never holding more than one of at most `limit` bytes."""
    limit = MAX_RECORD_BYTES if limit is None else limit
    number = 0
    with open_regular(path) as file:
        while True:
            offset = file.tell()
            data = file.readline(limit + 1)
            if not data:
                return
            number += 1
            if len(data) > limit:
                yield RecordLine(number, offset, None)
                _skip_line(file, data)  # the caller may stop here without reading further
            elif data.strip(b" \t\r\n\xef\xbb\xbf"):
                yield RecordLine(number, offset, data)


def line_at(file: Any, offset: int) -> bytes:
    """Read again a line that `lines` found at `offset`."""
    file.seek(offset)
    return file.readline(MAX_RECORD_BYTES + 1)


def _unique(pairs: list[tuple[str, Any]]) -> JsonObject:
    """Return a JSON object without repeated keys, of which Python would use the last.

    Raises:
        FieldError: a key is repeated.
    """
    record = dict(pairs)
    if len(record) == len(pairs):
        return record
    ((twice, _),) = Counter(key for key, _ in pairs).most_common(1)
    field = twice if twice.isprintable() and len(twice) <= MAX_FIELD_CHARS else ""
    raise FieldError(field, f"the key {short_repr(twice)} stands twice in one object; keep one")


_STRICT = json.JSONDecoder(object_pairs_hook=_unique)


def parse(data: bytes, *, unique: bool = True) -> object:
    """Parse JSON.

    Args:
        data: UTF-8 text.
        unique: whether a repeated key in an object is an error. Otherwise the last one counts,
            which is good enough for detecting formats.

    Raises:
        FieldError: the text is not UTF-8, not JSON, nested too deeply, or repeats a key in an
            object.
    """
    try:
        text = data.decode("utf-8-sig")
        return _STRICT.decode(text) if unique else json.loads(text)
    except UnicodeDecodeError as error:
        raise FieldError("", f"not UTF-8 (byte {error.start}: {error.reason})") from None
    except RecursionError:
        raise FieldError("", "nested too deeply") from None
    except FieldError:
        raise
    except ValueError as error:
        raise FieldError("", f"not JSON ({error})") from None


def parse_embedded(value: object, field: str) -> object:
    """Return a value that may be given as JSON text.

    Raises:
        FieldError: the text is not JSON, or contains half of a surrogate pair.
    """
    if not isinstance(value, str):
        return value
    if has_half(value):
        raise FieldError(field, LONE_SURROGATE)
    try:
        return parse(value.encode())
    except FieldError as error:
        raise FieldError(field, error.reason) from None


def parse_file(path: Path) -> JsonObject:
    """Parse a whole file as a JSON object, or raise `FieldError`. See `parse`."""
    return mapping(parse_any(path), "")


def refuse_array(path: Path) -> None:
    """Refuse a file of JSON lines that holds one JSON array.

    Raises:
        FieldError: it does; the message has the command that writes lines.
    """
    first = next(lines(path, limit=_CHUNK_BYTES), None)
    start = b"" if first is None or first.data is None else first.data
    if first is not None and first.data is None:
        with open_regular(path) as file:
            start = file.read(_CHUNK_BYTES)
    if not start.lstrip(b" \t\r\n\xef\xbb\xbf").startswith(b"["):
        return
    with open_regular(path) as file:
        file.seek(max(0, os.fstat(file.fileno()).st_size - _CHUNK_BYTES))
        end = file.read(_CHUNK_BYTES)
    if end.rstrip().endswith(b"]"):  # otherwise one line is broken, and others may be good
        raise FieldError("", f"holds a JSON array, not an object a line: {json_lines_advice(path)}")


def json_lines_advice(path: Path) -> str:
    """Return the advice for a JSON array in a file that should have an object a line."""
    return f"write one object a line, as jq -c '.[]' {path.name} does"


def parse_any(path: Path, *, unique: bool = True) -> object:
    """Parse a whole file as JSON, see `parse`.

    Raises:
        FieldError: the file is unreadable, empty, too large or not JSON.
    """
    try:
        with open_regular(path) as file:
            data = file.read(MAX_RECORD_BYTES + 1)
    except OSError as error:
        raise FieldError("", f"cannot be read ({error.strerror or error})") from None
    if len(data) > MAX_RECORD_BYTES:
        raise FieldError("", f"larger than {MAX_RECORD_BYTES // 2**20} MiB")
    if not data.strip():
        raise FieldError("", "the file is empty")
    return parse(data, unique=unique)


def first_records(path: Path) -> list[JsonObject]:
    """Return the first records of a file, without unreadable ones, to detect its format.

    An archive has none, though the lines of a file in it may lie there uncompressed.
    """
    records: list[JsonObject] = []
    if unpack_command(path):
        return records
    try:
        for line in islice(lines(path), MAX_HEAD_RECORDS):
            if line.data is None or line.offset > MAX_RECORD_BYTES:
                break
            try:
                records.append(line.record(unique=False))
            except FieldError:
                continue
    except OSError:
        return []
    return records


def unpack_command(path: Path) -> str:
    """Return the command that unpacks an archive, by the end of its name; `""` for others."""
    name = path.name.lower()
    command = next((UNPACK_COMMANDS[end] for end in UNPACK_COMMANDS if name.endswith(end)), "")
    return f"{command} {path.name}" if command else ""


def source_root(source: Source) -> Path:
    """Return the folder from which a source may be read: the source, or the folder of a file."""
    if isinstance(source, Part):
        return source.root
    return source if source.is_dir() else source.parent


def inside(root: Path, name: str, field: str = "image") -> Path:
    """Return the path of a file below `root`.

    Raises:
        FieldError: the path leaves `root`, or is not a file.
    """
    relative = Path(name)
    if relative.is_absolute():
        raise FieldError(
            field, f"{name!r} is an absolute path; give a path inside the source folder"
        )
    path = root / relative
    try:
        below = _is_inside(path, root)
        is_file = path.is_file()
    except FileNotFoundError:
        raise FieldError(field, f"{_missing(root, name)}{_slashes(name)}") from None
    # loops of links, names too long, folders that cannot be entered
    except (OSError, RuntimeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise FieldError(field, f"{name!r} cannot be opened ({reason})") from None
    except ValueError:
        raise FieldError(field, f"{name!r} is not a path") from None
    if not below:
        raise FieldError(field, f"{name!r} leaves the source folder")
    if not is_file:
        raise FieldError(field, f"{name!r} is not a file")
    return path


def image_size(picture: Path | bytes, field: str = "image") -> Size:
    """Return `(height, width)` from the header of a picture, given as a file or as bytes.

    Raises:
        FieldError: it is not a readable picture, or has far too many pixels.
    """
    name = "the picture"
    source: Path | io.BytesIO
    if isinstance(picture, bytes):
        source = io.BytesIO(picture)
    else:
        name = picture.name
        source = picture
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the size is checked when the picture is decoded
            with Image.open(source, formats=FORMATS) as image:
                return image.height, image.width
    except Image.DecompressionBombError:
        raise FieldError(field, f"{name}: far too many pixels") from None
    except _BROKEN as error:
        raise FieldError(
            field, f"{name}: not a readable {'/'.join(FORMATS)} picture ({error})"
        ) from None


def walk(path: Path, *, pictures: bool = False) -> Iterator[Path | tuple[Path, str]]:
    """Yield the files below a folder (or the file itself) in the order of their names.

    A file that is refused is yielded with the reason; refused pictures only with `pictures`, since
    the record that names one is rejected anyway. Refused are links to folders (which may be
    circular), links that leave the source, files that are not regular (reading a pipe or a device
    may never end), names that are not UTF-8, and pickles (which run code when they are read).
    """
    root = source_root(path)
    if path.is_file():
        yield _check_file(path, root)
        return
    walk_errors: list[OSError] = []
    for folder, folders, files in os.walk(path, onerror=walk_errors.append):
        folders[:] = sorted(_folders_to_walk(folder, folders))
        for name in list(folders):
            if not is_utf8(name):
                folders.remove(name)
                yield Path(folder, name), NOT_UTF8
            elif Path(folder, name).is_symlink():
                yield Path(folder, name), "a link to a folder, which is not followed"
        for name in sorted(files):
            item = _check_file(Path(folder, name), root)
            if isinstance(item, Path) or pictures or not is_picture(item[0]):
                yield item
    for error in walk_errors:
        yield Path(os.fspath(error.filename)), f"cannot be entered ({error.strerror})"


def _folders_to_walk(folder: str, folders: list[str]) -> list[str]:
    """Return the folders to walk; in a repository of the Hub's cache, only its snapshots."""
    if Path(folder).name.startswith(CACHED) and {BLOBS, SNAPSHOTS} <= set(folders):
        return [name for name in folders if name not in (BLOBS, REFS)]
    return folders


def is_picture(path: Path) -> bool:
    """Return whether the name of a file is that of a picture."""
    return path.name.lower().endswith(SCREENS)


def _check_file(file: Path, root: Path) -> Path | tuple[Path, str]:
    """Return a file, and the reason why it is not opened, if any."""
    if not is_utf8(file.name):
        return file, NOT_UTF8
    if is_pickle(file):
        return file, PICKLE
    reason = _refusal_reason(file, root)
    return (file, reason) if reason else file


def _refusal_reason(file: Path, root: Path) -> str:
    """Return the reason why a file is not opened, or `""`."""
    try:
        mode = file.lstat().st_mode
        if stat.S_ISLNK(mode):
            if not _is_inside(file, root):
                return "a link that leaves the source folder, which is not followed"
            mode = file.stat().st_mode
    except (OSError, RuntimeError) as error:  # a dangling or circular link
        return f"cannot be opened ({getattr(error, 'strerror', None) or error})"
    if not stat.S_ISREG(mode):
        return "is not a regular file, and reading it might never end"
    return ""


def _is_inside(path: Path, root: Path) -> bool:
    """Return whether a path leads to a file below `root`, or to a blob of the same snapshot.

    Raises:
        OSError, RuntimeError: the path leads nowhere.
    """
    target = path.resolve(strict=True)
    if target.is_relative_to(root.resolve(strict=True)):
        return True
    blobs = _blobs(Path(os.path.abspath(root)))
    return blobs is not None and target.is_relative_to(blobs)


@lru_cache(maxsize=4)
def _blobs(root: Path) -> Path | None:
    """Return the folder of blobs if `root` is in a snapshot of the Hub's cache."""
    for snapshots in (folder for folder in (root, *root.parents) if folder.name == SNAPSHOTS):
        repository = snapshots.parent
        blobs = repository / BLOBS
        cached = repository.name.startswith(CACHED) and snapshots != root
        if cached and blobs.is_dir() and not blobs.is_symlink():
            return blobs.resolve()
    return None


def is_utf8(name: str) -> bool:
    """Return whether the name of a file, as the system gives it, is UTF-8."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


def is_pickle(path: Path) -> bool:
    """Return whether a file, by its name, is a pickle or of a format that may contain one."""
    return path.name.lower().endswith(PICKLES)


def relative_name(path: Path, root: Path) -> str:
    """Return the name of a file in reports: relative to the source, undecodable bytes escaped."""
    name = Path(os.path.relpath(path, root)).as_posix()
    return name.encode(errors="surrogateescape").decode(errors="backslashreplace")


def _slashes(name: str) -> str:
    """Return the fix for a path of Windows; `""` for any other."""
    if "\\" not in name:
        return ""
    return f"; folders are separated by /, so write {name.replace(chr(92), '/')!r}"


def _missing(root: Path, name: str) -> str:
    # The message for a name such as ../../etc/x must not reveal whether that file exists.
    target = Path(os.path.abspath(root / name))
    if target.is_relative_to(os.path.abspath(root)):
        return f"{name!r} is not in the source folder"
    return f"{name!r} leaves the source folder"


def _skip_line(file: Any, data: bytes) -> None:
    while data and not data.endswith(b"\n"):
        data = cast("bytes", file.readline(_CHUNK_BYTES))
