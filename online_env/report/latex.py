"""A report as a LaTeX table (booktabs) in the form of the paper's.

An agent has a row, a condition a column, and the best of each column is bold.
"""

from collections.abc import Sequence

from hijack_data.errors import quantity

from . import formatting
from .document import ReportDocument
from .model import AgentSummary, RunReport
from .paper import PaperRow, PaperTable

_SPECIAL = {
    "\\": r"\textbackslash{}",
    "&": r"\&",
    "%": r"\%",
    "$": r"\$",
    "#": r"\#",
    "_": r"\_",
    "{": r"\{",
    "}": r"\}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "[": "{[}",  # after the end of a row it would be a length
    "]": "{]}",
}
_Row = tuple[str, Sequence[float | None]]


def as_latex(document: ReportDocument) -> str:
    """Return one `table*`, which needs the package booktabs."""
    report = document.report
    if document.paper is not None:
        return _with_paper(document.paper, report)
    rows = [_agent_row(report, row) for row in report.summaries]
    headings = [*report.labels, "corrupted", "retention"]
    caption = f"Success in percent, {_escape(report.run.name)}: {report.run.tasks} tasks."
    return _table(headings, _body(rows), caption + _circumstances(report))


def _circumstances(report: RunReport) -> str:
    """Return the sentences that end the caption: recovery policy, guard, what does not count."""
    run = report.run
    sentences = f" Recovery policy: {_escape(run.recovery)}." if run.recovery else ""
    if run.guard:
        sentences += f" Every agent is watched by the guard {_escape(run.guard)}."
    invalid = sum(row.invalid for row in report.summaries)
    if invalid:
        sentences += f" Without {quantity(invalid, 'invalid episode')}."
    if run.missing:
        sentences += f" {run.missing} of {run.planned} episodes are missing."
    return sentences


def _agent_row(report: RunReport, row: AgentSummary) -> _Row:
    values: list[float | None] = []
    for label in report.labels:
        cell = report.cell(row.agent, label)
        values.append(cell.success if cell else None)
    return _agent_name(row), [*values, row.corrupted, row.retention]


def _agent_name(row: AgentSummary) -> str:
    """Return the name of an agent, with what it was given that others are not."""
    inputs = formatting.privileged_inputs(row.given)
    return f"{row.agent} (given {inputs})" if inputs else row.agent


def _with_paper(paper: PaperTable, report: RunReport) -> str:
    names = {row.agent: _agent_name(row) for row in report.summaries}
    paper_rows = [_paper_row(row, row.agent, paper.columns) for row in paper.rows if not row.ours]
    report_rows = [
        _paper_row(row, names.get(row.agent, row.agent), paper.columns)
        for row in paper.rows
        if row.ours
    ]
    body = [*_body(paper_rows, 2), r"\midrule", *_body(report_rows, 2)]
    caption = "Success in percent. Above the line: the paper, as printed; below it: ours."
    notes = [f"% {' '.join(note.split())}\n" for note in paper.notes]
    return "".join(notes) + _table(
        [*paper.columns, "average"], body, caption + _circumstances(report)
    )


def _paper_row(row: PaperRow, name: str, columns: Sequence[str]) -> _Row:
    return name, [*(row.success.get(label) for label in columns), row.average]


def _body(rows: Sequence[_Row], digits: int = 1) -> list[str]:
    """Return the lines of some agents; the best of each column is bold."""
    best = _best(rows) if len(rows) > 1 else []
    lines: list[str] = []
    for agent, values in rows:
        cells = [_cell(value, digits) for value in values]
        for index, value in enumerate(values):
            if best and value is not None and value == best[index]:
                cells[index] = rf"\textbf{{{cells[index]}}}"
        lines.append(f"{_escape(agent)} & {' & '.join(cells)} \\\\")
    return lines


def _best(rows: Sequence[_Row]) -> list[float | None]:
    columns = zip(*(values for _, values in rows), strict=True)
    column_values = [[value for value in column if value is not None] for column in columns]
    return [max(values, default=None) for values in column_values]


def _table(headings: Sequence[str], body: Sequence[str], caption: str) -> str:
    header = " & ".join(rf"\textbf{{{_escape(name.replace('_', ' '))}}}" for name in headings)
    lines = [
        r"% needs \usepackage{booktabs,graphicx}",
        r"\begin{table*}[t]",
        r"\centering",
        rf"\caption{{{caption}}}",
        r"\resizebox{\linewidth}{!}{%",
        rf"\begin{{tabular}}{{l{'r' * len(headings)}}}",
        r"\toprule",
        rf"\textbf{{Agent}} & {header} \\",
        r"\midrule",
        *body,
        r"\bottomrule",
        r"\end{tabular}}",
        r"\end{table*}",
    ]
    return "\n".join(lines)


def _cell(value: float | None, digits: int) -> str:
    return "--" if value is None else f"{100 * value:.{digits}f}"


def _escape(text: str) -> str:
    """Return text in which nothing is a command; on one line, since an empty one ends a cell."""
    line = " ".join(text.split())
    return "".join(_SPECIAL.get(character, character) for character in line)
