"""Rows of a dataset by number, without reading whole files.

The index is the manifest and the footers of the files.
"""

import os
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from threading import Lock
from typing import Any

from hijack_data.cache import Cache

from ..errors import DatasetError
from .columns import BASE, pyarrow

# How many files stay open, and how many row groups stay in memory.
OPEN_FILES = 32
GROUPS = 4


@dataclass(frozen=True)
class _OpenFile:
    """A Parquet file, and the number of rows up to the end of each of its row groups."""

    parquet: Any
    ends: list[int]


class RowReader:
    """Stored rows by number. Reading a row reads its row group; the last few groups are cached.

    It can be pickled, used after a fork and shared among threads; each process opens its own files.

    Args:
        folder: the dataset.
        shards: the `shards` of its manifest.
        lazy: whether rows hold the picture before the corruption, which is then cached once for all
            rows that share it.
        columns: the columns to read; all of them by default.
    """

    def __init__(
        self,
        folder: Path,
        shards: Sequence[Mapping[str, Any]],
        lazy: bool = False,
        *,
        columns: Sequence[str] | None = None,
    ) -> None:
        self.lazy = lazy
        self.columns = None if columns is None else list(columns)
        self.files = [folder / shard["file"] for shard in shards]
        self.ends = list(accumulate(int(shard["rows"]) for shard in shards))
        self._reset()

    def __len__(self) -> int:
        return self.ends[-1] if self.ends else 0

    def __getitem__(self, index: int) -> dict[str, Any]:
        """Return one row as stored.

        Raises:
            IndexError: there is no such row.
            DatasetError: its file cannot be read.
        """
        at = index + len(self) if index < 0 else index
        if not 0 <= at < len(self):
            raise IndexError(f"row {index} of a dataset with {len(self)} rows")
        # a forked worker must not wait for a lock that another thread held at the fork
        if self._process != os.getpid():
            self._reset()
        file = bisect_right(self.ends, at)
        offset = at - _start(self.ends, file)
        try:
            with self._lock:
                table, row = self._group(file, offset)
        except (pyarrow().ArrowException, OSError) as error:
            raise DatasetError(
                f"{self.files[file]}: cannot be read ({error}); hijack verify says more"
            ) from None
        return table.slice(row, 1).to_pylist()[0]

    def __getstate__(self) -> dict[str, Any]:
        return {"files": self.files, "ends": self.ends, "lazy": self.lazy, "columns": self.columns}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._reset()

    def _reset(self) -> None:
        self._process = os.getpid()
        self._lock = Lock()
        # bounded by their number: every entry counts as one byte
        self._open = Cache(OPEN_FILES)
        self._groups = Cache(GROUPS)

    def _group(self, file: int, offset: int) -> tuple[Any, int]:
        # returns the row group of a row, and the index of the row in that group
        open_file = self._file(file)
        group = bisect_right(open_file.ends, offset)
        if group == len(open_file.ends):
            raise DatasetError(
                f"{self.files[file]}: holds fewer rows than the manifest says; hijack verify says"
                " more"
            )
        table = self._groups.get((file, group))
        if table is None:
            table = open_file.parquet.read_row_group(group, self.columns, use_threads=False)
            self._groups.put((file, group), table, 1)
        return table, offset - _start(open_file.ends, group)

    def _file(self, file: int) -> _OpenFile:
        """Return an open file; one that leaves the cache is closed with its last reference."""
        open_file = self._open.get(file)
        if open_file is None:
            shared = [f"{BASE}.bytes"] if self.lazy else None
            parquet = pyarrow().parquet.ParquetFile(self.files[file], read_dictionary=shared)
            meta = parquet.metadata
            rows = (meta.row_group(k).num_rows for k in range(meta.num_row_groups))
            open_file = _OpenFile(parquet, list(accumulate(rows)))
            self._open.put(file, open_file, 1)
        return open_file


def _start(ends: list[int], index: int) -> int:
    return ends[index - 1] if index else 0
