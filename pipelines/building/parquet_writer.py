"""Write rows as Parquet; the same rows give the same bytes."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from ..dataset.columns import BASE, PICTURES, REPEATED, parquet_paths, pyarrow, schema

# Readers keep one row group in memory, and read a whole group for a single row.
GROUP_ROWS = 16
GROUP_BYTES = 128 * 2**20
# A lazy dataset stores each picture once in a row group, as an entry of Parquet's dictionary,
# however large it is.
DICTIONARY_BYTES = 2**30


def write_parquet(path: Path, rows: Iterable[Mapping[str, Any]], lazy: bool = False) -> int:
    """Write rows to a Parquet file and return their number; one row group is in memory at a time.

    Args:
        path: the file to write.
        rows: values by column.
        lazy: whether rows hold the picture before the corruption, which several rows share.
    """
    pa = pyarrow()
    count = 0
    columns = schema(lazy)
    groups = _steps(rows) if lazy else _groups(rows)
    with pa.parquet.ParquetWriter(path, columns, **_layout(lazy)) as writer:
        for group in groups:
            table = pa.Table.from_pylist(group, schema=columns)
            writer.write_table(table, row_group_size=len(group))
            count += len(group)
    return count


def _layout(lazy: bool) -> dict[str, Any]:
    names = parquet_paths(lazy)
    plain = [name for name in names if name not in (*PICTURES, *REPEATED)]
    packed = dict.fromkeys(names, "snappy")
    packed |= {name: "none" for name in PICTURES if name in packed}
    packed |= {name: "zstd" for name in REPEATED if name in packed}
    return {
        "compression": packed,
        "use_dictionary": [*plain, *REPEATED, f"{BASE}.bytes"] if lazy else plain,
        "dictionary_pagesize_limit": DICTIONARY_BYTES if lazy else None,
        "write_statistics": plain,
        "version": "2.6",
    }


def _groups(rows: Iterable[Mapping[str, Any]]) -> Iterator[list[Mapping[str, Any]]]:
    group: list[Mapping[str, Any]] = []
    size = 0
    for row in rows:
        group.append(row)
        size += len(row["screenshot"]["bytes"]) + len(row["plan"])
        if len(group) == GROUP_ROWS or size >= GROUP_BYTES:
            yield group
            group = []
            size = 0
    if group:
        yield group


def _steps(rows: Iterable[Mapping[str, Any]]) -> Iterator[list[Mapping[str, Any]]]:
    """Group consecutive rows that share a picture, so that it is stored in one row group only."""
    group: list[Mapping[str, Any]] = []
    known: object = None
    size = 0
    for row in rows:
        picture: bytes = row[BASE]["bytes"]
        if picture is not known:
            is_full = len(group) >= GROUP_ROWS or size >= GROUP_BYTES
            if group and is_full:
                yield group
                group = []
                size = 0
            known = picture
            size += len(picture)
        group.append(row)
    if group:
        yield group
