"""The paper's main table as data, for comparison with a report.

The numbers are in `paper.yaml`, as printed, with their source.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import ROUND_HALF_UP, Decimal
from functools import cache
from pathlib import Path
from statistics import fmean
from typing import Any

import yaml

from hijack_data.plan import CLEAN

from .identity import NINE
from .model import AgentSummary, ReportError, RunReport

FILE = Path(__file__).parent / "paper.yaml"
COLUMNS = (CLEAN, *NINE)
_TOTAL = 100
_CENT = Decimal("0.01")


@dataclass(frozen=True, kw_only=True)
class PaperRow:
    """An agent in the paper's table, or an agent of a report.

    Attributes:
        agent: its name.
        success: share, 0..1, by column; a column that was not played is left out.
        average: the printed "Average", 0..1; of ours, the mean over the ten columns, if all are
            there.
        ours: whether it is ours.
        solved_of: the number of tasks of which all its rates are whole numbers, where there is
            one among 300 to 369; the paper has 369 tasks.
    """

    agent: str
    success: Mapping[str, float]
    average: float | None = None
    ours: bool = False
    solved_of: int | None = None


@dataclass(frozen=True, kw_only=True)
class PaperTable:
    """The paper's table, with the agents of a report.

    Attributes:
        source: where the numbers are printed.
        columns: the conditions, in the order of the paper.
        rows: the paper's agents, then ours.
        notes: sentences that are needed to compare them.
    """

    source: str
    columns: tuple[str, ...] = COLUMNS
    rows: tuple[PaperRow, ...] = ()
    notes: tuple[str, ...] = field(default_factory=tuple)


@cache
def paper_table() -> PaperTable:
    """Return the paper's table without agents of a report."""
    data: dict[str, Any] = yaml.safe_load(FILE.read_text(encoding="utf-8"))
    rows = [_row(name, entry) for name, entry in data["agents"].items()]
    notes = [f"The paper: {data['tasks']}.", *_slips(data)]
    notes += _whole(rows)
    return PaperTable(
        source=data["source"], columns=tuple(data["columns"]), rows=tuple(rows), notes=tuple(notes)
    )


def compare_with_paper(report: RunReport) -> PaperTable:
    """Return the paper's table with the agents of a report below it.

    Raises:
        ReportError: the run has none of the paper's ten conditions under its own name.
    """
    paper = paper_table()
    ours = [_own(report, summary) for summary in report.summaries]
    if not any(row.success for row in ours):
        raise ReportError(
            f"--paper: {report.run.name} has none of the paper's conditions under its own name"
            f" ({', '.join(COLUMNS)}); run hijack bench ... --corruptions all"
        )
    return PaperTable(
        source=paper.source,
        columns=paper.columns,
        rows=(*paper.rows, *ours),
        notes=(*_differences(report), *paper.notes),
    )


def _row(name: str, entry: Mapping[str, Any]) -> PaperRow:
    rates: list[float] = entry["success"]
    return PaperRow(
        agent=name,
        success={label: rate / _TOTAL for label, rate in zip(COLUMNS, rates, strict=True)},
        average=entry["average"] / _TOTAL,
        solved_of=_denominator(rates),
    )


def _own(report: RunReport, summary: AgentSummary) -> PaperRow:
    success: dict[str, float] = {}
    for cell in report.cells:
        label = cell.corruption
        named = report.run.corruptions.get(label, label) == label
        if cell.agent == summary.agent and label in COLUMNS and named and cell.success is not None:
            success[label] = cell.success
    complete = len(success) == len(COLUMNS)
    return PaperRow(
        agent=summary.agent,
        success=success,
        average=fmean(success.values()) if complete else None,
        ours=True,
    )


def _denominator(rates: Sequence[float]) -> int | None:
    """Return the only number of tasks that makes all rates whole numbers of tasks, or `None`."""
    fitting = [tasks for tasks in range(300, 370) if all(_is_whole(rate, tasks) for rate in rates)]
    return fitting[0] if len(fitting) == 1 else None


def _is_whole(rate: float, tasks: int) -> bool:
    solved = round(rate / _TOTAL * tasks)
    return round(_TOTAL * solved / tasks, 2) == rate


def _slips(data: Mapping[str, Any]) -> Iterator[str]:
    """Yield the rows whose printed average is not the rounded mean of their columns."""
    for name, entry in data["agents"].items():
        rates = [Decimal(str(rate)) for rate in entry["success"]]
        mean = sum(rates, Decimal(0)) / len(rates)
        rounded = mean.quantize(_CENT, ROUND_HALF_UP)
        printed = Decimal(str(entry["average"])).quantize(_CENT)
        if rounded != printed:
            yield f"The paper prints {printed} as the average of {name}; its columns give {mean}."


def _whole(rows: Sequence[PaperRow]) -> Iterator[str]:
    found = [row for row in rows if row.solved_of is not None]
    for row in found:
        yield f"All rates of {row.agent} are whole numbers of {row.solved_of} tasks, not of 369."
    if found:
        yield "Those of the other agents are whole numbers of no count from 300 to 369."


def _differences(report: RunReport) -> Iterator[str]:
    run = report.run
    if run.kind == "score":
        yield (
            "Ours are steps of recorded trajectories, scored one by one; the paper's are whole"
            " tasks. Compare the losses, not the levels."
        )
    else:
        where = f" on the provider {run.provider!r}" if run.provider else ""
        yield f"Ours: {run.tasks} tasks{where}. Other tasks, so compare the losses, not the levels."
    if run.changed:
        yield f"Not with the paper's parameters: {', '.join(run.changed)}."
