"""Rows of a dataset as exports take them: the row, and the PNG of its screenshot."""

from collections.abc import Callable, Iterator
from pathlib import Path

from ..dataset import shard_pictures, shard_rows
from ..images import encode
from ..lazy import picture_bytes
from .example import Row


def stored_rows(file: Path, lazy: bool) -> Iterator[tuple[Row, Callable[[], bytes]]]:
    """Yield rows, each with a function that gives the bytes of its screenshot: as stored, or drawn and encoded."""
    if not lazy:
        for row in shard_rows(file):
            data = picture_bytes(row.pop("screenshot"))
            yield row, lambda data=data: data
        return
    for row, picture in shard_pictures(file):
        row.pop("screenshot")
        yield row, lambda picture=picture: encode(picture)
