"""Results in a table, a row an episode: CSV, JSON Lines or Parquet."""

import csv
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from math import isnan, nan
from pathlib import Path
from typing import Any

from hijack_data.errors import short_repr, suggest
from hijack_data.plan import CLEAN
from hijack_data.runs.amounts import is_amount

from ...extra import require
from ..outcome_formats import AMOUNTS, FIELDS
from ..outcomes import OutcomeBatch, OutcomeError

_REQUIRED = ("task", "score")
_NO_NUMBER = ("", "none", "null", "n/a", "na")
_BATCH = 65_536  # rows that are in memory as Python objects at once
_MAX_SEED = 2**63


@dataclass(frozen=True, kw_only=True)
class _Rows:
    """Some rows of a table.

    Attributes:
        columns: the values of each column, by its name.
        unit: what the numbers count, `line` or `row`.
        numbers: which line or row of the file each is, from 1.
    """

    columns: Mapping[str, Sequence[Any]]
    unit: str
    numbers: Sequence[int]


class TableReader:
    """Reads a table by the names of its columns, which are those of `FIELDS` unless stated.

    Without a column `agent`, the agent has the name of the file; without `condition`, every row is
    clean; without `seed`, the rows of a task are its repetitions.
    """

    fields = FIELDS

    def detect(self, source: Path) -> bool:
        """Return whether the name of a file is that of a table."""
        return source.is_file() and source.suffix.lower() in _ROWS

    def read(self, source: Path, columns: Mapping[str, str]) -> Iterator[OutcomeBatch]:
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
        fields: set[str] = set()
        try:
            for rows in _ROWS[source.suffix.lower()](source, list(names.values())):
                if not fields:
                    fields = _check_columns(source, rows.columns, names, columns)
                found = {field: names[field] for field in fields}
                yield _batch(str(source), source.stem, rows, found)
        except UnicodeDecodeError as error:
            raise OutcomeError(f"{source}: is not UTF-8 ({error}); save it as UTF-8") from None
        except (OSError, csv.Error) as error:
            raise OutcomeError(f"{source}: cannot be read ({error})") from None


def _check_columns(
    source: Path,
    available: Iterable[str],
    names: Mapping[str, str],
    named_columns: Mapping[str, str],
) -> set[str]:
    """Return the fields that a table has.

    Raises:
        OutcomeError: one that was stated, or that is required, is not there.
    """
    for field, column in names.items():
        if column not in available and (field in named_columns or field in _REQUIRED):
            raise OutcomeError(
                f"{source}: has no column {column!r}{suggest(column, list(available))}; name that"
                f" of the {field} with --columns {field}=COLUMN"
            )
    present = {field: column for field, column in names.items() if column in available}
    check_columns_differ(present)
    return set(present)


def check_columns_differ(columns: Mapping[str, str]) -> None:
    """Check that each field has a column of its own.

    Args:
        columns: the column of each field that a table has.

    Raises:
        OutcomeError: two fields have the same.
    """
    field_by_column: dict[str, str] = {}
    for field, column in columns.items():
        other = field_by_column.setdefault(column, field)
        if other != field:
            raise OutcomeError(
                f"the column {column!r} is that of the {other} and of the {field}; name another"
                " for one of them"
            )


def check_spelling(source: str, header: Sequence[str], column_names: Sequence[str]) -> None:
    """Check that no column is left out for a capital letter or a space in its name.

    Args:
        source: the table, for messages.
        header: the names of all its columns.
        column_names: those that are read.

    Raises:
        OutcomeError: one is.
    """
    for name in header:
        plain = str(name).strip().lower()
        if name not in column_names and plain in column_names and plain not in header:
            raise OutcomeError(f"{source}: has a column {name!r}; rename it {plain!r}")


def read_arrow(table: Any, columns: Mapping[str, str], agent: str) -> Iterator[OutcomeBatch]:
    """Yield the outcomes of a table of pyarrow.

    Args:
        table: the table.
        columns: the column of each field that it has.
        agent: the agent where no column names one.

    Raises:
        OutcomeError: a value is no result; the message names the row.
    """
    start = 1
    for batch in table.select(sorted(set(columns.values()))).to_batches(max_chunksize=_BATCH):
        numbers = range(start, start + batch.num_rows)
        yield _batch("the table", agent, _arrow_rows(batch, numbers), columns)
        start += batch.num_rows


def _arrow_rows(batch: Any, numbers: Sequence[int]) -> _Rows:
    values = {name: batch.column(name).to_pylist() for name in batch.schema.names}
    return _Rows(columns=values, unit="row", numbers=numbers)


