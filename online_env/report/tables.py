"""A report as JSON, as CSV and as Markdown."""

import csv
import io
import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, fields
from statistics import median
from typing import Any

from hijack_data.errors import quantity

from . import formatting
from .ablations import find_ablations, level_table
from .causes import CAUSES
from .comparison import ComparedCell, RunComparison
from .conclusions import conclude, report_extent, report_title
from .document import ReportDocument
from .further_tables import further_tables
from .model import AppSuccess, Cell, RunReport
from .paper import PaperTable

CELL_HEADINGS = (
    "agent",
    "corruption",
    "n",
    "success, %",
    "95 %",
    "delta",
    "95 %",
    "p",
    "retention, %",
    "ceiling, %",
    "malformed, %",
    "steps",
    "errors",
    "invalid",
)
SUMMARY_HEADINGS = (
    "agent",
    "given",
    "clean, %",
    "corrupted, %",
    "95 %",
    "retention, %",
    "95 %",
    "worst",
    "mean over the nine, %",
    "average as in the paper, %",
    "mCE, %",
    "ceiling, %",
)
COMPARED_HEADINGS = (
    "agent",
    "corruption",
    "n",
    "before, %",
    "after, %",
    "difference",
    "95 %",
    "p",
    "seen at 80 %",
)
_COUNT_COLUMNS = ("hidden",)  # columns of the parts that are counts, not shares
_FORMULA = ("=", "+", "-", "@", "\t", "\r")  # the characters that a formula may begin with
_MARKUP = "\\`*_[]<>|&~$#"
Texts = Sequence[str]


def as_json(document: ReportDocument) -> str:
    """Return the report in the form of `report.json`."""
    data = {**document.report.to_data(), **document.extras()}
    return json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False)


