"""A report as one self-contained page, with its style and figures.

The colours and the type are those of the gallery and the viewer, light and dark.
"""

from collections.abc import Mapping
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

from hijack_data.gallery.markup import source
from hijack_data.plan import CLEAN

from ..extra import require
from ..results.outcomes import RESULTS
from . import formatting
from .ablations import find_ablations, level_table
from .causes import RULES
from .conclusions import conclude, report_extent, report_title
from .document import ReportDocument
from .figures import LEFT, RIGHT, WIDTH, retention_panels, success_panels
from .further_tables import further_tables
from .identity import RunIdentity
from .level_figure import grouped_panel
from .model import RunReport
from .tables import (
    app_cause_table,
    app_table,
    cause_table,
    cell_table,
    compared_table,
    disturbed_lines,
    paper_rows,
    parts_table,
    summary_table,
    without_empty_columns,
)

PAGE = Path(__file__).parent / "page"


def as_html(document: ReportDocument) -> str:
    """Return the page of a report."""
    report = document.report
    compared = document.comparison
    return render(
        "report.html",
        title=f"{report_title(report)}: AgentHijack report",
        heading=report_title(report),
        extent=report_extent(report),
        conclusions=conclude(report),
        document=document,
        report=report,
        facts=_facts(report.run),
        success=success_panels(report),
        retention=retention_panels(report),
        matrix=_matrix(report),
        ablations=[
            (ablation, grouped_panel(report, ablation), level_table(report, ablation))
            for ablation in find_ablations(report)
        ],
        summary=without_empty_columns(*summary_table(report)),
        cells=without_empty_columns(*cell_table(report.cells)),
        feasible=without_empty_columns(*cell_table(report.feasible)),
        infeasible=without_empty_columns(*cell_table(report.infeasible)),
        parts_found=without_empty_columns(*parts_table(report.parts)),
        applications=app_table(report) if report.applications else None,
        disturbed=disturbed_lines(report),
        causes=without_empty_columns(*cause_table(report)) if report.causes else None,
        app_causes=without_empty_columns(*app_cause_table(report)) if report.causes else None,
        rules=RULES,
        compared=without_empty_columns(*compared_table(compared.cells)) if compared else None,
        paper=paper_rows(document.paper) if document.paper else None,
        further=[
            (table.title, without_empty_columns(table.headings, table.rows))
            for table in further_tables(report)
        ],
        has_ceiling=any(cell.ceiling is not None for cell in report.cells),
    )


def render(template: str, **values: Any) -> str:
    """Fill a template of `page/`; values are escaped."""
    require("a report as a page", ("jinja2",))
    style = source("page.css") + (PAGE / "report.css").read_text(encoding="utf-8")
    return _templates().get_template(template).render(style=style, **values)


@cache
def _templates() -> Any:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    env = Environment(
        loader=FileSystemLoader(PAGE),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    env.filters.update(
        percent=formatting.percent,
        spaced=lambda label: str(label).replace("_", " "),
        short=lambda number: f"{number:.2f}".rstrip("0").rstrip("."),
    )
    env.globals.update(left=LEFT, width=WIDTH, right=RIGHT)
    return env


def _matrix(report: RunReport) -> list[tuple[str, list[Mapping[str, Any]]]]:
    """Return a row for each agent with the contents of the main table's cells."""
    return [
        (agent, [_matrix_cell(report, agent, label) for label in report.labels])
        for agent in report.agents
    ]


def _matrix_cell(report: RunReport, agent: str, label: str) -> Mapping[str, Any]:
    cell = report.cell(agent, label)
    if cell is None or cell.success is None:
        return {
            "value": "",
            "delta": "",
            "p": "",
            "share": 0,
            "lost": False,
            "title": f"{agent}, {label}: no episode that counts",
        }
    between = formatting.interval(cell.ci_low, cell.ci_high)
    return {
        "value": formatting.percent(cell.success),
        "delta": formatting.percent(cell.delta, "+") if label != CLEAN else "",
        "p": formatting.p_value(cell.p),
        "share": round(100 * cell.success),
        "lost": cell.p is not None and cell.p < formatting.SIGNIFICANT_P,
        "title": f"{agent}, {label}: {formatting.percent(cell.success)} % {between}, n {cell.n}",
    }


def _facts(run: RunIdentity) -> list[tuple[str, str]]:
    """Return how the run was played, as names and values."""
    seeds = ", ".join(map(str, run.seeds[:8])) + (" ..." if len(run.seeds) > 8 else "")
    began = ""
    if run.created is not None:
        began = datetime.fromtimestamp(run.created, UTC).strftime("%Y-%m-%d %H:%M UTC")
    facts = [
        ("made by", "" if run.kind == RESULTS else f"hijack {run.kind}"),
        ("of", run.source),
        ("begun", began),
        ("tasks", str(run.tasks)),
        ("seeds", seeds),
        ("desktop", run.provider),
        ("actions at most", "" if run.max_steps is None else str(run.max_steps)),
        ("recovery policy", run.recovery),
        ("guard", run.guard),
        ("SHA-256 of run.json", run.head_sha256),
        ("versions", ", ".join(f"{name} {version}" for name, version in run.versions.items())),
    ]
    return [(name, value) for name, value in facts if value]
