"""What the tests of `hijack view` share: a page that is served, rows that are changed, pictures
that are read."""

import contextlib
import io
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from PIL import Image

from pipelines.viewer.opening import open_source
from pipelines.viewer.server import ViewServer


@contextlib.contextmanager
def served(folder: Path) -> Iterator[ViewServer]:
    """Serve the page of a folder, until the end of the block."""
    with ViewServer(open_source(folder)) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join(30)


def edit(file: Path, **columns: Callable[[list[Any]], list[Any]]) -> None:
    """Write a file of rows anew with some columns changed (or added)."""
    table = pq.read_table(file)
    for name, change in columns.items():
        old = table.column(name).to_pylist() if name in table.column_names else [None] * len(table)
        table = table.drop_columns([name]) if name in table.column_names else table
        table = table.append_column(name, pa.array(change(old)))
    pq.write_table(table, file, row_group_size=4)


def read(data: bytes) -> np.ndarray:
    """The pixels of an encoded picture."""
    return np.array(Image.open(io.BytesIO(data)))
