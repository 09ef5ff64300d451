"""Rows of a dataset for exports: each row, and the PNG of its screenshot."""

from collections.abc import Callable, Iterator
from pathlib import Path

from ..dataset.image_codec import encode
from ..dataset.lazy_rows import picture_bytes
from ..dataset.opening import shard_pictures, shard_rows
from .example import Row


def stored_rows(file: Path, lazy: bool) -> Iterator[tuple[Row, Callable[[], bytes]]]:
    """Yield rows, each with a function that returns the PNG of its screenshot."""
    if not lazy:
        for row in shard_rows(file):
            data = picture_bytes(row.pop("screenshot"))
            yield row, lambda data=data: data
        return
    for row, picture in shard_pictures(file):
        row.pop("screenshot")
        yield row, lambda picture=picture: encode(picture)
