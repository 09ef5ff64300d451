"""Read recordings, with what is rejected apart."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pipelines.readers import Rejected, get_reader
from pipelines.readers.reader_options import ReaderOptions, with_choices


def read_source(path: Path, name: str, **choices: str) -> tuple[list[Any], list[Rejected]]:
    """The trajectories of a source in the format of a name, and what is rejected."""
    reader = get_reader(name)
    if choices:
        reader = with_choices(reader, ReaderOptions(**choices))
    return separate_rejected(reader.read(path))


def separate_rejected(items: Iterable[Any]) -> tuple[list[Any], list[Rejected]]:
    """The trajectories among items, and the rejected ones."""
    trajectories: list[Any] = []
    rejected: list[Rejected] = []
    for item in items:
        (rejected if isinstance(item, Rejected) else trajectories).append(item)
    return trajectories, rejected
