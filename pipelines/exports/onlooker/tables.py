"""The three tables, a folder each: `reminders`, `summaries` and `recovery`, one Parquet file a shard of the dataset."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...columns import ACTION, Kind, pyarrow, schema_of

# What is held before it is written, rows and bytes of pictures.
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
    "reminders": {**_ABOUT, "screenshot": "image", "reminder": "string", "kind": "string", **_MESSAGES},
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


class Table:
    """Writes one table. A file is made when its first row comes, so a shard without rows has none."""

    def __init__(self, folder: Path, name: str) -> None:
        self.folder = folder / name
        self.schema = schema_of(TABLES[name])
        self.pictures = [column for column, kind in TABLES[name].items() if kind == "image"]
        self._writer: Any = None
        self._group: list[Mapping[str, Any]] = []
        self._bytes = 0

    def add(self, shard: int, row: Mapping[str, Any]) -> None:
        """Write a row of a shard; see `done`. Pictures are given as PNG bytes."""
        if self._writer is None:
            self.folder.mkdir(exist_ok=True)
            path = self.folder / f"train-{shard:05d}.parquet"
            self._writer = pyarrow().parquet.ParquetWriter(path, self.schema, version="2.6")
        self._bytes += sum(len(row[name]) for name in self.pictures)
        self._group.append({**row, **{name: {"bytes": row[name], "path": None} for name in self.pictures}})
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
            self._writer.write_table(pyarrow().Table.from_pylist(self._group, schema=self.schema))
            self._group, self._bytes = [], 0


def about(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return what every table keeps of a row."""
    return {name: row[name] for name in _ABOUT}
