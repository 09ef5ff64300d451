"""`hijack score`.

Exit codes: 0 done, 1 finished but something is missing, invalid, failed or damaged, 2 bad usage or
configuration, 3 the disk is full or fails.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from hijack_data.cli.completion import complete
from hijack_data.cli.options import BriefCommand, FiniteRange, new_run_options
from hijack_data.cli.printable_console import PrintableConsole
from hijack_data.cli.terminal import console, echo
from hijack_data.errors import ParameterError

from ..agents.options import agent_memory_option, in_process_option
from ..bench.config import Bench, override
from ..report.outcome import exit_code
from ..report.terminal import score_rows, show
from ..results import records
from ..results.parts import part_rows
from .cases import QUESTIONS, Case, Selection, choose_question
from .progress import ScoreDisplay
from .rules import NEAR, Distance
from .run import ROW_TIMEOUT_S, ScoreRun, ScoreSettings


@click.command(
    cls=BriefCommand,
    more=("agent_memory", "ask", "batch", "distance", "in_process", "split", "timeout", "workers"),
)
@click.argument("dataset", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option(
    "--agent",
    required=True,
    metavar="A,B",
    shell_complete=complete("online_env.agents.registry:AGENTS"),
    help="Agents: random, fail, my_agent.py:MyAgent, package.module:MyAgent.",
)
@new_run_options
@click.option(
    "--ask",
    type=click.Choice(QUESTIONS),
    help="What is asked; steps, or reminders of an export for onlookers, by default.",
)
@click.option(
    "--corruptions",
    metavar="A,B|all",
    help="Labels in the dataset; the clean rows are always scored with them.",
)
@click.option("--split", metavar="NAME", help="train, validation or test; all by default.")
@click.option(
    "--limit",
    type=click.IntRange(min=1),
    metavar="N",
    help="The rows of the first N trajectories only.",
)
@click.option(
    "--distance",
    default=str(NEAR),
    show_default=True,
    metavar="PIXELS|SHARE%",
    help="How far a point may be off where no box is known.",
)
@click.option(
    "--timeout",
    type=FiniteRange(min=0.01),
    default=ROW_TIMEOUT_S,
    show_default=True,
    metavar="S",
    help="Seconds an agent has for a row.",
)
@click.option(
    "--workers",
    type=click.IntRange(1, 256),
    default=1,
    show_default=True,
    metavar="N",
    help="How many agents answer side by side.",
)
@click.option(
    "--batch",
    type=click.IntRange(1, 1024),
    default=8,
    show_default=True,
    metavar="N",
    help="Rows at a time, for an agent with predict_batch.",
)
@in_process_option
@agent_memory_option
@click.option("--dry-run", is_flag=True, help="Say what would be scored, and score nothing.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON list.")
def score(
    dataset: Path,
    agent: str,
    out: Path | None,
    ask: str | None,
    corruptions: str | None,
    split: str | None,
    limit: int | None,
    distance: str,
    timeout: float,
    workers: int,
    batch: int,
    in_process: bool,
    agent_memory: float | None,
    resume: bool,
    dry_run: bool,
    as_json: bool,
) -> None:
    """Score agents on the rows of a dataset, clean and corrupted, without a desktop.

    Such as: hijack score my_dataset --agent my_agent.py:MyAgent -o runs/mine
    """
    settings = ScoreSettings(
        dataset=dataset,
        agents=override(Bench(), agent=agent).agents,
        question=choose_question(dataset, ask),
        selection=Selection(corruptions=_labels(corruptions), split=split, limit=limit),
        near=Distance.parse(distance),
        timeout=timeout,
        workers=workers,
        batch=batch,
        in_process=in_process,
        agent_memory=agent_memory or 0.0,
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
    remaining = run.left(out)
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
    rows = score_rows(run, run.records)
    joined = [{**parts.pop((row["agent"], row["corruption"]), {}), **row} for row in rows]
    return [*joined, *parts.values()]


def _print_plan(run: ScoreRun, as_json: bool) -> None:
    cases = run.cases
    counted: dict[str, int] = {}
    for case in cases.cases:
        counted[case.corruption] = counted.get(case.corruption, 0) + 1
    planned = {
        "question": run.settings.question,
        "agents": list(run.settings.agents),
        "rows": counted,
        "total": len(cases.cases) * len(run.settings.agents),
        "unscored": cases.unscored,
        "unpaired": cases.unpaired,
    }
    if as_json:
        echo(json.dumps(planned, indent=1))
        return
    listed = ", ".join(f"{label} {count}" for label, count in counted.items())
    echo(f"{planned['total']} rows for {', '.join(run.settings.agents)}: {listed}")
    if cases.unscored:
        echo(f"{cases.unscored} rows have an action of no known type and are not scored")
    if cases.unpaired:
        echo(f"{cases.unpaired} corrupted rows have no clean one")
