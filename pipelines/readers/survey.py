"""Find the reader of each file of a source, and the files without a reader."""

import os
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from hijack_data.types import Trajectory

from ..errors import SourceError
from .base import FileReader, Reader, Rejected, check_path, files_below, get_reader, names
from .file_head import FileHead
from .not_recordings import explanation
from .reader_options import NO_CHOICES, ReaderOptions, with_choices
from .safe_files import (
    MAX_HEAD_RECORDS,
    SCREENS,
    UNPACK_COMMANDS,
    FieldError,
    Part,
    Source,
    json_lines_advice,
    refuse_array,
    relative_name,
    source_root,
    unpack_command,
)

# Files that never hold records of a known format and may be large, so no reader examines them.
OPAQUE = (*SCREENS, ".mp4", ".webm", ".mkv", ".mov", ".avi", ".html", ".pdf", ".log", ".md")
# Files that may hold records; the report names those without a reader.
TABLES = (
    ".json",
    ".jsonl",
    ".ndjson",
    ".parquet",
    ".arrow",
    ".csv",
    ".tsv",
    ".tfrecord",
    *(f".{end.rpartition('.')[2]}" for end in UNPACK_COMMANDS),
    ".eval",
    ".lance",
    ".db",
    ".sqlite",
    ".h5",
    ".hdf5",
)
WAY_OUT = (
    "write it in the plain format (docs/input_format.md), or take the pictures alone: --format"
    " images (in Python: format='images')"
)


@dataclass
class Survey:
    """The files of one source by format.

    Args:
        root: its folder.
        parts: the files of each format, by its name, in the order of the names.
        refused: files that are not opened, with the reason.
        unread: files that may hold records and are of no known format, relative to `root`.
    """

    root: Path
    parts: dict[str, Source] = field(default_factory=dict[str, Source])
    refused: list[Rejected] = field(default_factory=list[Rejected])
    unread: list[str] = field(default_factory=list[str])

    def read(self, choices: ReaderOptions = NO_CHOICES) -> Iterator[Trajectory | Rejected]:
        """Yield the files that are not opened, then the trajectories of each format.

        Each reader uses those of the choices that its format leaves open.
        """
        yield from self.refused
        for name, part in self.parts.items():
            reader = get_reader(name)
            yield from with_choices(reader, choices.of(reader)).read(part)


def survey(path: str | os.PathLike[str], format: str | None = None) -> Survey:
    """Find the reader of each file of a source; with `format`, that one reads them all.

    Raises:
        SourceError: the source is empty, no file is of a known format, or a file could be of
            several formats, which the message names.
    """
    source = check_path(path)
    root = source_root(source)
    if format is not None:
        return Survey(root, {get_reader(format).name: source})
    files_by_format: dict[str, list[Path]] = {}
    unmatched: list[Path] = []
    result = Survey(root)
    readers = list(_readers(fallback=False))
    for item in files_below(source):
        if isinstance(item, Rejected):
            result.refused.append(item)
            continue
        if source.is_dir() and item.suffix.lower() in OPAQUE:
            continue
        name = _detect_file_format(item, root, readers)
        if name:
            files_by_format.setdefault(name, []).append(item)
        else:
            unmatched.append(item)
    if not files_by_format:
        result.parts = _fallback(source, root, unmatched, result.refused)
        return result
    unread = _adopted(files_by_format, unmatched)
    result.parts = {name: _part(root, files_by_format[name]) for name in sorted(files_by_format)}
    result.unread = [
        relative_name(file, root) for file in unread if _may_hold_records(file, files_by_format)
    ]
    return result


def _part(root: Path, files: list[Path]) -> Part:
    """Return files in the order in which a folder is walked: its files, then its folders."""

    def walk_key(file: Path) -> list[tuple[bool, str]]:
        *folders, name = file.relative_to(root).parts
        key = [(True, folder) for folder in folders]
        key.append((False, name))
        return key

    return Part(root, tuple(sorted(files, key=walk_key)))


def detect_format(path: str | os.PathLike[str]) -> str:
    """Return the name of the one format of a file or folder.

    Raises:
        SourceError: there is no such file, or it is of no known format, or of several.
    """
    formats = list(survey(path).parts)
    if len(formats) > 1:
        alternatives = " or ".join(formats)
        raise SourceError(f"{path}: could be of format {alternatives}: {_say_which(formats)}")
    return formats[0]


def _detect_file_format(file: Path, root: Path, readers: list[Reader]) -> str:
    """Return the format of one file, or `""`: its name decides, or else its first records.

    Only readers that declare its suffix and its keys, or nothing, are asked about the file.

    Raises:
        SourceError: it could be of several.
    """
    head = FileHead(file)
    for reader in readers:
        if isinstance(reader, FileReader) and head.is_named(reader.file_names):
            return reader.name
    formats = [reader.name for reader in readers if _accepts(reader, head)]
    if len(formats) > 1:
        alternatives = " or ".join(formats)
        raise SourceError(
            f"{relative_name(file, root)}: could be of format {alternatives};"
            f" {_say_which(formats)}; {_known_formats()}"
        )
    return formats[0] if formats else ""


