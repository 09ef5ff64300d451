"""The tables `reminders`, `summaries` and `recovery`: a folder each, one Parquet file per shard."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...dataset.columns import ACTION, Kind, arrow_schema, pyarrow

# The most rows, and bytes of pictures, that are buffered before they are written.
GROUP_ROWS = 16
GROUP_BYTES = 64 * 2**20

_ABOUT: dict[str, Kind] = {
    "id": "string",
    "trajectory_id": "string",
    "step": "int32",
    "source": "string",
    "domain": "string",
    "instruction": "string",
    "corruption": "string",
    "fidelity": "string",
}
_MESSAGES: dict[str, Kind] = {"messages": [{"role": "string", "content": "string"}]}
TABLES: dict[str, dict[str, Kind]] = {
    "reminders": {
        **_ABOUT,
        "screenshot": "image",
        "reminder": "string",
        "kind": "string",
        **_MESSAGES,
    },
    "summaries": {
        **_ABOUT,
        "before_id": "string",
        "before": "image",
        "action": ACTION,
        "action_text": "string",
        "after": "image",
        "event": "string",
        "changed": "float64",
        "summary": "string",
        "made_by": "string",
        **_MESSAGES,
    },
    "recovery": {
        **_ABOUT,
        "screenshot": "image",
        "event": "string",
        "action": ACTION,
        "answer": "string",
        "target_box": ["int32"],
        **_MESSAGES,
    },
}


class TableWriter:
    """Writes one table.

    A file is created with its first row, so a shard without rows has no file.

    Args:
        folder: the folder of the export.
        name: name of the table, a key of `TABLES`.
    """

    def __init__(self, folder: Path, name: str) -> None:
        self.folder = folder / name
        self.schema = arrow_schema(TABLES[name])
        self.pictures = [column for column, kind in TABLES[name].items() if kind == "image"]
        self._writer: Any = None
        self._group: list[Mapping[str, Any]] = []
        self._bytes = 0

    def add(self, shard: int, row: Mapping[str, Any]) -> None:
        """Write a row of a shard; see `done`.

        Args:
            shard: index of the shard.
            row: values by column; pictures are PNG bytes.
        """
        if self._writer is None:
            self.folder.mkdir(exist_ok=True)
            path = self.folder / f"train-{shard:05d}.parquet"
            self._writer = pyarrow().parquet.ParquetWriter(path, self.schema, version="2.6")
        stored = dict(row)
        for name in self.pictures:
            stored[name] = {"bytes": row[name], "path": None}
            self._bytes += len(row[name])
        self._group.append(stored)
        if len(self._group) == GROUP_ROWS or self._bytes >= GROUP_BYTES:
            self._flush()

    def done(self) -> None:
        """Finish the file of the shard."""
        if self._writer is not None:
            self._flush()
            self._writer.close()
            self._writer = None

    def _flush(self) -> None:
        if self._group:
            table = pyarrow().Table.from_pylist(self._group, schema=self.schema)
            self._writer.write_table(table)
            self._group = []
            self._bytes = 0


def about(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return the columns of a row that every table keeps."""
    return {name: row[name] for name in _ABOUT}
