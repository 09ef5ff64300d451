"""The report on a terminal: the conclusion, the losses with their p, and the caveats.

Without `full` it fits a screen of `MAX_LINES` lines: what does not fit is counted and left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from io import StringIO
from typing import Any

from rich.cells import cell_len

from hijack_data.cli.figure_table import FigureTable, grouped
from hijack_data.cli.printable_console import PrintableConsole
from hijack_data.cli.terminal import console
from hijack_data.errors import quantity
from hijack_data.plan import CLEAN

from ..results import costs, scores
from ..results.outcomes import RESULTS
from ..results.reading import Run
from . import formatting
from .build import build_report
from .comparison import RunComparison
from .conclusions import conclude, report_extent, report_title
from .document import ReportDocument
from .further_tables import further_tables
from .further_tests import MARGIN
from .identity import agent_names, corruptions_by_label
from .model import AgentSummary, Cell, RunReport
from .outcome import missing_line
from .paper import PaperTable, compare_with_paper
from .parts_table import parts_table
from .tables import (
    app_cause_table,
    cause_table,
    compared_table,
    disturbed_lines,
    main_figures,
    paper_rows,
)
from .unplayable import counted_records

_MAIN = ("n", ("success", "95 %"), ("delta", "95 %", "p"), "retention", ("errors", "invalid"))
_FURTHER_HEADINGS = (
    "ceiling",
    "pass^k",
    "seen at 80 %",
    "malformed",
    ("steps", "seconds"),
    ("tokens in", "out", "USD"),
)

MAX_LINES = 58  # of the short form
# Why an interval may exclude zero where p does not show a loss.
P_NOTE = (
    "p is of the exact sign-flip test over tasks, adjusted for the corruptions of the agent (Holm);"
    " a loss is shown below 0.05. The 95 % intervals are not adjusted."
)
UNPAIRED_P_NOTE = P_NOTE.replace("the exact sign-flip test", "Welch's t test")
MIN_CAVEATS = 6  # lines that the tables leave for the caveats
MIN_ROWS = 5  # of the table of losses, however narrow the screen


@dataclass(frozen=True, kw_only=True)
class RunDetails:
    """What only the records of a run say, and a finished `report.json` does not.

    Attributes:
        parts: the parts of a scoring run; `None` for other runs.
        problems: lines about costs, and about each episode that is invalid or failed.
        has_infeasible: whether some tasks are infeasible.
    """

    parts: FigureTable | None = None
    problems: Sequence[str] = ()
    has_infeasible: bool = False


def score_rows(run: Run) -> list[scores.ScoreRow]:
    """Return the rows of the report's table, in the order of the configuration."""
    return scores.rows(
        counted_records(run), agent_names(run.config), list(corruptions_by_label(run.config))
    )


def show(
    run: Run,
    reference: str = "",
    *,
    paper: bool = False,
    full: bool = False,
    margin: float = MARGIN,
) -> None:
    """Print the report of a run; a run without episodes gives an empty table.

    Args:
        run: the run.
        reference: the reference agent of mCE; empty for none.
        paper: print the paper's table, with the agents below it.
        full: print every table, note and failed episode, not only what fits a screen.
        margin: the loss, a share, that equivalence tests refute.
    """
    screen = console()
    if not run.records:
        screen.print(main_table(()))
        screen.print(missing_line(run), soft_wrap=True)
        return
    report = build_report(run, reference=reference, full=full, margin=margin, causes=full)
    document = ReportDocument(
        report=report, paper=compare_with_paper(report) if paper else None, full=full
    )
    show_document(
        document,
        screen,
        RunDetails(
            parts=parts_table(run),
            problems=_problem_lines(run),
            has_infeasible=run.config.get("kind") != RESULTS
            and any(record.get("infeasible") for record in run.records),
        ),
    )


def _problem_lines(run: Run) -> list[str]:
    """Return costs, and each invalid or failed episode with why."""
    usage = "" if run.config.get("kind") == RESULTS else costs.usage_line(run.records)
    lines = [usage] if usage else []
    for record in run.failures:
        problem = f"{record['status']}: {record.get('id')}: {record.get('problem')}"
        lines.append(formatting.shorten(problem))
    return lines


