"""Read a dataset, materialised or lazy: rows as dictionaries, in order or by number."""

import hashlib
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from PIL import Image

from hijack_data.types import UInt8Array

from ..errors import DatasetError
from .columns import BASE, pyarrow
from .lazy_rows import decode_column, draw_row, materialised_row, picture_bytes
from .manifest import is_lazy, read_manifest
from .row_reader import RowReader

# Rows read at a time: with pictures, and with a few columns only.
BATCH = 8
LIGHT_BATCH = 1024


class Dataset:
    """A dataset on disk: its rows in the order of the build.

    A row is a dictionary with the columns of `columns.COLUMNS`; `screenshot` is a PIL image in mode
    RGB. `dataset[i]` reads one row group, not the file. It can be pickled and read by several
    processes and threads.
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
        """The identity of the content: the SHA-256 of the hashes of all files, in hexadecimal."""
        hashes = "".join(shard["sha256"] for shard in self.manifest["shards"])
        return hashlib.sha256(hashes.encode()).hexdigest()

    def pixels(self, index: int) -> tuple[dict[str, Any], UInt8Array]:
        """Return row `index` and its screenshot as uint8 RGB `[H, W, 3]`.

        Raises:
            IndexError: there is no such row.
            DatasetError: the row is damaged.
        """
        row = self.reader[index]
        return open_row(row)


def open_dataset(folder: str | os.PathLike[str], split: str | None = None) -> Dataset:
    """Open a dataset that `build` made.

    Args:
        folder: the dataset.
        split: `train`, `validation` or `test`; all rows by default.

    Raises:
        DatasetError: the folder is not a dataset, or an unfinished one, or it has no such split.
    """
    path = Path(folder)
    manifest = read_manifest(path)
    if split is None:
        return Dataset(path, manifest)
    shards = [shard for shard in manifest["shards"] if shard_split(shard) == split]
    if not shards:
        names = ", ".join(_splits(manifest))
        raise DatasetError(f"{path}: has no rows of a split {split!r}; it has {names}")
    return Dataset(path, {**manifest, "shards": shards, "rows": sum(s["rows"] for s in shards)})


def open_split(folder: str | os.PathLike[str], split: str | None) -> Dataset:
    """Open the rows of a dataset that belong together in training: one split, or all if it has one.

    Raises:
        DatasetError: as `open_dataset`; or there are several splits, and none is named.
    """
    dataset = open_dataset(folder, split)
    names = _splits(dataset.manifest)
    if len(names) > 1:
        raise DatasetError(
            f"{dataset.folder}: has the splits {', '.join(names)}, which must not be mixed; name"
            f" one: split={names[0]!r} (--split {names[0]})"
        )
    return dataset


def _splits(manifest: Mapping[str, Any]) -> list[str]:
    return list(dict.fromkeys(map(shard_split, manifest["shards"])))


def shard_split(shard: Mapping[str, Any]) -> str:
    """Return the split of a shard, given its entry in the manifest."""
    return Path(shard["file"]).name.partition("-")[0]


def shard_rows(file: Path, columns: list[str] | None = None) -> Iterator[dict[str, Any]]:
    """Yield the rows of one file as they are stored, pictures as `{"bytes", "path"}`.

    Args:
        file: a shard.
        columns: the columns to read; all of them by default.

    Raises:
        DatasetError: the file cannot be read.
    """
    pa = pyarrow()
    size = BATCH if columns is None else LIGHT_BATCH
    try:
        # With pre-buffering, all row groups would stay in memory until the file is closed.
        with pa.parquet.ParquetFile(file, pre_buffer=False) as parquet:
            for batch in parquet.iter_batches(size, columns=columns):
                yield from batch.to_pylist()
    except (pa.ArrowException, OSError) as error:
        raise DatasetError(f"{file}: cannot be read ({error}); hijack verify says more") from None


def shard_pictures(file: Path) -> Iterator[tuple[dict[str, Any], UInt8Array]]:
    """Yield the rows of one file with their screenshots, uint8 RGB `[H, W, 3]`.

    A picture shared by the rows of a step is decoded once.
    """
    data: bytes | None = None
    base: UInt8Array | None = None
    for row in shard_rows(file):
        if BASE not in row:
            yield open_row(row)
            continue
        stored = picture_bytes(row[BASE])
        if base is None or stored != data:
            data = stored
            base = decode_column(row, BASE)
        yield open_row(row, base)


def open_row(
    row: dict[str, Any], base: UInt8Array | None = None
) -> tuple[dict[str, Any], UInt8Array]:
    """Return a stored row as a materialised one, and its screenshot, uint8 RGB `[H, W, 3]`.

    Args:
        row: as it is stored.
        base: its decoded picture before the corruption, if known.
    """
    if BASE not in row:
        return row, decode_column(row, "screenshot")
    picture, plan = draw_row(row, base)
    return materialised_row(row, None, plan), picture
