"""Screenshots inside another file: a Parquet column, or base64 text in a log.

`Step.image` is then not a path but a reference, made by `in_parquet` or `in_json`; `read_picture`
reads both kinds. A reference starts with a NUL, which no path can contain, so a file name can never
be mistaken for one.
"""

import base64
import binascii
import json
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from hijack_data.errors import ImageError

from ..dataset.columns import pyarrow
from .arrow import SUFFIX as ARROW
from .arrow import ArrowTable
from .fields import FieldError, mapping
from .safe_files import MAX_RECORD_BYTES, line_at, parse, parse_any, relative_name

_MARK = "\0inside:"
_WHOLE_FILE = -1
_CHANGED = "is no longer there: the file has changed since it was read"


def in_parquet(file: Path, group: int, row: int, column: str, item: int | None = None) -> str:
    """Return the reference of a picture in a Parquet file.

    Args:
        file: the file.
        group: index of the row group.
        row: index of the row in its group.
        column: name of the column.
        item: index of the picture, if the column is a list.
    """
    return _MARK + json.dumps({"file": os.fspath(file), "parquet": [group, row, column, item]})


def in_json(file: Path, offset: int | None, pointer: tuple[str | int, ...]) -> str:
    """Return the reference of base64 text in a JSON file.

    Args:
        file: the file.
        offset: where its line begins; `None` for a file that is one JSON value.
        pointer: keys and indices from that value to the text.
    """
    start = _WHOLE_FILE if offset is None else offset
    return _MARK + json.dumps({"file": os.fspath(file), "json": [start, *pointer]})


def read_picture(image: str, name: str) -> bytes:
    """Return the bytes of a picture file, given its path or a reference.

    They are decoded by `images.decode`, which refuses a picture that its EXIF orientation turns.

    Args:
        image: the path or reference.
        name: name of the picture in errors.

    Raises:
        ImageError: the picture cannot be read.
    """
    try:
        if not image.startswith(_MARK):
            return Path(image).read_bytes()
        location = json.loads(image.removeprefix(_MARK))
        if "json" in location:
            offset, *pointer = location["json"]
            return decode_base64(_at(_record(location["file"], offset), pointer))
        return as_bytes(_parquet_value(location["file"], *location["parquet"]))
    except FieldError as error:
        raise ImageError(f"{name}: {error}") from None
    except OSError as error:
        raise ImageError(f"{name}: cannot be read ({error.strerror or error})") from None
    except ValueError as error:  # a NUL, or half a surrogate
        raise ImageError(f"{name}: is not the path of a picture ({error})") from None


def picture_name(image: str, root: Path) -> str:
    """Return a picture's name in reports: relative to the source, with its place in the file."""
    location = _parse_reference(image)
    name = relative_name(picture_file(image), root)
    if "parquet" in location:
        group, row, column, item = location["parquet"]
        index = "" if item is None else f"[{item}]"
        return f"{name}: row group {group}, row {row}, {column}{index}"
    if "json" in location:
        offset, *pointer = location["json"]
        line = "" if offset == _WHOLE_FILE else f" at byte {offset}"
        return f"{name}{line}: {'.'.join(map(str, pointer))}"
    return name


def picture_file(image: str) -> Path:
    """Return the file that holds a picture."""
    return Path(_parse_reference(image).get("file", image))


def decode_base64(value: object) -> bytes:
    """Decode base64 text, with or without `data:image/...;base64,` before it.

    Raises:
        FieldError: the value is not base64 text, or is empty.
    """
    if not isinstance(value, str):
        raise FieldError("image", "is not base64 text")
    text = value
    if value.startswith("data:"):
        _, _, text = value.partition(";base64,")
    try:
        data = base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError) as error:
        raise FieldError("image", f"is not base64 ({error})") from None
    if not data:
        raise FieldError("image", "is empty")
    return data


def as_bytes(value: object) -> bytes:
    """Return the bytes of a Parquet picture: bytes, or a struct with `bytes`.

    Raises:
        FieldError: there are none.
    """
    data = value
    if isinstance(value, dict):
        data = cast("dict[str, object]", value).get("bytes")
    if not isinstance(data, bytes) or not data:
        raise FieldError("image", "holds no bytes")
    return data


def _parse_reference(image: str) -> dict[str, Any]:
    if not image.startswith(_MARK):
        return {}
    return json.loads(image.removeprefix(_MARK))


