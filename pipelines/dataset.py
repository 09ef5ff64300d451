"""Read a dataset: rows as dictionaries, in order or by number, alike whether pictures or plans are stored."""

import hashlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from PIL import Image

from hijack_data.types import UInt8Array

from .access import RowReader
from .columns import BASE, pyarrow
from .errors import DatasetError
from .lazy import decoded, draw, finished, picture_bytes
from .manifest import is_lazy, read_manifest

BATCH = 8


class Dataset:
    """A dataset on disk. Iterating yields rows in the order of the build; `len` is the number of rows.

    A row is a dictionary with the columns of `columns.COLUMNS`; `screenshot` is a PIL image in mode RGB. `dataset[i]`
    reads one row group, not the file. It can be pickled and read by several processes and threads.
    """

    def __init__(self, folder: Path, manifest: dict[str, Any]) -> None:
        self.folder = folder
        self.manifest = manifest
        self.reader = RowReader(folder, manifest["shards"], is_lazy(manifest))

    def __len__(self) -> int:
        return int(self.manifest["rows"])

    def __getitem__(self, index: int) -> dict[str, Any]:
        row, picture = self.pixels(index)
        return {**row, "screenshot": Image.fromarray(picture)}

    def __iter__(self) -> Iterator[dict[str, Any]]:
        for shard in self.manifest["shards"]:
            for row, picture in shard_pictures(self.folder / shard["file"]):
                yield {**row, "screenshot": Image.fromarray(picture)}

    @property
    def fingerprint(self) -> str:
        """64 hexadecimal digits that name the content: the SHA-256 of the hashes of all files."""
        return hashlib.sha256("".join(shard["sha256"] for shard in self.manifest["shards"]).encode()).hexdigest()

    def pixels(self, index: int) -> tuple[dict[str, Any], UInt8Array]:
        """Return row `index` and its screenshot as uint8 RGB `[H, W, 3]`. Raises `IndexError` and `DatasetError`."""
        return opened(self.reader[index])


def open_dataset(folder: str | os.PathLike[str]) -> Dataset:
    """Open a dataset that `build` made. Raises `DatasetError` when it is none, or is not finished."""
    path = Path(folder)
    return Dataset(path, read_manifest(path))


def shard_rows(file: Path, columns: list[str] | None = None) -> Iterator[dict[str, Any]]:
    """Yield the rows of one file as they are stored, pictures as `{"bytes", "path"}`. Raises `DatasetError`."""
    pa = pyarrow()
    try:
        # Buffered before, all that was read would stay in memory until the file is closed.
        with pa.parquet.ParquetFile(file, pre_buffer=False) as parquet:
            for batch in parquet.iter_batches(BATCH if columns is None else 1024, columns=columns):
                yield from batch.to_pylist()
    except (pa.ArrowException, OSError) as error:
        raise DatasetError(f"{file}: cannot be read ({error}); hijack verify says more") from None


def shard_pictures(file: Path) -> Iterator[tuple[dict[str, Any], UInt8Array]]:
    """Yield the rows of one file with their screenshots; what rows of a step share is decoded once."""
    known: tuple[bytes, UInt8Array] | None = None
    for row in shard_rows(file):
        if BASE not in row:
            yield opened(row)
            continue
        data = picture_bytes(row[BASE])
        if known is None or known[0] != data:
            known = data, decoded(row, BASE)
        yield opened(row, known[1])


def opened(row: dict[str, Any], base: UInt8Array | None = None) -> tuple[dict[str, Any], UInt8Array]:
    """Return a stored row as one of the contract, and its screenshot; `base` is its decoded base, if known."""
    if BASE not in row:
        return row, decoded(row, "screenshot")
    picture, plan = draw(row, base)
    return finished(row, None, plan), picture
