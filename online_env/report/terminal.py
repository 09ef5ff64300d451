"""The report on a terminal: tables, a line about each agent, and the problems."""

import importlib
from collections.abc import Sequence
from io import StringIO
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from hijack_data.cli import console

from ..bench import costs, scores
from ..bench.progress import shorten
from ..bench.reading import ResultRecord, Run
from . import words
from .build import build_report
from .compare import RunComparison
from .document import ReportDocument
from .identity import agents_of, conditions_of
from .model import AgentSummary, Cell, RunReport
from .outcome import missing_line
from .paper import PaperTable
from .tables import compared_table, paper_rows

_MAIN = (
    "n",
    "success",
    "95 %",
    "delta",
    "95 %",
    "p",
    "retention",
    "errors",
    "invalid",
)
_BESIDE = (
    "ceiling",
    "pass^k",
    "seen at 80 %",
    "malformed",
    "steps",
    "seconds",
    "tokens in",
    "out",
    "USD",
)


def score_rows(run: Run, chosen: Sequence[ResultRecord]) -> list[scores.ScoreRow]:
    """Return the rows of the report's table, in the order of the configuration."""
    return scores.rows(chosen, agents_of(run.config), list(conditions_of(run.config)))


def show(run: Run, reference: str = "") -> None:
    """Print the report of a run; a run without episodes gives an empty table.

    Args:
        run: the run.
        reference: the reference agent of mCE; empty for none.
    """
    screen = console()
    if not run.records:
        screen.print(main_table(()))
        screen.print(missing_line(run), soft_wrap=True)
        return
    report = build_report(run, reference=reference)
    show_report(report, screen)
    final = list(scores.latest(run.records).values())
    if run.is_scored:
        importlib.import_module("online_env.scoring.tables").show_parts(run, screen)
    used = costs.usage_line(run.records)
    if used:
        screen.print(used, soft_wrap=True)
    _print_lines(report.notes, screen)
    for record in final:
        if record["status"] != "ok":
            problem = f"{record['status']}: {record.get('id')}: {record.get('problem')}"
            screen.print(shorten(problem), markup=False, soft_wrap=True)


def show_report(report: RunReport, screen: Any) -> None:
    """Print the tables of a report, and a line on each agent with corrupted episodes."""
    screen.print(main_table(report.cells))
    if report.feasible:
        screen.print(main_table(report.feasible, "feasible tasks"))
    if report.infeasible:
        screen.print(main_table(report.infeasible, "infeasible tasks"))
    screen.print(_beside(report.cells))
    for row in report.summaries:
        if row.corrupted is not None:
            worst = report.worst_of(row.agent)
            line = summary_line(row, report.reference, worst)
            screen.print(line, markup=False, soft_wrap=True)


def summary_line(
    row: AgentSummary,
    reference: str = "",
    worst: Sequence[str] = (),
) -> str:
    """Return an agent over all its conditions, in words; `worst` are its worst labels."""
    between = words.interval(row.corrupted_low, row.corrupted_high)
    more = words.given(row.given)
    named = f"{row.agent} (given {more})" if more else row.agent
    said = [
        f"{named}: corrupted {words.percent(row.corrupted)}",
        f"worst {words.worst(worst, row.worst_success)}",
    ]
    if between:
        said.append(f"95 % of corrupted {between}")
    if row.retention is not None:
        said.append(f"retention {words.percent(row.retention)}")
    if row.nine is not None:
        said.append(f"mean over the nine {words.percent(row.nine)}")
    if row.paper_average is not None:
        said.append(f"average with clean, as in the paper {words.percent(row.paper_average)}")
    if row.mce is not None:
        said.append(f"mCE {words.percent(row.mce)} (against {reference})")
    return ", ".join(said)


def main_table(cells: Sequence[Cell], title: str | None = None) -> Table:
    """Return success, difference to clean and retention of some cells."""
    table = _table(_MAIN, title)
    for cell in cells:
        table.add_row(
            escape(cell.agent),
            escape(cell.corruption),
            str(cell.n),
            words.percent(cell.success),
            words.interval(cell.ci_low, cell.ci_high),
            words.percent(cell.delta, "+"),
            words.interval(cell.delta_low, cell.delta_high, "+"),
            words.p_value(cell.p),
            words.percent(cell.retention),
            str(cell.errors),
            str(cell.invalid),
        )
    return table


def _beside(cells: Sequence[Cell]) -> Table:
    """Return a table of the other results; columns without a value are left out."""
    rows = [_beside_row(cell) for cell in cells]
    used = [place for place in range(len(_BESIDE)) if any(row[place] for row in rows)]
    table = _table([_BESIDE[place] for place in used], "beside it")
    for cell, row in zip(cells, rows, strict=True):
        values = [row[place] for place in used]
        table.add_row(escape(cell.agent), escape(cell.corruption), *values)
    return table


def _beside_row(cell: Cell) -> list[str]:
    seeds = len(cell.pass_hat)
    return [
        words.percent(cell.ceiling),
        f"{words.percent(cell.pass_hat[-1])} (k={seeds})" if seeds > 1 else "",
        words.percent(cell.detectable),
        words.percent(cell.malformed),
        words.number(cell.steps),
        words.number(cell.seconds),
        words.count(cell.input_tokens),
        words.count(cell.output_tokens),
        words.money(cell.usd),
    ]


def _table(headings: Sequence[str], title: str | None = None) -> Table:
    table = Table(
        box=None,
        header_style="bold",
        pad_edge=False,
        title=title,
        title_justify="left",
    )
    table.add_column("agent", overflow="fold")
    table.add_column("corruption", no_wrap=True)
    for name in headings:
        table.add_column(name, justify="right", no_wrap=True)
    return table


def text(document: ReportDocument) -> str:
    """Return a document as text, in the form for terminals but without colours."""
    out = StringIO()
    screen = Console(
        file=out,
        width=120,
        highlight=False,
        force_terminal=False,
    )
    show_document(document, screen)
    return out.getvalue()


def show_document(document: ReportDocument, screen: Any) -> None:
    """Print a report, or the comparison instead, and the requested additions."""
    report = document.report
    if document.comparison is not None:
        show_comparison(document.comparison, screen)
    else:
        show_report(report, screen)
        _print_lines(report.notes, screen)
    if document.paper is not None:
        show_paper(document.paper, screen)


def show_comparison(comparison: RunComparison, screen: Any) -> None:
    """Print the comparison of two runs, and its notes."""
    names = f"{comparison.before.name} before, {comparison.after.name} after"
    screen.print(_plain_table(*compared_table(comparison.cells), title=escape(names)))
    _print_lines(comparison.notes, screen)


def show_paper(paper: PaperTable, screen: Any) -> None:
    """Print the paper's table with ours below it; columns are cut to the width of the screen."""
    headings, rows = paper_rows(paper)
    short = [name.replace("_", " ") for name in headings]
    screen.print(_plain_table(short, rows, title="the paper's table, and ours below it"))
    _print_lines([paper.source + ".", *paper.notes], screen)


def _plain_table(
    headings: Sequence[str],
    rows: Sequence[Sequence[str]],
    title: str,
) -> Table:
    table = Table(
        box=None,
        header_style="bold",
        pad_edge=False,
        title=title,
        title_justify="left",
    )
    for name in headings:
        is_text = name in ("agent", "corruption")
        table.add_column(name, justify="left" if is_text else "right")
    for row in rows:
        table.add_row(*map(escape, row))
    return table


def _print_lines(lines: Sequence[str], screen: Any) -> None:
    for line in lines:
        screen.print(line, markup=False, soft_wrap=True)
