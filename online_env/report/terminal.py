"""The report on a terminal: tables, a line about each agent, and the problems."""

from collections.abc import Sequence
from io import StringIO
from typing import Any

from hijack_data.cli.figure_table import FigureTable, grouped
from hijack_data.cli.printable_console import PrintableConsole
from hijack_data.cli.terminal import console

from ..results import costs, scores
from ..results.reading import ResultRecord, Run
from . import formatting
from .build import build_report
from .compare import RunComparison
from .document import ReportDocument
from .identity import agent_names, corruptions_by_label
from .model import AgentSummary, Cell, RunReport
from .outcome import missing_line
from .paper import PaperTable
from .parts_table import show_parts
from .tables import compared_table, main_figures, paper_rows

_MAIN = ("n", ("success", "95 %"), ("delta", "95 %", "p"), "retention", ("errors", "invalid"))
_FURTHER_HEADINGS = (
    "ceiling",
    "pass^k",
    "seen at 80 %",
    "malformed",
    ("steps", "seconds"),
    ("tokens in", "out", "USD"),
)


def score_rows(run: Run, records: Sequence[ResultRecord]) -> list[scores.ScoreRow]:
    """Return the rows of the report's table, in the order of the configuration."""
    return scores.rows(records, agent_names(run.config), list(corruptions_by_label(run.config)))


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
        show_parts(run, screen)
    usage = costs.usage_line(run.records)
    if usage:
        screen.print(usage, soft_wrap=True)
    _print_lines(report.notes, screen)
    for record in final:
        if record["status"] != "ok":
            problem = f"{record['status']}: {record.get('id')}: {record.get('problem')}"
            screen.print(formatting.shorten(problem), markup=False, soft_wrap=True)


def show_report(report: RunReport, screen: Any) -> None:
    """Print the tables of a report, and a line on each agent with corrupted episodes."""
    screen.print(main_table(report.cells))
    if report.feasible:
        screen.print("", main_table(report.feasible, "feasible tasks"), sep="\n")
    if report.infeasible:
        screen.print("", main_table(report.infeasible, "infeasible tasks"), sep="\n")
    screen.print("", _further_table(report.cells), "", sep="\n")
    for row in report.summaries:
        if row.corrupted is not None:
            worst = report.worst_corruptions(row.agent)
            line = summary_line(row, report.reference, worst)
            screen.print(line, markup=False, soft_wrap=True)


def summary_line(row: AgentSummary, reference: str = "", worst: Sequence[str] = ()) -> str:
    """Return an agent over all its conditions, in words; `worst` are its worst labels."""
    between = formatting.interval(row.corrupted_low, row.corrupted_high)
    inputs = formatting.privileged_inputs(row.given)
    name = f"{row.agent} (given {inputs})" if inputs else row.agent
    parts = [
        f"{name}: corrupted {formatting.percent(row.corrupted)}",
        f"worst {formatting.worst(worst, row.worst_success)}",
    ]
    if between:
        parts.append(f"95 % of corrupted {between}")
    if row.retention is not None:
        parts.append(f"retention {formatting.percent(row.retention)}")
    if row.nine is not None:
        parts.append(f"mean over the nine {formatting.percent(row.nine)}")
    if row.paper_average is not None:
        parts.append(f"average with clean, as in the paper {formatting.percent(row.paper_average)}")
    if row.mce is not None:
        parts.append(f"mCE {formatting.percent(row.mce)} (against {reference})")
    return ", ".join(parts)


def main_table(cells: Sequence[Cell], title: str | None = None) -> FigureTable:
    """Return success, difference to clean and retention of some cells."""
    rows = [
        (cell.agent, cell.corruption, *main_figures(cell), str(cell.errors), str(cell.invalid))
        for cell in cells
    ]
    return FigureTable("corruption", _MAIN, grouped(rows), title)


def _further_table(cells: Sequence[Cell]) -> FigureTable:
    """Return ceiling, power and costs of some cells."""
    rows = [(cell.agent, cell.corruption, *_further_row(cell)) for cell in cells]
    return FigureTable("corruption", _FURTHER_HEADINGS, grouped(rows), "further results")


def _further_row(cell: Cell) -> list[str]:
    seeds = len(cell.pass_hat)
    return [
        formatting.percent(cell.ceiling),
        f"{formatting.percent(cell.pass_hat[-1])} (k={seeds})" if seeds > 1 else "",
        formatting.percent(cell.detectable),
        formatting.percent(cell.malformed),
        formatting.number(cell.steps),
        formatting.number(cell.seconds),
        formatting.count(cell.input_tokens),
        formatting.count(cell.output_tokens),
        formatting.money(cell.usd),
    ]


def text(document: ReportDocument) -> str:
    """Return a document as text, in the form for terminals but without colours."""
    out = StringIO()
    screen = PrintableConsole(file=out, width=120, highlight=False, force_terminal=False)
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
    (_, label, n, before, after, *difference, compared), rows = compared_table(comparison.cells)
    blocks = [n, (before, after), difference, compared]
    title = f"{comparison.before.name} before, {comparison.after.name} after"
    screen.print(FigureTable(label, blocks, grouped(rows), title))
    _print_lines(comparison.notes, screen)


def show_paper(paper: PaperTable, screen: Any) -> None:
    """Print the paper's table with ours below it."""
    (label, *headings), rows = paper_rows(paper)
    screen.print(FigureTable(label, headings, rows, "the paper's table, and ours below it"))
    _print_lines([paper.source + ".", *paper.notes], screen)


def _print_lines(lines: Sequence[str], screen: Any) -> None:
    for line in lines:
        screen.print(line, markup=False, soft_wrap=True)