def _batch(source: str, agent: str, rows: _Rows, names: Mapping[str, str]) -> OutcomeBatch:
    """Return the outcomes of some rows.

    Args:
        source: the file, for messages.
        agent: the agent where no column names one.
        rows: the rows.
        names: the column of each field that the table has.

    Raises:
        OutcomeError: a value is no result.
    """
    count = len(rows.numbers)
    values = {field: rows.columns[column] for field, column in names.items()}

    def locate(position: int) -> str:
        return f"{source}: {rows.unit} {rows.numbers[position]}"

    scores = _scores(values["score"], locate)
    return OutcomeBatch(
        agents=_names(values, "agent", locate) if "agent" in values else [agent] * count,
        tasks=_names(values, "task", locate),
        conditions=_names(values, "condition", locate)
        if "condition" in values
        else [CLEAN] * count,
        scores=scores,
        seeds=_seeds(values["seed"], locate) if "seed" in values else None,
        problems={
            position: "the table has no score"
            for position, score in (enumerate(scores) if None in scores else ())
            if score is None
        },
        amounts={name: _amounts(values[name], name, locate) for name in AMOUNTS if name in values},
    )


def _names(values: Mapping[str, Sequence[Any]], field: str, locate: Any) -> Sequence[str]:
    """Return the agents, conditions or tasks of some rows.

    Raises:
        OutcomeError: a row has no value in the column.
    """
    column = values[field]
    kinds = set(map(type, column))
    if kinds <= {str} and "" not in column:
        return column
    for position, value in enumerate(column):
        if value is None or value == "" or value != value:
            raise OutcomeError(f"{locate(position)}: has no {field}; fill the column in every row")
        if not isinstance(value, str | int):
            raise OutcomeError(
                f"{locate(position)}: the {field} {short_repr(value)} is neither a text nor a whole"
                " number"
            )
        if type(value) is not type(column[0]):  # 1 and "1" would become one name
            raise OutcomeError(
                f"{locate(position)}: the {field} {short_repr(value)} is of another type than"
                f" {short_repr(column[0])}; write texts, or whole numbers, in every row"
            )
    return [str(value) for value in column]


def _scores(column: Sequence[Any], locate: Any) -> Sequence[float | None]:
    """Return the scores of some rows, `None` where the table has none.

    Raises:
        OutcomeError: one is not a number in 0..1.
    """
    kinds = set(map(type, column))
    if kinds <= {int, float} and min(column) >= 0 and max(column) <= 1 and not _has_nan(column):
        return column
    return [_score(value, position, locate) for position, value in enumerate(column)]


def _plain(value: Any) -> Any:
    """Return a value that is to become a number.

    Raises:
        ValueError: it is a text with an underscore, which Python alone takes for part of a number.
    """
    if isinstance(value, str) and "_" in value:
        raise ValueError(value)
    return value


def _has_nan(column: Sequence[float]) -> bool:
    return isnan(sum(column))


def _score(value: Any, position: int, locate: Any) -> float | None:
    """Return a score, or `None` where the table has none.

    Raises:
        OutcomeError: it is not a number in 0..1.
    """
    if value is None or (isinstance(value, str) and value.strip().lower() in _NO_NUMBER):
        return None
    if isinstance(value, bool) or (isinstance(value, str) and value.lower() in ("true", "false")):
        return float(str(value).lower() == "true")
    try:
        number = float(_plain(value))
    except (TypeError, ValueError, OverflowError):
        raise OutcomeError(
            f"{locate(position)}: the score {short_repr(value)} is no number; leave it empty if the"
            " episode has no outcome"
        ) from None
    if isnan(number):
        raise OutcomeError(
            f"{locate(position)}: the score is NaN; leave it empty if the episode has no outcome"
        )
    if not 0 <= number <= 1:
        raise OutcomeError(
            f"{locate(position)}: the score {number:g} is not in 0..1; scale the column"
        )
    return number


def _amounts(column: Sequence[Any], name: str, locate: Any) -> Sequence[float | None]:
    """Return the steps, tokens or cost of some rows, `None` where the table has none.

    Raises:
        OutcomeError: one is no number of at least 0.
    """
    if set(map(type, column)) <= {int, float} and all(map(is_amount, column)):
        return column
    return [_amount(value, name, position, locate) for position, value in enumerate(column)]


def _amount(value: Any, name: str, position: int, locate: Any) -> float | None:
    if value is None or (isinstance(value, str) and value.strip().lower() in _NO_NUMBER):
        return None
    try:
        number = nan if isinstance(value, bool) else float(_plain(value))
    except (TypeError, ValueError, OverflowError):
        number = nan
    if not is_amount(number):
        raise OutcomeError(
            f"{locate(position)}: {name} {short_repr(value)} is no number of at least 0; leave it"
            " empty if it is not known"
        )
    return number


def _seeds(column: Sequence[Any], locate: Any) -> Sequence[int]:
    """Return the seeds of some rows.

    Raises:
        OutcomeError: one is no whole number, or has more than 63 bits.
    """
    if set(map(type, column)) <= {int} and min(column) >= -_MAX_SEED and max(column) < _MAX_SEED:
        return column
    return [_seed(value, position, locate) for position, value in enumerate(column)]


