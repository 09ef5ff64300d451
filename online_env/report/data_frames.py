"""Compare agents and conditions in a data frame: pandas, polars, or any other table of Arrow."""

import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from hijack_data.errors import suggest
from hijack_data.plan import CLEAN

from ..extra import require
from ..results.outcome_formats import FIELDS
from ..results.outcome_readers.table import check_columns_differ, check_spelling, read_arrow
from ..results.outcomes import OutcomeError, merge_outcomes
from .build import build_report
from .conclusions import conclude
from .document import ReportDocument
from .model import Cell, RunReport
from .tables import as_markdown

_AGENT = "agent"  # its name where no column has one
_SOURCE = "a table"
_PACKAGES = ("pandas", "polars", "pyarrow")


@dataclass(frozen=True, repr=False)
class TableComparison:
    """Each condition of each agent in a table, compared with the clean one.

    Its repr is the conclusion and the table of results; notebooks show it as Markdown.

    Attributes:
        report: everything that `hijack report` would show of the table.
        package: `pandas`, `polars` or `pyarrow`: what `to_frame` returns.
    """

    report: RunReport
    package: str

    @property
    def cells(self) -> tuple[Cell, ...]:
        """A row for each agent and condition; shares are 0 to 1."""
        return self.report.cells

    @property
    def conclusions(self) -> list[str]:
        """A sentence on each agent: its worst condition, and which losses are shown."""
        return conclude(self.report)

    def to_frame(self) -> Any:
        """Return the cells as a data frame of the package that the table came from.

        Its columns are the attributes of `Cell`, without those that no cell has.
        """
        import pyarrow as pa

        rows = [asdict(cell) for cell in self.cells]
        for row in rows:
            row["pass_hat"] = list(row["pass_hat"]) or None
        names = [name for name in rows[0] if any(row[name] is not None for row in rows)]
        table = pa.Table.from_pylist([{name: row[name] for name in names} for row in rows])
        if self.package == "pandas":
            return table.to_pandas()
        if self.package == "polars":
            return sys.modules["polars"].from_arrow(table)  # the table came from it
        return table

    def __repr__(self) -> str:
        from .terminal import text

        return text(ReportDocument(report=self.report)).rpartition("\n\n--full")[0]

    def _repr_markdown_(self) -> str:
        return as_markdown(ReportDocument(report=self.report))


def compare(
    table: Any,
    *,
    task: str | None = None,
    score: str | None = None,
    condition: str | None = None,
    agent: str | None = None,
    seed: str | None = None,
    steps: str | None = None,
    tokens: str | None = None,
    cost: str | None = None,
    clean: str = CLEAN,
    common_tasks: bool = False,
    unpaired: bool = False,
) -> TableComparison:
    """Compare the conditions of each agent in a table with the clean one, case by case.

    The table has a row for each episode, as a file of `hijack report`. Cases are paired by task and
    seed; intervals and tests rest on how far tasks differ.

    Args:
        table: a data frame of pandas or polars, a table of pyarrow, or a mapping of columns.
        task: the column of the task; each argument up to `cost` is by default the column of that
            name. Rows of one task are one case in statistics.
        score: the column of the score, 0 to 1; a row without a score is invalid, never 0.
        condition: the column of what was done to the desktop; without it all rows are clean.
        agent: the column of the agent; without it all rows are of one.
        seed: the column of the repetition; without it the rows of a task are numbered in order.
        steps: the column of how many actions an episode took; a missing value is not known, as for
            the next two.
        tokens: the column of its tokens.
        cost: the column of its cost in USD.
        clean: the condition with which the others are compared.
        common_tasks: compare over the tasks that all conditions share, instead of refusing sets of
            tasks that differ.
        unpaired: compare the conditions as samples of different tasks.

    Raises:
        OutcomeError: a column is missing, a value is no result, or conditions cannot be paired.
        MissingDependencyError: pyarrow or scipy is not installed.
    """
    require("a comparison of a table", ("pyarrow", "scipy"))
    arrow = _arrow_table(table)
    columns = {
        "task": task,
        "score": score,
        "condition": condition,
        "agent": agent,
        "seed": seed,
        "steps": steps,
        "tokens": tokens,
        "cost": cost,
    }
    named_columns = {field: column for field, column in columns.items() if column is not None}
    _check_columns(arrow.column_names, named_columns)
    names = {field: named_columns.get(field, field) for field in FIELDS}
    present = {field: name for field, name in names.items() if name in arrow.column_names}
    check_columns_differ(present)
    check_spelling("the table", arrow.column_names, list(names.values()))
    run = merge_outcomes(
        {"the table": read_arrow(arrow, present, _AGENT)},
        folder=Path(_SOURCE),
        name=_SOURCE,
        clean=clean,
        common_tasks=common_tasks,
        unpaired=unpaired,
    )
    return TableComparison(build_report(run), _package(table))


def _arrow_table(table: Any) -> Any:
    """Return a table of pyarrow.

    Raises:
        OutcomeError: it is none, or a column has values of several kinds.
    """
    import pyarrow as pa

    try:
        if _package(table) == "pandas":
            return pa.Table.from_pandas(table, preserve_index=False)
        if isinstance(table, pa.Table):
            return table
        if isinstance(table, Mapping) or hasattr(table, "__arrow_c_stream__"):
            return pa.table(table)
    except (pa.ArrowException, AttributeError, TypeError, ValueError) as error:
        raise OutcomeError(f"the table cannot be read: {error}") from None
    raise OutcomeError(
        f"a table is a data frame of pandas or polars, a table of pyarrow or a mapping of columns,"
        f" not {type(table).__name__}"
    )


def _package(table: Any) -> str:
    name = type(table).__module__.partition(".")[0]
    return name if name in _PACKAGES else "pyarrow"


def _check_columns(present: list[str], named_columns: Mapping[str, str]) -> None:
    """Check that a table has the columns that are stated or required.

    Raises:
        OutcomeError: it has not.
    """
    required = {"task": "task", "score": "score"} | dict(named_columns)
    for field, column in required.items():
        if present.count(column) > 1:
            raise OutcomeError(f"the table has two columns {column!r}; rename one")
        if column not in present:
            raise OutcomeError(
                f"the table has no column {column!r}{suggest(column, present)}; name that of the"
                f" {field}: compare(table, {field}=...)"
            )
