"""The block `model-index` of a model card on the Hugging Face Hub.

It goes into the YAML at the head of the card's README.md; the Hub shows its results on the page of
the model. Values are percent.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import yaml

from hijack_data.plan import CLEAN

from ..results.outcomes import RESULTS
from .document import ReportDocument
from .model import AgentSummary, Cell, ReportError, RunReport
from .named_scores import REFERENCE_AGENTS

TASK = {"type": "computer-use", "name": "Computer use"}
DATASET = "agenthijack"
_TOTAL = 100


def as_model_index(document: ReportDocument) -> str:
    """Return the block for every agent that is not a reference and was given nothing more.

    Raises:
        ReportError: the run has no such agent, or is none of this library.
    """
    report = document.report
    if report.run.kind == RESULTS:
        raise ReportError(
            "--format model-index: these are results of another harness, and the block says what"
            " AgentHijack measured; run hijack bench with the agent of the card"
        )
    contestants = (row for row in report.summaries if not row.given)
    models = [row for row in contestants if row.agent not in REFERENCE_AGENTS]
    if not models:
        listed = ", ".join(report.agents)
        raise ReportError(
            f"--format model-index: {report.run.name} has only reference agents ({listed}); run"
            " hijack bench with the agent of the card"
        )
    index = [_model(report, row) for row in models]
    return yaml.safe_dump({"model-index": index}, sort_keys=False, allow_unicode=True, width=100)


def _model(report: RunReport, row: AgentSummary) -> dict[str, Any]:
    cells = [cell for cell in report.cells if cell.agent == row.agent and cell.success is not None]
    results = [_cell_result(report, cell) for cell in cells]
    over_all = list(_overall_metrics(row))
    if over_all:
        results.append(_result(report, "all corruptions", "all", over_all))
    return {"name": row.agent, "results": results}


def _cell_result(report: RunReport, cell: Cell) -> dict[str, Any]:
    metrics = [_metric("success_rate", "Success, %", cell.success)]
    if cell.retention is not None:
        metrics.append(_metric("retention", "Retention of clean success, %", cell.retention))
    condition = "clean" if cell.corruption == CLEAN else f"corruption {cell.corruption}"
    return _result(report, condition, cell.corruption, metrics)


def _overall_metrics(row: AgentSummary) -> Iterator[dict[str, Any]]:
    if row.corrupted is not None:
        yield _metric("success_rate", "Mean success under corruption, %", row.corrupted)
    if row.retention is not None:
        yield _metric("retention", "Retention of clean success, %", row.retention)
    if row.paper_average is not None:
        yield _metric("average", "Average over clean and the nine, %", row.paper_average)


def _result(
    report: RunReport, condition: str, config: str, metrics: list[dict[str, Any]]
) -> dict[str, Any]:
    return {
        "task": dict(TASK),
        "dataset": {
            "type": DATASET,
            "name": f"AgentHijack ({_task_count(report)}), {condition}",
            "config": config,
            "split": "test",
            "args": dict(_arguments(report)),
        },
        "metrics": metrics,
    }


def _task_count(report: RunReport) -> str:
    run = report.run
    if run.kind == "score":
        return "offline steps"
    return f"{run.tasks} live tasks"


def _arguments(report: RunReport) -> Iterator[tuple[str, Any]]:
    """Yield the settings of the run, for comparisons."""
    run = report.run
    settings: Mapping[str, Any] = {
        "version": run.versions.get("agenthijack"),
        "provider": run.provider,
        "seeds": len(run.seeds),
        "max_steps": run.max_steps,
        "recovery": run.recovery,
        "missing_episodes": run.missing,
        "damaged_records": run.damaged,
        "run_sha256": run.head_sha256,
    }
    yield from ((key, value) for key, value in settings.items() if value)


def _metric(kind: str, name: str, share: float | None) -> dict[str, Any]:
    value = round(_TOTAL * share, 2) if share is not None else None
    return {"type": kind, "name": name, "value": value}
