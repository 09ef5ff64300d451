"""The rows of a dataset. No other module of this package imports `pipelines`.

`pipelines` is imported when a dataset is opened, since nothing else here needs it.
"""

import hashlib
import importlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Protocol, TypeAlias

import yaml

from hijack_data.errors import HijackError, ParameterError
from hijack_data.types import UInt8Array

RowData: TypeAlias = dict[str, Any]
EXPORT = "export.json"
# What the cases are made of; the pictures are read when it is their turn.
HEAD = (
    *("id", "trajectory_id", "step", "corruption", "seed"),
    *("action", "reminder", "changed_pixels"),
)
_EXPORT_HEAD = ("id", "trajectory_id", "step", "corruption")


class DamagedRowError(HijackError, ValueError):
    """A row whose picture or plan cannot be read."""


class RowFeed(Protocol):
    """Rows by number."""

    folder: Path  # where they are, for messages
    content: str  # names what the rows are: 64 hexadecimal digits
    # What stands in a configuration for each label, as far as a configuration can hold it.
    entries: Mapping[str, Any]

    def heads(self) -> Iterator[tuple[str, RowData]]:
        """Yield the split and the light columns of each row, in order."""
        ...

    def row(self, number: int) -> RowData:
        """Return one row; its pictures are uint8 RGB `[H, W, 3]`, the caller's own."""
        ...


class DatasetRows:
    """The rows of a dataset that `hijack build` made, materialised or lazy.

    Args:
        folder: the dataset.
    """

    def __init__(self, folder: Path) -> None:
        self._opening: Any = importlib.import_module("pipelines.dataset.opening")
        self._lazy: Any = importlib.import_module("pipelines.dataset.lazy_rows")
        self._dataset: Any = self._opening.open_dataset(folder)
        self.folder = folder
        self.content: str = self._dataset.fingerprint
        config: str | None = self._dataset.manifest["config"]
        self.entries: Mapping[str, Any] = (
            {} if config is None else entries_by_label(yaml.safe_load(config))
        )
        self._data: bytes | None = None  # of the picture that the rows of a step share
        self._base: UInt8Array | None = None

    def heads(self) -> Iterator[tuple[str, RowData]]:
        """Yield the split and the light columns of each row; see `RowFeed.heads`."""
        for shard in self._dataset.manifest["shards"]:
            file = self._dataset.folder / shard["file"]
            split = file.name.rpartition("-")[0]
            for row in self._opening.shard_rows(file, list(HEAD)):
                yield split, row

    def row(self, number: int) -> RowData:
        """Return one row with its `screenshot`; see `RowFeed.row`.

        Raises:
            DamagedRowError: its picture or plan cannot be read.
        """
        try:
            stored = self._dataset.reader[number]
            row, picture = self._opening.open_row(stored, self._shared(stored))
        except HijackError as error:
            raise DamagedRowError(str(error)) from error
        if picture is self._base:
            picture = picture.copy()
        return {**row, "screenshot": picture}

    def _shared(self, stored: RowData) -> UInt8Array | None:
        """Return the decoded picture before the corruption, decoded once for a step."""
        name: str = self._lazy.BASE
        if name not in stored:
            return None
        data = self._lazy.picture_bytes(stored[name])
        if data != self._data:
            self._base = self._lazy.decode_column(stored, name)
            self._data = data
        return self._base


class ExportedRows:
    """The rows of one table of `hijack export --to onlooker`.

    Args:
        folder: the export.
        table: `reminders` or `summaries`.
        pictures: the columns that hold pictures.

    Raises:
        ParameterError: the export has no such rows.
    """

    def __init__(self, folder: Path, table: str, pictures: tuple[str, ...]) -> None:
        self._opening: Any = importlib.import_module("pipelines.dataset.opening")
        self._images: Any = importlib.import_module("pipelines.dataset.image_codec")
        access: Any = importlib.import_module("pipelines.dataset.row_reader")
        columns: Any = importlib.import_module("pipelines.dataset.columns")
        self._files = sorted((folder / table).glob("*.parquet"))
        if not self._files:
            raise ParameterError(f"{folder}: holds no {table}; see docs/onlooker_data.md")
        parquet: Any = columns.pyarrow().parquet
        shards = [
            {"file": file.relative_to(folder), "rows": parquet.read_metadata(file).num_rows}
            for file in self._files
        ]
        self._rows: Any = access.RowReader(folder, shards)
        self.folder = folder
        self._pictures = pictures
        self._head = [*_EXPORT_HEAD, *(["reminder"] if table == "reminders" else [])]
        self.content = hashlib.sha256((folder / EXPORT).read_bytes()).hexdigest()
        self.entries: Mapping[str, Any] = {}  # an export does not say

    def heads(self) -> Iterator[tuple[str, RowData]]:
        """Yield the split and the light columns of each row; see `RowFeed.heads`."""
        for file in self._files:
            split = file.name.rpartition("-")[0]
            for row in self._opening.shard_rows(file, self._head):
                yield split, {"seed": 0, "action": None, "reminder": None, **row}

    def row(self, number: int) -> RowData:
        """Return one row with its pictures; see `RowFeed.row`.

        Raises:
            DamagedRowError: a picture cannot be read.
        """
        try:
            row: RowData = self._rows[number]
            for name in self._pictures:
                row[name] = self._images.decode(row[name]["bytes"], name)
        except HijackError as error:
            raise DamagedRowError(str(error)) from error
        return row


def entries_by_label(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries of a configuration's corruptions, each with all parameters, by label."""
    entries: dict[str, Any] = {}
    for entry in config["corruptions"]:
        ((name, settings),) = entry.items()
        entries[settings.get("as", name)] = entry
    return entries


def is_export(folder: Path) -> bool:
    """Return whether a folder is an export for onlookers.

    Raises:
        ParameterError: it is an export for something else.
    """
    try:
        data: object = json.loads((folder / EXPORT).read_bytes())
    except (OSError, ValueError):
        return False
    to = data.get("to") if isinstance(data, dict) else None
    if to != "onlooker":
        raise ParameterError(
            f"{folder}: is an export for {to!r}; score the dataset that it was made of"
        )
    return True


def picture_scale(row: RowData) -> tuple[float, float]:
    """Return width and height of a row's picture over those of the screen before its plan."""
    plans: Any = importlib.import_module("hijack_data.plan")
    height, width = plans.Plan.from_json(row["plan"]).size
    return row["width"] / width, row["height"] / height
