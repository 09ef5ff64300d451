"""What a reader is, and how the reader of a source is found."""

import os
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar

from hijack_data.loading import find_source
from hijack_data.registry import Registry, is_ours
from hijack_data.types import Trajectory

from ..errors import SourceError
from .file_head import FileHead
from .safe_files import Part, Source, is_utf8, relative_name, source_root, walk


@dataclass(frozen=True)
class Rejected:
    """An input that was left out.

    Args:
        file: the file it is in, relative to the source.
        where: the place in the file, such as `"line 12"` or `"task_7, step 3"`.
        field: the field at fault, such as `"action.x"`; `""` when it is the whole record.
        reason: what is wrong and what was expected.
    """

    file: str
    where: str
    field: str
    reason: str

    def to_data(self) -> dict[str, str]:
        """JSON data of the record."""
        return asdict(self)

    def __str__(self) -> str:
        return ": ".join(part for part in (self.file, self.where, self.field, self.reason) if part)


class Reader(Protocol):
    """Reads one format of recordings.

    `read` streams: it never holds more than one trajectory. Broken input comes out as `Rejected`,
    and reading continues. Coordinates of what it yields are pixels of the screenshot; its docstring
    names the space that the recording uses. Pictures that do not show a desktop come in a
    `RecordedTrajectory`, which names what they show.

    A folder may hold several formats. Every record file is passed to `detect` by itself, and `read`
    gets a `Part` of the files that it accepted: `source_root` and `files_below` take a `Part` as they
    take a folder. A reader may also have

    - what `FileReader` declares (`file_names`, `suffixes`, `keys`, `recognizes`), which spares it
      the reading in `detect`: a file's beginning is then read once for all readers;
    - `adopts = True`: a file that no format takes goes to this reader if its neighbour does (same
      folder and suffix, or same name), and this reader rejects it with a reason;
    - `beside(file) -> bool`: whether it reads this file in addition to its own records;
    - `fallback = True`: it is asked about a whole source, and only if no reader takes a file;
    - `refusal(source) -> str`: why it cannot read a source that is of its format but lacks a part,
      and what to do; `""` for any other source. It is asked only if no reader takes the source.
    """

    name: str

    def detect(self, path: Path) -> bool:
        """Return whether `path` (a file or folder) is of this format, from its beginning alone."""
        ...

    def read(self, path: Source, /) -> Iterator[Trajectory | Rejected]:
        """Yield the trajectories of `path` in a fixed order."""
        ...


class FileReader:
    """Base of readers that are recognized by a file's name, or else by its first records.

    A file whose name is in `file_names` is of the format and is not opened to find that out. Any
    other file is if its suffix is in `suffixes` and `recognizes` returns true: that a record has
    all `keys` of one set, unless the reader overrides it. Without `keys`, the suffix decides.
    """

    file_names: tuple[str, ...] = ()
    suffixes: tuple[str, ...] = (".json", ".jsonl")
    keys: tuple[frozenset[str], ...] = ()

    def recognizes(self, head: FileHead) -> bool:
        """Return whether a file with one of the `suffixes` is of this format."""
        return not self.keys or any(keys <= found for keys in self.keys for found in head.keys)

    def accepts(self, head: FileHead) -> bool:
        """Return whether a file is of this format, if its name does not decide."""
        return head.path.suffix in self.suffixes and self.recognizes(head)

    def detect(self, path: Path) -> bool:
        """Return whether a file, or one in a folder, is of this format."""
        return any(
            file.name in self.file_names or self.accepts(FileHead(file))
            for file in files_below(path)
            if isinstance(file, Path)
        )


class DocumentReader(FileReader, ABC):
    """Base of readers of JSON documents, each of which is read by itself."""

    suffixes = (".json",)

    def beside(self, file: Path) -> bool:
        """Return whether a file only goes with the documents."""
        return False

    def read(self, path: Source) -> Iterator[Trajectory | Rejected]:
        """Yield trajectories in the order of the files."""
        root = source_root(path)
        for file in files_below(path):
            if isinstance(file, Rejected):
                yield file
            elif file.suffix in self.suffixes and not self.beside(file):
                yield from self.document(file, root)

    @abstractmethod
    def document(self, file: Path, root: Path) -> Iterator[Trajectory | Rejected]:
        """Yield the trajectories of one document below the folder `root`."""


R = TypeVar("R", bound=Reader)


def _problems(cls: Any, name: str) -> Iterator[str]:
    """Yield what is wrong with the class of a reader."""
    if not isinstance(cls, type):
        yield "it is not a class"
        return
    if not name:
        yield "name is not set"
    for method, arguments in (("detect", "path"), ("read", "source")):
        if not callable(getattr(cls, method, None)):
            yield f"it has no {method}({arguments})"


READERS = Registry[Reader](
    "format",
    "readers",
    package="pipelines.readers",
    own_name="name",
    problems=_problems,
    prepare=lambda cls: cls(),
)


def register(cls: type[R]) -> type[R]:
    """Class decorator: make a reader known under its `name`.

    Raises `ParameterError` if it lacks a method or a name, or the name is taken.
    """
    READERS.add(cls)
    return cls


def names() -> list[str]:
    """Names of all formats that can be read."""
    return sorted(READERS.names())


def get_reader(name: str) -> Reader:
    """Return the reader of a format.

    Raises `UnknownNameError` with the nearest name, `PluginError` if the file, module or plug-in
    cannot be loaded, and `ParameterError` if it does not hold a reader, or its name is taken.

    Args:
        name: of a format, or `package.module:Reader`, or `path/to/file.py:Reader`.
    """
    return READERS.get(READERS.find(name))


def reader_source(name: str) -> dict[str, str]:
    """Return what names the file of a reader that is not ours, as parameters of a build."""
    reader = get_reader(name)
    source = None if is_ours(reader) else find_source(type(reader))
    return {} if source is None else {"format_sha256": source["sha256"]}


def files_below(source: Source) -> Iterator[Path | Rejected]:
    """Yield the files of a source in the order of their names, and what is not opened, with why.

    Of a `Part`, only its files are yielded: whoever made it has reported the others.
    """
    if isinstance(source, Part):
        yield from source.files
        return
    root = source_root(source)
    for item in walk(source):
        if isinstance(item, Path):
            yield item
        else:
            yield Rejected(relative_name(item[0], root), "", "", item[1])


def check_path(path: str | os.PathLike[str]) -> Path:
    """Return `path` if it is a file or folder that exists.

    Raises:
        SourceError: it does not exist, or its name is not UTF-8.
    """
    try:
        source = Path(path)
        there = source.is_file() or source.is_dir()
    except (OSError, ValueError):
        there = False
        source = Path()
    if not there:
        raise SourceError(
            f"{os.fspath(path)!r}: no such file or folder; give a recording (formats:"
            f" {', '.join(names())})"
        )
    if not is_utf8(os.path.abspath(source)):
        raise SourceError(f"{os.fspath(path)!r}: this name is not UTF-8; rename it")
    return source
