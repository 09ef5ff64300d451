"""How readers walk the files of a source, and the base of formats with a folder per episode."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from hijack_data.types import Step, Trajectory

from .base import FileReader, Rejected, files_below
from .fields import FieldError, JsonObject
from .file_head import FileHead
from .safe_files import Source, inside, lines, relative_name, source_root


def folder_id(folder: Path, root: Path) -> str:
    """Return the id of a folder: its path in the source, or its own name if it is the source."""
    name = relative_name(folder, root)
    return folder.resolve().name if name == "." else name


class FolderReader(FileReader, ABC):
    """Base of the readers whose trajectories are folders with one record file each.

    A subclass sets `name` and `records`, the name of the record file, and implements `episode`.
    With `any_name`, a file given as the source is a record file whatever its name. A file with the
    name in `file_names` is of the format; otherwise `recognizes` decides.
    """

    name: str = ""
    records: str = ""
    any_name: bool = False

    def recognizes(self, head: FileHead) -> bool:
        """Return False: only the name tells."""
        return False

    def read(self, path: Source) -> Iterator[Trajectory | Rejected]:
        """Yield trajectories in the order of their paths."""
        root = source_root(path)
        for file in files_below(path):
            if isinstance(file, Rejected):
                yield file
            elif file.name == self.records or (self.any_name and file == path):
                yield from self.episode(file, root)

    @abstractmethod
    def episode(self, file: Path, root: Path) -> Iterator[Trajectory | Rejected]:
        """Yield the trajectory of one record file, and everything rejected of it."""


@dataclass
class EpisodeFolder(ABC):
    """One folder, while its record file is read line by line.

    Args:
        root: the folder of the source.
        file: the record file.
        steps: the steps so far.
    """

    root: Path
    file: Path
    steps: list[Step] = field(default_factory=list[Step], kw_only=True)

    def __post_init__(self) -> None:
        self.folder = self.file.parent
        self.records = relative_name(self.file, self.root)

    @abstractmethod
    def take(self, record: JsonObject) -> None:
        """Add the step of one line.

        Raises:
            FieldError: the line is broken or has no screen.
        """

    def take_lines(self) -> Iterator[Rejected]:
        """Add the steps of all lines, and yield the lines that are broken.

        Raises:
            OSError: the file cannot be read.
        """
        for line in lines(self.file):
            try:
                self.take(line.record())
            except FieldError as error:
                yield Rejected(self.records, f"line {line.number}", error.field, error.reason)

    def inside(self, name: str, field: str) -> Path:
        """Return the path of a file in this folder.

        Raises:
            FieldError: the file leaves the source, or is not there.
        """
        return inside(self.root, relative_name(self.folder / name, self.root), field)

    def unreadable(self, error: OSError) -> Rejected:
        """Return the rejection of a record file that cannot be read."""
        return Rejected(self.records, "", "", f"cannot be read ({error.strerror or error})")
