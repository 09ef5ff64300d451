"""Results for the page of a model on the Hugging Face Hub: `model-index` and `.eval_results`.

`model-index` goes into the YAML at the head of the card's README.md. A file of `.eval_results` also
puts the model on the leaderboard of the dataset that it names. Values are percent.
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
HUB_DATASET = "OWNER/agenthijack"  # to be replaced: a dataset of the benchmark on the Hub
_TOTAL = 100


def as_model_index(document: ReportDocument) -> str:
    """Return the block for every agent that is not a reference and was given nothing more.

    Raises:
        ReportError: the run has no such agent, or is none of this library.
    """
    report = document.report
    index = [_model(report, row) for row in _ranked_models(report, "model-index")]
    return yaml.safe_dump({"model-index": index}, sort_keys=False, allow_unicode=True, width=100)


def as_eval_results(document: ReportDocument) -> str:
    """Return a file for `.eval_results/` of a model's repository: success by condition.

    Raises:
        ReportError: the run has not exactly one agent that is no reference and was given nothing
            more.
    """
    report = document.report
    models = _ranked_models(report, "eval-results")
    if len(models) > 1:
        listed = ", ".join(row.agent for row in models)
        raise ReportError(
            f"--format eval-results: one model has one file, and {report.run.name} has {listed};"
            " report a run of one of them"
        )
    cells = [cell for cell in report.cells if cell.agent == models[0].agent]
    shares = {cell.corruption: cell.success for cell in cells} | {"all": models[0].corrupted}
    settings = ", ".join(f"{key} {value}" for key, value in _arguments(report))
    entries = [
        {
            "dataset": {"id": HUB_DATASET, "task_id": label},
            "value": round(_TOTAL * share, 2),
            "notes": f"success in percent; {_task_count(report)}; {settings}",
        }
        for label, share in shares.items()
        if share is not None
    ]
    text = yaml.safe_dump(entries, sort_keys=False, allow_unicode=True, width=100)
    return f"# Replace {HUB_DATASET} with the dataset of the benchmark on the Hub.\n{text}"


def _ranked_models(report: RunReport, format: str) -> list[AgentSummary]:
    if report.run.kind == RESULTS:
        raise ReportError(
            f"--format {format}: these are results of another harness, and the block says what"
            " AgentHijack measured; run hijack bench with the agent of the card"
        )
    contestants = (row for row in report.summaries if not row.given)
    models = [row for row in contestants if row.agent not in REFERENCE_AGENTS]
    if not models:
        listed = ", ".join(report.agents)
        raise ReportError(
            f"--format {format}: {report.run.name} has only reference agents ({listed}); run"
            " hijack bench with the agent of the card"
        )
    return models


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
        "guard": run.guard,
        "invalid_episodes": sum(row.invalid for row in report.summaries),
        "missing_episodes": run.missing,
        "damaged_records": run.damaged,
        "run_sha256": run.head_sha256,
    }
    yield from ((key, value) for key, value in settings.items() if value)


def _metric(kind: str, name: str, share: float | None) -> dict[str, Any]:
    value = round(_TOTAL * share, 2) if share is not None else None
    return {"type": kind, "name": name, "value": value}
