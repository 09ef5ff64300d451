"""Results in a table, a row an episode: CSV, JSON Lines or Parquet."""

import csv
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from hijack_data.errors import short_repr, suggest
from hijack_data.plan import CLEAN

from ...extra import require
from ..outcomes import FIELDS, EpisodeOutcome, OutcomeError

_REQUIRED = ("task", "score")
_NO_SCORE = ("", "nan", "none", "null", "n/a", "na")
_BATCH = 65_536  # rows of a Parquet file that are in memory at once


class TableReader:
    """Reads a table by the names of its columns, which are those of `FIELDS` unless stated.

    Without a column `agent`, the agent has the name of the file; without `condition`, every row is
    clean; without `seed`, the rows of a task are its repetitions.
    """

    def detect(self, source: Path) -> bool:
        """Return whether the name of a file is that of a table."""
        return source.is_file() and source.suffix.lower() in _ROWS

    def read(self, source: Path, columns: Mapping[str, str]) -> Iterator[EpisodeOutcome]:
        """Yield the outcomes of a table.

        Args:
            source: the file.
            columns: names of columns by field.

        Raises:
            OutcomeError: a column is missing, or a value is no result; the message names the row.
        """
        if source.suffix.lower() not in _ROWS:
            names = ", ".join(_ROWS)
            raise OutcomeError(f"{source}: is no table; its name must end with one of {names}")
        names = {field: columns.get(field, field) for field in FIELDS}
        checked: set[str] = set()
        try:
            for place, row in _ROWS[source.suffix.lower()](source):
                if not checked:
                    checked = _check_columns(source, row, names, columns)
                yield _outcome(row, names, checked, f"{source}: {place}")
        except (OSError, UnicodeDecodeError, csv.Error) as error:
            raise OutcomeError(f"{source}: cannot be read ({error})") from None


def _check_columns(
    source: Path, row: Mapping[str, Any], names: Mapping[str, str], stated: Mapping[str, str]
) -> set[str]:
    """Return the fields that a table has.

    Raises:
        OutcomeError: one that was stated, or that is required, is not there.
    """
    for field, column in names.items():
        if column not in row and (field in stated or field in _REQUIRED):
            raise OutcomeError(
                f"{source}: has no column {column!r}{suggest(column, list(row))}; name that of the"
                f" {field} with --columns {field}=COLUMN"
            )
    return {field for field, column in names.items() if column in row}


def _outcome(
    row: Mapping[str, Any], names: Mapping[str, str], fields: set[str], place: str
) -> EpisodeOutcome:
    values = {field: row.get(names[field]) for field in fields}
    task = values["task"]
    if task is None or task == "":
        raise OutcomeError(f"{place}: has no task")
    score = _score(values["score"], place)
    return EpisodeOutcome(
        agent=_name(values, "agent", Path(place.rpartition(": ")[0]).stem, place),
        task=str(task),
        condition=_name(values, "condition", CLEAN, place),
        score=score,
        seed=_seed(values.get("seed"), place) if "seed" in fields else None,
        problem="" if score is not None else "the table has no score",
    )


def _name(values: Mapping[str, Any], field: str, default: str, place: str) -> str:
    """Return the agent or the condition of a row.

    Raises:
        OutcomeError: the table has the column, and the row has no value in it.
    """
    if field not in values:
        return default
    value = values[field]
    if value is None or value == "":
        raise OutcomeError(f"{place}: has no {field}; fill the column in every row")
    return str(value)


def _score(value: Any, place: str) -> float | None:
    """Return a score, or `None` where the table has none.

    Raises:
        OutcomeError: it is not a number in 0..1.
    """
    if value is None or (isinstance(value, str) and value.strip().lower() in _NO_SCORE):
        return None
    if isinstance(value, bool) or (isinstance(value, str) and value.lower() in ("true", "false")):
        return float(str(value).lower() == "true")
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise OutcomeError(
            f"{place}: the score {short_repr(value)} is no number; leave it empty if the episode"
            " has no outcome"
        ) from None
    if number != number:  # NaN
        return None
    if not 0 <= number <= 1:
        raise OutcomeError(f"{place}: the score {number:g} is not in 0..1; scale the column")
    return number


def _seed(value: Any, place: str) -> int:
    try:
        if isinstance(value, float) and not value.is_integer():
            raise ValueError
        return int(value)
    except (TypeError, ValueError):
        raise OutcomeError(f"{place}: the seed {short_repr(value)} is no whole number") from None


def _csv_rows(source: Path) -> Iterator[tuple[str, Mapping[str, Any]]]:
    with source.open(encoding="utf-8-sig", newline="") as file:
        reader = csv.DictReader(file, strict=True)
        for row in reader:
            if None in row or None in row.values():
                raise OutcomeError(
                    f"{source}: line {reader.line_num}: has not as many values as the first line"
                )
            yield f"line {reader.line_num}", row


def _json_rows(source: Path) -> Iterator[tuple[str, Mapping[str, Any]]]:
    with source.open(encoding="utf-8") as file:
        for number, line in enumerate(file, 1):
            if not line.strip():
                continue
            try:
                row = json.loads(line)
            except (ValueError, RecursionError):
                raise OutcomeError(f"{source}: line {number}: is not JSON") from None
            if not isinstance(row, dict):
                raise OutcomeError(f"{source}: line {number}: is no object")
            yield f"line {number}", row


def _parquet_rows(source: Path) -> Iterator[tuple[str, Mapping[str, Any]]]:
    require("a table in Parquet", ("pyarrow",))
    import pyarrow as pa
    from pyarrow import parquet

    try:
        file = parquet.ParquetFile(source)
        number = 0
        for batch in file.iter_batches(_BATCH):
            for row in batch.to_pylist():
                number += 1
                yield f"row {number}", row
    except pa.ArrowException as error:
        raise OutcomeError(f"{source}: is no Parquet ({error})") from None


_ROWS = {".csv": _csv_rows, ".jsonl": _json_rows, ".ndjson": _json_rows, ".parquet": _parquet_rows}
