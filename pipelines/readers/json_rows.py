"""Tables in JSON, a list in a `.json` file or lines of a `.jsonl` file, and their pictures."""

import os
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from hijack_data.types import Size, Trajectory

from . import fields
from .base import Rejected, files_below
from .fields import FieldError, FieldTypeError, JsonObject
from .recorded_pictures import decode_base64, in_json
from .safe_files import (
    MAX_RECORD_BYTES,
    Source,
    image_size,
    inside,
    lines,
    parse_any,
    refuse_array,
    relative_name,
    source_root,
)

SUFFIXES = (".json", ".jsonl")
# Where recipes keep the pictures, seen from the file, and after that from the source.
FOLDERS = ("", "images", "image")


@dataclass(frozen=True)
class JsonRow:
    """One row and its place.

    Args:
        number: index of the row in the file.
        location: the place in reports, such as `"line 3"`.
        values: values by field, or the error of a broken row.
        offset: where its line begins; `None` in a `.json` file.
        pointer: keys and indices from the file's value to the row.
    """

    number: int
    location: str
    values: JsonObject | FieldError
    offset: int | None = None
    pointer: tuple[str | int, ...] = ()

    @property
    def record(self) -> JsonObject:
        """The values of the row; a broken one raises its `FieldError`."""
        if isinstance(self.values, FieldError):
            raise self.values
        return self.values


def is_json(file: Path) -> bool:
    """Return whether the name of a file is that of a JSON file or of JSON lines."""
    return file.suffix in SUFFIXES


def json_rows(file: Path) -> Iterator[JsonRow]:
    """Yield the rows of a table.

    Raises:
        FieldError: the file is too large; other errors of the whole file are one, too.
    """
    if file.suffix == ".jsonl":
        refuse_array(file)
        for number, line in enumerate(lines(file)):
            try:
                values = line.record()
            except FieldError as error:
                values = error
            yield JsonRow(number, f"line {line.number}", values, line.offset)
        return
    if file.stat().st_size > MAX_RECORD_BYTES:
        limit = MAX_RECORD_BYTES // 2**20
        raise FieldError("", f"larger than {limit} MiB: write it as .jsonl, a row a line")
    data = parse_any(file)
    is_list = isinstance(data, list)
    rows = fields.listed(data) if is_list else [data]
    for number, value in enumerate(rows):
        try:
            values = fields.mapping(value, "")
        except FieldError as error:
            values = error
        pointer = (number,) if is_list else ()
        yield JsonRow(number, f"row {number}", values, None, pointer)


def read_tables(
    path: Source,
    read: Callable[[Path], Iterable[Trajectory | Rejected]],
    left_out: Collection[str] = (),
) -> Iterator[Trajectory | Rejected]:
    """Yield the results of `read` for each JSON file of a source, files by name.

    A file that cannot be read is rejected with the reason, and the others are read.

    Args:
        path: the source.
        read: yields the trajectories of one file, and everything rejected of it.
        left_out: names of files that are not read.
    """
    root = source_root(path)
    for file in files_below(path):
        if isinstance(file, Rejected):
            yield file
            continue
        if not is_json(file) or file.name in left_out:
            continue
        name = relative_name(file, root)
        try:
            inside(root, name, "")
            yield from read(file)
        except FieldError as error:
            yield Rejected(name, "", error.field, error.reason)
        except OSError as error:
            yield Rejected(name, "", "", f"cannot be read ({error.strerror or error})")


def picture_at(
    value: object, file: Path, root: Path, field: str, folders: Iterable[str] = FOLDERS
) -> tuple[str, Size]:
    """Return the path of a picture that a row names, and its (height, width).

    Args:
        value: the path in the row.
        file: the file of the row; paths are seen from its folder, or one above in the source.
        root: the folder of the source.
        field: name of the field in errors.
        folders: folders in which pictures may lie, seen from those.

    Raises:
        FieldError: the picture is on the web, or not there.
        FieldTypeError: `value` is not a path.
    """
    if not isinstance(value, str) or not value:
        raise FieldTypeError(field, "a path", value)
    if value.startswith(("http:", "https:")):
        raise FieldError(field, "is on the web; only files in the folder are read")
    path = _find_picture(value, file.parent, root, field, folders)
    return os.fspath(path), image_size(path, field)


def picture_inside(
    value: str, file: Path, row: JsonRow, pointer: tuple[str | int, ...], field: str
) -> tuple[str, Size]:
    """Return the reference of a `data:` URL at `pointer` in a row, and its (height, width)."""
    reference = in_json(file, row.offset, (*row.pointer, *pointer))
    return reference, image_size(decode_base64(value), field)


def _find_picture(name: str, folder: Path, root: Path, field: str, folders: Iterable[str]) -> Path:
    if not Path(name).is_absolute():
        above = [parent for parent in folder.parents if parent.is_relative_to(root)]
        for start in (folder, *above):
            for beside in folders:
                candidate = os.path.normpath(Path(relative_name(start, root), beside, name))
                try:
                    if (root / candidate).is_file():
                        return inside(root, candidate, field)
                except (OSError, ValueError):
                    break
    return inside(root, name, field)
