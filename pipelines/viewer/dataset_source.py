"""A dataset for the page: filters from a few light columns, rows and pictures read on demand."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hijack_data.errors import HijackError, quantity
from hijack_data.plan import CLEAN
from hijack_data.types import Box, UInt8Array

from ..dataset.columns import BASE, pyarrow
from ..dataset.lazy_rows import decode_column, row_plan
from ..dataset.manifest import is_lazy, read_manifest
from ..dataset.opening import Dataset, open_row
from ..dataset.row_reader import RowReader
from ..dataset.stats import percent_text
from ..errors import DatasetError
from ..readers.fields import FieldError
from ..readers.safe_files import inside
from .index import Index
from .source import INSERTED, Detail, Fields, action_points, action_text, display_text, tidy

# Columns of the index, by the column of the dataset; those with a title are filters.
COLUMNS = {
    "corruption": "corruption",
    "fidelity": "fidelity",
    "trajectory_id": "trajectory",
    "inserted": "inserted",
    "instruction": "instruction",
}
LABELS = {
    "corruption": "Corruption",
    "fidelity": "Fidelity",
    "trajectory": "Trajectory",
    "inserted": "Inserted",
}
REQUIRED_COLUMNS = ("id", "trajectory_id", "step", "corruption")
# What a tile shows beside the columns of the index.
TILE_COLUMNS = ("width", "height", "action", "target_box")
JSON = ("params", "plan")


class DatasetSource:
    """A dataset that `build` made, materialised or lazy.

    Raises:
        DatasetError: the folder is not a dataset.
    """

    def __init__(self, folder: Path) -> None:
        self.title = folder.resolve().name
        self.problems: list[str] = []
        self.index = Index(["trajectory", "fidelity", "inserted"])
        manifest = read_manifest(folder)
        try:
            self.data = Dataset(folder, manifest)
            self.tiles = RowReader(folder, manifest["shards"], columns=TILE_COLUMNS)
            shards = [(str(shard["file"]), int(shard["rows"])) for shard in manifest["shards"]]
        except (KeyError, TypeError, ValueError) as error:
            raise DatasetError(
                f"{folder}/manifest.json: damaged: a shard without a file or rows ({error})"
            ) from None
        first = 0
        for file, rows in shards:
            self._read(folder, file, range(first, first + rows))
            first += rows
        self.index.finish()
        kind = "lazy" if is_lazy(manifest) else "materialised"
        self.facts = f"{kind} dataset, {quantity(len(shards), 'file')}"
        self.labels = {
            name: title for name, title in LABELS.items() if any(self.index.columns[name].values)
        }
        self.chips = tuple(
            name for name in ("corruption", "fidelity", "inserted") if name in self.labels
        )

    def _read(self, folder: Path, file: str, numbers: range) -> None:
        """Put the rows of one file into the index, or note why they are missing."""
        try:
            columns = light_columns(inside(folder, file, "file"))
        except (FieldError, DatasetError) as error:
            self.problems.append(f"{file}: its {len(numbers)} rows are left out: {error}")
            return
        rows = len(columns["id"])
        if rows != len(numbers):
            self.problems.append(
                f"{file}: holds {rows} rows, the manifest says {len(numbers)}; hijack verify says"
                " more"
            )
        common = slice(min(rows, len(numbers)))
        index_columns = {
            name: columns[column][common] for column, name in COLUMNS.items() if column in columns
        }
        self.index.extend(
            numbers[common],
            columns["id"][common],
            columns["step"][common],
            {**index_columns, "group": index_columns["trajectory"]},
        )

    def detail(self, row: int) -> Detail:
        """Return all columns of a row except its pictures.

        Raises:
            DatasetError: the row is damaged.
        """
        with _damage_as_error(row):
            return self._detail(row, self.data.reader[row])

    def glance(self, row: int) -> Detail:
        """Return what a tile shows of a row, without reading a picture.

        Raises:
            DatasetError: the row is damaged.
        """
        with _damage_as_error(row):
            stored = self.tiles[row]
            action = stored["action"] or {}
            return Detail(
                size=(int(stored["width"]), int(stored["height"])),
                action=action_text(action),
                points=action_points(action),
                box=_box(stored),
            )

    def _detail(self, row: int, stored: Mapping[str, Any]) -> Detail:
        plan, problem = _plan(stored)
        values: Fields = [
            (name, _column_text(name, value)) for name, value in stored.items() if name != "plan"
        ]
        action = stored["action"] or {}
        return Detail(
            size=(int(stored["width"]), int(stored["height"])),
            fields={"Columns": values},
            notes=_notes(stored),
            action=action_text(action),
            code=stored["action_code"] or "",
            points=action_points(action),
            box=_box(stored),
            plan=plan,
            no_before=self._no_before(row, stored),
            problem=problem,
        )

    def picture(self, row: int, before: bool) -> UInt8Array:
        """Return the picture of a row, or that of its step before the corruption.

        Returns:
            uint8 RGB `[H, W, 3]`.

        Raises:
            DatasetError: the dataset has no such picture, or it is damaged.
        """
        with _damage_as_error(row):
            stored = self.data.reader[row]
            if not before:
                return open_row(stored)[1]
            if BASE in stored:
                return decode_column(stored, BASE)
            clean = self._clean_row(row)
            if clean is None:
                raise DatasetError(f"row {stored['id']}: {self._no_before(row, stored)}")
            return self.data.pixels(clean)[1]

    def _clean_row(self, row: int) -> int | None:
        position = self.index.at(row)
        step_positions = [] if position is None else self.index.same_step(position).tolist()
        return next(
            (
                int(self.index.rows[p])
                for p in step_positions
                if self.index.value("corruption", p) == CLEAN
            ),
            None,
        )

    def _no_before(self, row: int, stored: Mapping[str, Any]) -> str:
        if stored["corruption"] == CLEAN:
            return "this is the clean picture"
        if BASE in stored or self._clean_row(row) is not None:
            return ""
        return (
            "the dataset holds no clean row of this step (built with --no-clean, or its file is"
            " damaged)"
        )


@contextmanager
def _damage_as_error(row: int) -> Iterator[None]:
    # reports a missing column, or a null where none is allowed, as a DatasetError
    try:
        yield
    except HijackError:
        raise
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise DatasetError(
            f"row {row}: a column is missing or holds another kind of value ({error!r})"
        ) from None


def light_columns(file: Path) -> dict[str, Sequence[Any]]:
    """Return the light columns that one file has: lists of text, and of integers for `step`.

    Raises:
        DatasetError: the file cannot be read, or lacks a column that is needed.
    """
    pa = pyarrow()
    try:
        with pa.parquet.ParquetFile(file) as parquet:
            have = parquet.schema_arrow.names
            missing = [name for name in REQUIRED_COLUMNS if name not in have]
            if missing:
                raise DatasetError(f"has no column {', '.join(missing)}")
            table = parquet.read(
                [name for name in ("id", "step", *COLUMNS) if name in have], use_threads=False
            )
        columns = table.to_pydict()
        steps = [int(step) for step in columns["step"]]
    except (pa.ArrowException, OSError, TypeError, ValueError) as error:
        reason = str(error).partition("\n")[0]
        raise DatasetError(f"cannot be read ({reason})") from None
    text = {
        name: [_index_text(value) for value in values]
        for name, values in columns.items()
        if name != "step"
    }
    return {**text, "step": steps}


def _index_text(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return INSERTED if value else "no"
    return str(value)


def _box(stored: Mapping[str, Any]) -> Box | None:
    """Return the box of the target, `(x1, y1, x2, y2)`, or `None`."""
    box = stored["target_box"]
    return tuple(box) if box and len(box) == 4 else None


def _plan(stored: Mapping[str, Any]) -> tuple[str, str]:
    """Return the plan of a row as text, and its problem, or an empty text."""
    text = str(stored["plan"])
    if BASE not in stored:
        return tidy(text), ""
    try:
        return tidy(row_plan(stored, decode_column(stored, BASE).shape[:2]).to_json()), ""
    except HijackError as error:
        return tidy(text), str(error)


def _column_text(name: str, value: object) -> str:
    if isinstance(value, dict) and "bytes" in value:
        data: Any = value["bytes"]
        return f"{len(data or b''):,} bytes"
    return tidy(value) if name in JSON and isinstance(value, str) else display_text(value)


def _notes(stored: Mapping[str, Any]) -> Fields:
    notes = [
        (title, str(stored[name]))
        for name, title in (("event", "Event"), ("reminder", "Reminder"))
        if stored.get(name)
    ]
    if stored.get("inserted"):
        notes.append(("Inserted", "this step is not in the recording"))
    if stored["target_visible"] is not None and stored["corruption"] != CLEAN:
        notes.append(("Target", f"{percent_text(stored['target_visible'])} of it shows"))
    return notes