def _seed(value: Any, position: int, locate: Any) -> int:
    try:
        if isinstance(value, bool) or (isinstance(value, float) and not value.is_integer()):
            raise ValueError
        seed = int(_plain(value))
    except (TypeError, ValueError, OverflowError):
        raise OutcomeError(
            f"{locate(position)}: the seed {short_repr(value)} is no whole number"
        ) from None
    if not -_MAX_SEED <= seed < _MAX_SEED:
        raise OutcomeError(
            f"{locate(position)}: the seed {short_repr(value)} has more than 63 bits"
        )
    return seed


def _csv_rows(source: Path, column_names: Sequence[str]) -> Iterator[_Rows]:
    with source.open(encoding="utf-8-sig", newline="") as file:
        reader = csv.reader(file, strict=True)
        header = next(reader, [])
        _check_header(source, header)
        check_spelling(str(source), header, column_names)
        columns = {name: at for at, name in enumerate(header) if name in column_names}
        while batch := [(reader.line_num, row) for row in islice(reader, _BATCH)]:
            numbers = [number for number, row in batch if row]
            rows = [row for _, row in batch if row]
            if not rows:
                continue
            if set(map(len, rows)) - {len(header)}:
                bad = next(at for at, row in enumerate(rows) if len(row) != len(header))
                raise OutcomeError(
                    f"{source}: line {numbers[bad]}: has not as many values as the first line"
                )
            values = {name: [row[at] for row in rows] for name, at in columns.items()}
            yield _Rows(columns=values, unit="line", numbers=numbers)


def _check_header(source: Path, header: Sequence[str]) -> None:
    """Check that columns have names of their own.

    Raises:
        OutcomeError: two have the same.
    """
    twice = next((name for name in header if header.count(name) > 1), None)
    if twice is not None:
        raise OutcomeError(f"{source}: has two columns {twice!r}; rename one")
    if len(header) == 1 and any(sign in header[0] for sign in ";\t|"):
        raise OutcomeError(
            f"{source}: its first line {short_repr(header[0])} is one column; separate columns by"
            " commas"
        )


def _json_rows(source: Path, column_names: Sequence[str]) -> Iterator[_Rows]:
    with source.open(encoding="utf-8-sig") as file:
        first: set[str] | None = None
        numbered = ((number, line) for number, line in enumerate(file, 1) if not line.isspace())
        while batch := list(islice(numbered, _BATCH)):
            rows = [_json_object(source, number, line) for number, line in batch]
            if first is None:
                first = set(rows[0])
                check_spelling(str(source), list(rows[0]), column_names)
            columns = {
                name: [row.get(name) for row in rows] for name in column_names if name in first
            }
            for name in column_names:
                # A column that only some rows have would be left out without a word.
                late = next((at for at, row in enumerate(rows) if name in row), None)
                if name not in first and late is not None:
                    raise OutcomeError(
                        f"{source}: line {batch[late][0]}: has {name!r}, which the first line has"
                        " not; write it in every line"
                    )
            yield _Rows(columns=columns, unit="line", numbers=[number for number, _ in batch])


def _json_object(source: Path, number: int, line: str) -> dict[str, Any]:
    try:
        row: object = _DECODER.decode(line)
    except OutcomeError as error:
        raise OutcomeError(f"{source}: line {number}: {error}") from None
    except (ValueError, RecursionError) as error:
        reason = str(error)[:120]
        raise OutcomeError(f"{source}: line {number}: is not JSON ({reason})") from None
    if not isinstance(row, dict):
        raise OutcomeError(
            f"{source}: line {number}: is no object; write one object a line, with a key for each"
            " column"
        )
    return row


def _unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object of JSON.

    Raises:
        OutcomeError: a key is there twice, of which Python's parser keeps the last without a word.
    """
    row = dict(pairs)
    if len(row) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise OutcomeError(f"has the key {short_repr(twice)} twice; remove one")
    return row


_DECODER = json.JSONDecoder(object_pairs_hook=_unique_keys)


def _parquet_rows(source: Path, column_names: Sequence[str]) -> Iterator[_Rows]:
    require("a table in Parquet", ("pyarrow",))
    import pyarrow as pa
    from pyarrow import parquet

    try:
        file = parquet.ParquetFile(source)
        _check_header(source, file.schema_arrow.names)
        check_spelling(str(source), file.schema_arrow.names, column_names)
        columns = [name for name in file.schema_arrow.names if name in column_names]
        start = 1
        for batch in file.iter_batches(_BATCH, columns=columns):
            yield _arrow_rows(batch, range(start, start + batch.num_rows))
            start += batch.num_rows
    except pa.ArrowException as error:
        raise OutcomeError(f"{source}: is no Parquet ({error})") from None


_ROWS = {".csv": _csv_rows, ".jsonl": _json_rows, ".ndjson": _json_rows, ".parquet": _parquet_rows}