def as_csv(document: ReportDocument) -> str:
    """Return CSV with a line for each cell, or for each compared cell.

    Shares are 0..1; missing values are empty.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    compared = document.comparison
    rows: Sequence[Cell | ComparedCell] = compared.cells if compared else document.report.cells
    kind = ComparedCell if compared else Cell
    writer.writerow([entry.name for entry in fields(kind)])
    for row in rows:
        writer.writerow([_csv_value(value) for value in asdict(row).values()])
    return out.getvalue()


def as_markdown(document: ReportDocument) -> str:
    """Return conclusion, tables and notes as Markdown, such as for an issue or a model card."""
    report = document.report
    parts = [f"## {_safe(report_title(report))}", f"{_safe(report_extent(report))}."]
    parts += [*_bullet_list(conclude(report)), markdown_table(*summary_table(report))]
    if document.comparison is not None:
        parts += _comparison_parts(document.comparison)
    else:
        parts.append(markdown_table(*cell_table(report.cells)))
    if report.feasible and document.comparison is None:
        parts += ["Feasible tasks:", markdown_table(*cell_table(report.feasible))]
    if report.infeasible and document.comparison is None:
        parts += ["Infeasible tasks:", markdown_table(*cell_table(report.infeasible))]
    if report.applications:
        parts += ["By application, clean → corrupted:", markdown_table(*app_table(report))]
    if report.disturbed:
        parts += ["Why disturbed episodes were lost:", *_bullet_list(disturbed_lines(report))]
    if report.causes:
        parts += [markdown_table(*cause_table(report)), markdown_table(*app_cause_table(report))]
    for ablation in find_ablations(report):
        table = markdown_table(*level_table(report, ablation))
        parts += [f"### {_safe(ablation.title)}", table]
    if document.comparison is None:
        for title, headings, rows in further_tables(report):
            parts += [f"### {_safe(title)}", markdown_table(headings, rows)]
    if report.parts:
        parts += ["Right, by part:", markdown_table(*parts_table(report.parts))]
    if document.paper is not None:
        parts += ["### Beside the paper", markdown_table(*paper_rows(document.paper))]
        parts += _bullet_list([document.paper.source + ".", *document.paper.notes])
    parts += _bullet_list(report.notes)
    return "\n\n".join(parts)


def cell_table(cells: Sequence[Cell]) -> tuple[Texts, list[Texts]]:
    """Return headings and rows of some cells."""
    return CELL_HEADINGS, [
        (
            cell.agent,
            cell.corruption,
            *main_figures(cell),
            formatting.percent(cell.ceiling),
            formatting.percent(cell.malformed),
            formatting.number(cell.steps),
            str(cell.errors),
            str(cell.invalid),
        )
        for cell in cells
    ]


def main_figures(cell: Cell) -> list[str]:
    """Return n, success, the difference to clean with its p, and retention; with intervals."""
    return [
        str(cell.n),
        formatting.percent(cell.success),
        formatting.interval(cell.ci_low, cell.ci_high),
        formatting.percent(cell.delta, "+"),
        formatting.interval(cell.delta_low, cell.delta_high, "+"),
        formatting.p_value(cell.p),
        formatting.percent(cell.retention),
    ]


def summary_table(report: RunReport) -> tuple[Texts, list[Texts]]:
    """Return headings and rows of the agents."""
    return SUMMARY_HEADINGS, [
        (
            row.agent,
            formatting.privileged_inputs(row.given),
            formatting.percent(row.clean),
            formatting.percent(row.corrupted),
            formatting.interval(row.corrupted_low, row.corrupted_high),
            formatting.percent(row.retention),
            formatting.retention_interval(row.retention_low, row.retention_high),
            formatting.worst(report.worst_corruptions(row.agent), row.worst_success),
            formatting.percent(row.nine),
            formatting.percent(row.paper_average),
            formatting.percent(row.mce),
            formatting.percent(row.ceiling),
        )
        for row in report.summaries
    ]


def app_table(report: RunReport) -> tuple[Texts, list[Texts]]:
    """Return headings and rows of the applications: success clean and over all corruptions."""
    rows = {(row.app, row.agent): row for row in report.applications}
    apps = dict.fromkeys(row.app for row in report.applications)
    agents = [agent for agent in report.agents if any(row.agent == agent for row in rows.values())]
    return ("application", "tasks", *(f"{agent}, %" for agent in agents)), [
        (
            app or "none named",
            str(max(row.tasks for row in rows.values() if row.app == app)),
            *(_clean_and_corrupted(rows.get((app, agent))) for agent in agents),
        )
        for app in apps
    ]


def disturbed_lines(report: RunReport) -> list[str]:
    """Return a sentence on each agent: how much was disturbed at all, and lost."""
    lines: list[str] = []
    for row in report.disturbed:
        line = (
            f"{row.agent}: {row.disturbed} of {quantity(row.n, 'corrupted episode')} were"
            f" disturbed, and {row.lost} of these scored less than clean"
        )
        if row.unknown:
            line += f"; of {row.unknown} it is not known, because their steps are not there"
        lines.append(f"{line}.")
    return lines


def cause_table(report: RunReport) -> tuple[Texts, list[Texts]]:
    """Return headings and rows of the causes of lost episodes, and where these turned."""
    lost_by_agent = {row.agent: row.lost for row in report.disturbed}
    rows: list[Texts] = []
    for agent in lost_by_agent:
        for cause in CAUSES:
            causes = [row for row in report.causes if (row.agent, row.cause) == (agent, cause)]
            count = sum(row.n for row in causes)
            turns = [step for row in causes for step in row.turns]
            turned = f"{median(turns):g}" if turns else ""
            if count:
                share = formatting.percent(count / lost_by_agent[agent])
                rows.append((agent, cause, str(count), share, turned))
    return ("agent", "cause", "lost", "share, %", "turned at step (median)"), rows


def app_cause_table(report: RunReport) -> tuple[Texts, list[Texts]]:
    """Return headings and rows of how many episodes were lost by each cause in an application."""
    counts: dict[tuple[str, str], Counter[str]] = {}
    for row in report.causes:
        counts.setdefault((row.agent, row.app), Counter())[row.cause] += row.n
    return ("agent", "application", *CAUSES), [
        (agent, app or "none named", *(str(count[cause] or "") for cause in CAUSES))
        for (agent, app), count in sorted(counts.items())
    ]


def _clean_and_corrupted(row: AppSuccess | None) -> str:
    if row is None:
        return ""
    if row.corrupted is None:
        return formatting.percent(row.clean)
    return f"{formatting.percent(row.clean) or '–'} → {formatting.percent(row.corrupted)}"


def parts_table(rows: Sequence[Mapping[str, Any]]) -> tuple[Texts, list[Texts]]:
    """Return headings and rows of a scoring run's other results, in percent."""
    names = {key: None for row in rows for key in row}
    keys = [key for key in names if key not in ("agent", "corruption", "n")]
    headings = [key if key in _COUNT_COLUMNS else f"{key.replace('_', ' ')}, %" for key in keys]
    return ("agent", "corruption", "n", *headings), [
        (
            row["agent"],
            row["corruption"],
            str(row["n"]),
            *(_part(key, row.get(key)) for key in keys),
        )
        for row in rows
    ]


