"""What `hijack score` does: ask agents about the rows that are left, and show the result."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from hijack_data.cli.printable_console import PrintableConsole
from hijack_data.cli.terminal import console, echo
from hijack_data.errors import ParameterError

from ..agents.guards import find_guard
from ..bench.config import Bench, override
from ..bench.plan_set import PlanSet, read_plan_set
from ..report.outcome import exit_code
from ..report.terminal import score_rows, show
from ..results import records
from ..results.parts import part_rows
from .cases import Case, RowPlans, Selection, choose_question
from .progress import ScoreDisplay
from .rules import Distance
from .run import ScoreRun, ScoreSettings


def run_command(
    *,
    dataset: Path,
    agent: str,
    out: Path | None,
    ask: str | None,
    plans: Path | None,
    corruptions: str | None,
    split: str | None,
    limit: int | None,
    distance: str,
    timeout: float,
    workers: int,
    batch: int,
    guard: str | None,
    in_process: bool,
    agent_memory: float | None,
    resume: bool,
    dry_run: bool,
    as_json: bool,
) -> None:
    """Score agents; the arguments are the options of `hijack score`.

    Raises:
        HijackError: The run is refused.
        SystemExit: With the exit code, once the run is over.
        UsageError: `out` is missing.
    """
    agents = override(Bench(), agent=agent).agents
    plan_set = None if plans is None else read_plan_set(plans)
    notice = "" if plan_set is None else plan_set.selection_notice(agents)
    if notice:
        echo(f"hijack: {plans}: {notice}", err=True)
    settings = ScoreSettings(
        dataset=dataset,
        agents=agents,
        question=choose_question(dataset, ask),
        selection=Selection(corruptions=_labels(corruptions), split=split, limit=limit),
        near=Distance.parse(distance),
        timeout=timeout,
        workers=workers,
        batch=batch,
        guard=find_guard(guard) if guard else "",
        in_process=in_process,
        agent_memory=agent_memory or 0.0,
        plans=None if plan_set is None else _row_plans(plan_set),
    )
    run = ScoreRun(settings)
    if dry_run:
        _print_plan(run, as_json)
        return
    if out is None:
        raise click.UsageError("--out RUNS: say where the records go (or --dry-run)")
    with run.begin(out, resume, lambda text: echo(f"hijack: {text}", err=True)):
        _score(run, out, console(stderr=as_json))
    scored_run = records.read(out)
    if as_json:
        echo(json.dumps(_rows(scored_run), indent=1))
    else:
        show(scored_run)
    raise SystemExit(exit_code(scored_run))


def _row_plans(plan_set: PlanSet) -> RowPlans:
    """Return the corruptions of a set of plans, with the draws of a search over rows."""
    seed = plan_set.search.get("seed", 0) if plan_set.bench is None else 0
    return RowPlans(planners=plan_set.planners, seed=seed)


def _labels(text: str | None) -> tuple[str, ...] | None:
    """Return the labels of an option.

    Raises:
        ParameterError: one is given twice, or is empty.
    """
    if text is None or text.strip() == "all":
        return None
    labels = tuple(name.strip() for name in text.split(","))
    for label in labels:
        if not label or labels.count(label) > 1:
            raise ParameterError(f"--corruptions: {label!r} is empty or given twice: {text!r}")
    return labels


def _score(run: ScoreRun, out: Path, screen: PrintableConsole) -> None:
    remaining = run.remaining_cases(out)
    total = sum(map(len, remaining.values()))
    screen.print(f"{total} rows to score ({_counts_text(remaining)})", markup=False)
    display = ScoreDisplay(total, screen)
    try:
        with display:
            run.play(out, remaining, display.tick, display.notice)
    except KeyboardInterrupt:
        count = len(records.read(out).records)
        message = f"the {count} rows that were scored are kept: hijack report {out}"
        echo(f"\n{message}; --resume goes on", err=True)
        raise click.Abort from None


def _counts_text(remaining: Mapping[str, Sequence[Case]]) -> str:
    return ", ".join(f"{agent} {len(cases)}" for agent, cases in remaining.items())


def _rows(run: records.Run) -> list[dict[str, Any]]:
    """Return the rows of the report, with the parts of each."""
    parts = {(row["agent"], row["corruption"]): row for row in part_rows(run.records)}
    rows = score_rows(run)
    joined = [{**parts.pop((row["agent"], row["corruption"]), {}), **row} for row in rows]
    return [*joined, *parts.values()]


def _print_plan(run: ScoreRun, as_json: bool) -> None:
    cases = run.cases
    rows_by_label: dict[str, int] = {}
    for case in cases.cases:
        rows_by_label[case.corruption] = rows_by_label.get(case.corruption, 0) + 1
    summary = {
        "question": run.settings.question,
        "agents": list(run.settings.agents),
        "rows": rows_by_label,
        "total": len(cases.cases) * len(run.settings.agents),
        "unscored": cases.unscored,
        "unchanged": cases.unchanged,
        "unpaired": cases.unpaired,
    }
    if as_json:
        echo(json.dumps(summary, indent=1))
        return
    listed = ", ".join(f"{label} {count}" for label, count in rows_by_label.items())
    echo(f"{summary['total']} rows for {', '.join(run.settings.agents)}: {listed}")
    if cases.unscored:
        echo(f"{cases.unscored} rows have an action of no known type and are not scored")
    if cases.unchanged:
        echo(f"{cases.unchanged} corrupted rows have the clean picture and are not scored")
    if cases.unpaired:
        echo(f"{cases.unpaired} corrupted rows have no clean one")
