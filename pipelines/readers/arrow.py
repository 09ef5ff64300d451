"""Arrow files, as `datasets` writes them in `save_to_disk`, in the form of a `ParquetFile`."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ..dataset.columns import pyarrow

SUFFIX = ".arrow"
_FILE_MAGIC = b"ARROW1"  # the random access form; `datasets` writes the streaming form


class ArrowTable:
    """An Arrow file; each record batch stands for a row group.

    Args:
        file: the file, which is mapped into memory, not loaded.

    Raises:
        ArrowInvalid: it is not an Arrow file. Other errors of Arrow and `OSError` are passed on.
    """

    def __init__(self, file: Path) -> None:
        pa = pyarrow()
        with file.open("rb") as stream:
            is_file = stream.read(len(_FILE_MAGIC)) == _FILE_MAGIC
        self._map = pa.memory_map(os.fspath(file))
        if is_file:
            reader = pa.ipc.open_file(self._map)
            self._batches = [reader.get_batch(i) for i in range(reader.num_record_batches)]
        else:
            reader = pa.ipc.open_stream(self._map)
            self._batches = list(reader)
        self.schema_arrow = reader.schema

    @property
    def num_row_groups(self) -> int:
        """The number of record batches."""
        return len(self._batches)

    def iter_batches(self, *, row_groups: list[int], columns: list[str], **_: Any) -> Iterator[Any]:
        """Yield the rows of record batches, each as a batch of its own.

        A row is checked before it is handed out: Arrow trusts the offsets in a file, and those of a
        damaged one lead out of it.
        """
        for group in row_groups:
            batch = self._batches[group].select(columns)
            for index in range(batch.num_rows):
                row = batch.slice(index, 1)
                row.validate(full=True)
                yield row

    def close(self) -> None:
        """Close the file."""
        self._batches = []
        self._map.close()