def compared_table(cells: Sequence[ComparedCell]) -> tuple[Texts, list[Texts]]:
    """Return headings and rows of a comparison."""
    return COMPARED_HEADINGS, [
        (
            cell.after if cell.before == cell.after else f"{cell.before} → {cell.after}",
            cell.corruption,
            str(cell.n),
            formatting.percent(cell.success_before),
            formatting.percent(cell.success_after),
            formatting.percent(cell.difference, "+"),
            formatting.interval(cell.low, cell.high, "+"),
            formatting.p_value(cell.p),
            formatting.percent(cell.detectable),
        )
        for cell in cells
    ]


def paper_rows(paper: PaperTable) -> tuple[Texts, list[Texts]]:
    """Return headings and rows of the paper's table and ours; two digits, as it is printed."""
    return ("agent", *paper.columns, "average"), [
        (
            f"{row.agent} (ours)" if row.ours else row.agent,
            *(_cents(row.success.get(label)) for label in paper.columns),
            _cents(row.average),
        )
        for row in paper.rows
    ]


def markdown_table(headings: Texts, rows: Sequence[Texts]) -> str:
    """Return a Markdown table; columns without a value are left out."""
    names, lines = without_empty_columns(headings, rows)
    numbers = [all(_is_number(row[column]) for row in lines) for column in range(len(names))]
    rule = " | ".join("---:" if number else "---" for number in numbers)
    return "\n".join([_line(names), f"| {rule} |", *map(_line, lines)])


def without_empty_columns(headings: Texts, rows: Sequence[Texts]) -> tuple[Texts, list[Texts]]:
    """Return a table without the columns in which no row has a value."""
    columns = [column for column in range(len(headings)) if any(row[column] for row in rows)]
    lines: list[Texts] = [[row[column] for column in columns] for row in rows]
    return [headings[column] for column in columns], lines


def _comparison_parts(comparison: RunComparison) -> list[str]:
    names = f"{_safe(comparison.before.name)} and then {_safe(comparison.after.name)}"
    table = markdown_table(*compared_table(comparison.cells))
    return [f"### {names}, the same cases", table, *_bullet_list(comparison.notes)]


def _bullet_list(notes: Sequence[str]) -> Iterator[str]:
    if notes:
        yield "\n".join(f"* {_safe(note)}" for note in notes)


def _line(cells: Texts) -> str:
    return f"| {' | '.join(map(_safe, cells))} |"


def _safe(text: str) -> str:
    """Return text with all characters escaped that are special in Markdown or HTML."""
    for character in _MARKUP:
        text = text.replace(character, f"\\{character}")
    return " ".join(text.split())


def _part(key: str, value: float | None) -> str:
    if value is None:
        return ""
    return str(value) if key in _COUNT_COLUMNS else formatting.percent(value)


def _is_number(text: str) -> bool:
    return not text or text[0] in "[+-<0123456789"


def _cents(share: float | None) -> str:
    return "" if share is None else f"{100 * share:.2f}"


def _csv_value(value: object) -> object:
    """Return a value in the form for CSV; several values are separated by spaces.

    A name that a spreadsheet would run as a formula gets an apostrophe before it.
    """
    if isinstance(value, str):
        return f"'{value}" if value.startswith(_FORMULA) else value
    return " ".join(map(str, value)) if isinstance(value, tuple) else value