def _show_short(report: RunReport, screen: Any, details: RunDetails) -> None:
    """Print what fits a screen: the conclusion, the losses with their p, and the caveats."""
    room = MAX_LINES - 1  # the last line says how to see the rest
    lines = [report_title(report), report_extent(report), "", *conclude(report)]
    excerpt = _cut(lines, MAX_LINES // 3, screen.width)
    _print_lines(excerpt, screen)
    room -= _height(excerpt, screen.width)
    table, is_whole = _short_table(report, screen, room - MIN_CAVEATS)
    screen.print("", table, sep="\n")
    room -= 1 + _table_height(table, screen)
    if details.parts is not None and _table_height(details.parts, screen) + MIN_CAVEATS < room:
        screen.print("", details.parts, sep="\n")
        room -= 1 + _table_height(details.parts, screen)
    caveats = [
        formatting.shorten(line) for line in (*_p_note(report), *report.notes, *details.problems)
    ]
    excerpt = _cut(caveats, room - 2, screen.width)
    if excerpt:
        _print_lines(["", *excerpt], screen)
    has_infeasible = bool(report.infeasible) or details.has_infeasible
    screen.print(f"\n--full: {_full_form_contents(is_whole, has_infeasible)}", soft_wrap=True)


def _full_form_contents(is_whole: bool, has_infeasible: bool) -> str:
    """Return what only the full form has."""
    parts = [] if is_whole else ["success and retention of every cell"]
    if has_infeasible:
        parts.append("feasible and infeasible tasks apart")
    return ", ".join(
        [*parts, "ceilings, pass^k, power, causes, steps, costs, equivalence and every note"]
    )


def _short_table(report: RunReport, screen: Any, room: int) -> tuple[FigureTable, bool]:
    """Return the table of all cells if it fits, else the losses alone, of the agents that fit."""
    if len(report.cells) < room:  # a row takes a line, at least
        table = main_table(report.cells)
        if _table_height(table, screen) <= room:
            return table, True
    agents = list(report.agents)
    labels = list(report.labels)
    while True:
        table = loss_table(report, agents, labels)
        excess = _table_height(table, screen) - room
        if excess <= 0 or (len(agents) == 1 and len(labels) <= MIN_ROWS):
            return table, False
        if len(agents) > 1:
            agents.pop()
        else:
            labels = _worst_labels(report, agents[0], len(labels) - max(1, excess))


def _worst_labels(report: RunReport, agent: str, count: int) -> list[str]:
    """Return clean and the labels of an agent with the greatest losses, in their order."""

    def delta(label: str) -> float:
        cell = report.cell(agent, label)
        if label == CLEAN:
            return -2.0  # before every loss
        return cell.delta if cell and cell.delta else 0.0

    worst = sorted(report.labels, key=delta)[: max(count, MIN_ROWS)]
    return [label for label in report.labels if label in worst]


def loss_table(report: RunReport, agents: Sequence[str], labels: Sequence[str]) -> FigureTable:
    """Return a row for each condition, and for each agent its loss with the p of its test."""
    rows = [
        (label, *(figure for agent in agents for figure in _loss_figures(report, agent, label)))
        for label in labels
    ]
    left_out = [
        quantity(len(names), noun)
        for names, noun in (
            (report.agents[len(agents) :], "agent"),
            (report.labels[len(labels) :], "condition"),
        )
        if names
    ]
    title = "success clean, and the difference to it in points with its p"
    if left_out:
        title += f" ({' and '.join(left_out)} left out)"
    return FigureTable("condition", [(agent, "p") for agent in agents], rows, title)


def _loss_figures(report: RunReport, agent: str, label: str) -> tuple[str, str]:
    cell = report.cell(agent, label)
    if cell is None:
        return "", ""
    if cell.delta is None:
        return f"{formatting.percent(cell.success)} %", ""
    return formatting.percent(cell.delta, "+"), formatting.p_value(cell.p)


def _table_height(table: Any, screen: Any) -> int:
    """Return the lines that a table takes on a screen."""
    out = StringIO()
    PrintableConsole(file=out, width=screen.width, force_terminal=False).print(table)
    return out.getvalue().count("\n")


def _height(lines: Sequence[str], width: int) -> int:
    """Return the lines of a screen that texts take, which the terminal breaks at its width."""
    return sum(max(1, -(-cell_len(line) // width)) for line in lines)


def _cut(lines: Sequence[str], room: int, width: int) -> list[str]:
    """Return the first lines that fit, and a line that says how many do not."""
    if _height(lines, width) <= room:
        return list(lines)
    head: list[str] = []
    while _height([*head, lines[len(head)]], width) < room:
        head.append(lines[len(head)])
    return [*head, f"... and {len(lines) - len(head)} more"]


def _show_full(report: RunReport, screen: Any, details: RunDetails) -> None:
    """Print the conclusion and all tables, notes and problems of a report."""
    _print_lines([report_title(report), report_extent(report), "", *conclude(report), ""], screen)
    screen.print(main_table(report.cells))
    if report.feasible:
        screen.print("", main_table(report.feasible, "feasible tasks"), sep="\n")
    if report.infeasible:
        screen.print("", main_table(report.infeasible, "infeasible tasks"), sep="\n")
    screen.print("", _further_table(report.cells), "", sep="\n")
    for table in further_tables(report):
        blocks = [*table.headings[2:]]
        screen.print(FigureTable("corruption", blocks, grouped(table.rows), table.title), "")
    for row in report.summaries:
        if row.corrupted is not None:
            worst = report.worst_corruptions(row.agent)
            line = summary_line(row, report.reference, worst)
            screen.print(line, markup=False, soft_wrap=True)
    if details.parts is not None:
        screen.print("", details.parts, "", sep="\n")
    if report.disturbed:
        screen.print()
        _print_lines(disturbed_lines(report), screen)
    for (_, label, *blocks), rows in (cause_table(report), app_cause_table(report)):
        if rows:
            screen.print("", FigureTable(label, blocks, grouped(rows), "why episodes were lost"))
            screen.print()
    _print_lines([*_p_note(report), *report.notes, *details.problems], screen)


def _p_note(report: RunReport) -> list[str]:
    if all(cell.p is None for cell in report.cells):
        return []
    return [P_NOTE if report.is_paired else UNPAIRED_P_NOTE]


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


def show_document(document: ReportDocument, screen: Any, details: RunDetails | None = None) -> None:
    """Print a report, or the comparison instead, and the requested additions.

    Args:
        document: what to print.
        screen: a rich console.
        details: what the records of the run say in addition.
    """
    if document.comparison is not None:
        show_comparison(document.comparison, screen)
    else:
        show = _show_full if document.full else _show_short
        show(document.report, screen, details or RunDetails())
    if document.paper is not None:
        screen.print()
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