def _at(record: object, pointer: list[str | int]) -> object:
    for key in pointer:
        try:
            record = cast("Any", record)[key]
        except (KeyError, IndexError, TypeError):
            raise FieldError("image", _CHANGED) from None
    return record


def _stamp(file: str) -> tuple[Any, ...]:
    stat = os.stat(file)
    # a forked process opens its own
    return os.getpid(), file, stat.st_mtime_ns, stat.st_size, stat.st_ino


@dataclass
class _LastRead:
    """The record or column read last.

    This suffices because pictures are read in order, and a record may contain hundreds.
    """

    key: tuple[Any, ...] = ()
    value: Any = None

    def clear(self) -> None:
        """Drop the value, before the next one is read or if that fails."""
        self.key = ()
        self.value = None


_last_record = _LastRead()
_last_column = _LastRead()


def _record(file: str, offset: int) -> object:
    key = (*_stamp(file), offset)
    last = _last_record
    if last.key != key:
        last.clear()
        is_whole = offset == _WHOLE_FILE
        last.value = parse_any(Path(file)) if is_whole else _line(file, offset)
        last.key = key
    return last.value


def _line(file: str, offset: int) -> object:
    with open(file, "rb") as lines:
        data = line_at(lines, offset)
    if len(data) > MAX_RECORD_BYTES:
        raise FieldError("", f"longer than {MAX_RECORD_BYTES // 2**20} MiB")
    return mapping(parse(data), "")


@dataclass
class _Column:
    """One column of a row group, read forwards; only one row is in memory at a time."""

    file: str
    group: int
    name: str
    row: int = -1
    value: Any = None
    rows: Iterator[Any] = field(init=False)

    def __post_init__(self) -> None:
        self.rows = GroupRows(open_parquet(Path(self.file)), self.group, [self.name])

    def at(self, row: int) -> object:
        """Return the value of a row; row numbers must not decrease from call to call.

        Raises:
            FieldError: the file has changed, or the row is damaged.
        """
        while self.row < row:
            row_value: Any = next(self.rows, None)
            if row_value is None:
                raise FieldError("image", _CHANGED)
            self.row += 1
            self.value = row_value
        if isinstance(self.value, FieldError):
            raise self.value
        return self.value[self.name]


def _parquet_value(file: str, group: int, row: int, column: str, item: int | None) -> object:
    key = (*_stamp(file), group, column)
    last = _last_column
    if last.key != key or last.value.row > row:
        last.clear()
        last.value = _Column(file, group, column)
        last.key = key
    value = last.value.at(row)
    return value if item is None else _at(value, [item])


def open_parquet(file: Path) -> Any:
    """Open a Parquet file, or an Arrow file, for reading in small pieces.

    Raises:
        FieldError: it is not a readable Parquet or Arrow file.
    """
    pa = pyarrow()
    try:
        if file.suffix == ARROW:
            return ArrowTable(file)
        return pa.parquet.ParquetFile(os.fspath(file), pre_buffer=False, buffer_size=1 << 16)
    except (pa.ArrowException, OSError, ValueError) as error:
        kind = "Arrow" if file.suffix == ARROW else "Parquet"
        raise FieldError("", f"not a readable {kind} file ({_first_line(error)})") from None


class GroupRows:
    """Iterates over the rows of a row group as dicts, with one in memory at a time.

    A row that cannot be read is a `FieldError`.

    Args:
        parquet: the open file.
        group: index of the row group.
        columns: the columns to read.
    """

    def __init__(self, parquet: Any, group: int, columns: list[str]) -> None:
        self._errors = (pyarrow().ArrowException, OSError)
        self._group = group
        self._batches = parquet.iter_batches(
            batch_size=1, row_groups=[group], columns=columns, use_threads=False
        )

    def __iter__(self) -> Iterator[dict[str, Any] | FieldError]:
        return self

    def __next__(self) -> dict[str, Any] | FieldError:
        try:
            batch = next(self._batches)
        except self._errors as error:  # after an error, Arrow's iterator has ended
            return FieldError("", f"row group {self._group} is damaged ({_first_line(error)})")
        try:
            return batch.to_pylist()[0]
        # text that is not UTF-8, times that Python cannot hold
        except (ValueError, OverflowError) as error:
            return FieldError("", f"cannot be read ({_first_line(error)})")


def _first_line(error: BaseException) -> str:
    text = str(error)
    if not text:
        return type(error).__name__
    return text.splitlines()[0][:200]