def _accepts(reader: Reader, head: FileHead) -> bool:
    if isinstance(reader, FileReader):
        return reader.may_hold(head) and reader.recognizes(head)
    return reader.detect(head.path)


def _readers(*, fallback: bool) -> Iterator[Reader]:
    """Yield the readers of single files, or those that are only asked about a whole source."""
    for name in names():
        reader = get_reader(name)
        if getattr(reader, "fallback", False) == fallback:
            yield reader


def _known_formats() -> str:
    return f"known formats: {', '.join(names())}"


def _say_which(formats: list[str]) -> str:
    return f"say which: --format {formats[0]} (in Python: format={formats[0]!r})"


def _fallback(
    source: Path, root: Path, unmatched: list[Path], refused: list[Rejected]
) -> dict[str, Source]:
    """Return the reader that takes the source as a whole.

    Raises:
        SourceError: no reader does.
    """
    for reader in _readers(fallback=True):
        if reader.detect(source):
            return {reader.name: source}
    for reader in _readers(fallback=False):
        refusal = getattr(reader, "refusal", None)
        if refusal is not None and (reason := refusal(source)):
            raise SourceError(f"{source}: {reason}")
    if _is_empty(source):
        raise SourceError(f"{source}: is empty; {_known_formats()}")
    for file in unmatched[:MAX_HEAD_RECORDS]:
        if reason := explanation(FileHead(file)):
            raise SourceError(f"{relative_name(file, root)}: is {reason} (docs/sources.md)")
    examples = ", ".join(_examples(root, unmatched, refused))
    looked = f" ({examples})" if examples else ""
    raise SourceError(
        f"{source}: is not a recording of a known format{looked}; {_known_formats()}; {WAY_OUT}"
    )


def _is_empty(source: Path) -> bool:
    if source.is_dir():
        return not any(source.iterdir())
    return source.stat().st_size == 0


def _examples(root: Path, unmatched: list[Path], refused: list[Rejected]) -> Iterator[str]:
    """Yield an example of the files without a reader, and one of those that are not opened."""
    records = [file for file in unmatched if file.suffix.lower() in TABLES]
    if records:
        advice = advise(records[0])
        yield f"{relative_name(records[0], root)} is of none{f': {advice}' if advice else ''}"
    if len(records) > 1:
        yield f"and {len(records) - 1} more"
    if refused:
        yield str(refused[0])
    if len(refused) > 1:
        yield f"{len(refused) - 1} more not opened"


def _adopted(files_by_format: Mapping[str, list[Path]], unmatched: list[Path]) -> list[Path]:
    """Assign files without a reader to the reader of their neighbours; return the others."""
    near: defaultdict[object, set[str]] = defaultdict(set)
    for name, files in files_by_format.items():
        if not getattr(get_reader(name), "adopts", False):
            continue
        for file in files:
            near[file.parent, file.suffix].add(name)
            near[file.name].add(name)
    unread: list[Path] = []
    for file in unmatched:
        formats = near[file.name] | near[file.parent, file.suffix]
        if len(formats) == 1 and not _is_beside(file, files_by_format):
            (name,) = formats
            files_by_format[name].append(file)
        else:
            unread.append(file)
    return unread


def _may_hold_records(file: Path, files_by_format: Mapping[str, list[Path]]) -> bool:
    return file.suffix.lower() in TABLES and not _is_beside(file, files_by_format)


def _is_beside(file: Path, files_by_format: Mapping[str, list[Path]]) -> bool:
    """Return whether a reader of this source reads the file beside its records."""
    for name in files_by_format:
        beside = getattr(get_reader(name), "beside", None)
        if beside is not None and beside(file):
            return True
    return False


def advise(file: Path) -> str:
    """Return how to make a file that no reader takes readable; `""` if that is not known."""
    command = unpack_command(file)
    if command:
        return f"an archive, unpack it first: {command}"
    if file.name == "trajectories.json":
        return f"the plain format is trajectories.jsonl; {json_lines_advice(file)}"
    if file.suffix.lower() not in (".jsonl", ".ndjson"):
        return ""
    try:
        refuse_array(file)
    except FieldError as error:
        return error.reason
    except OSError:
        return ""
    return ""


def summary(names: list[str], limit: int = 3) -> str:
    """Return some names and how many more there are, with the kinds of files."""
    kinds = Counter(Path(name).suffix or "no suffix" for name in names)
    counts = ", ".join(f"{count} {kind}" for kind, count in kinds.most_common(4))
    first = ", ".join(names[:limit])
    if len(names) > limit:
        first += f" and {len(names) - limit} more"
    return f"{first} ({counts})"
