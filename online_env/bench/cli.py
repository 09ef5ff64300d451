"""`hijack bench` and `hijack report`.

Exit codes: 0 done, 1 finished but something is missing, invalid, failed or damaged, 2 bad usage or
configuration, 3 the disk is full or fails.
"""

import contextlib
import importlib
import json
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hijack_data.cli import console
from hijack_data.locking import Lock
from hijack_data.runs import seal

from ..errors import CostLimitError
from . import costs, records, scores
from .progress import ProgressDisplay, shorten

if TYPE_CHECKING:
    from .config import Bench
    from .episodes import LiveEpisodes
    from .jobs import Job
    from .models import ModelOptions
    from .pools import EpisodePool
    from .workers import WorkerSetup

_HEADINGS = (
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


@click.command()
@click.argument("config")
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    metavar="RUNS",
    help="Folder of the run: new.",
)
@click.option(
    "--agent",
    metavar="A,B",
    help=(
        "Agents, instead of those of CONFIG: oracle, do_nothing, my_agent.py:MyAgent,"
        " package.module:MyAgent, my_agent.yaml, gpt-4o."
    ),
)
@click.option(
    "--tasks",
    metavar="A,B",
    help="Tasks, instead of those of CONFIG: write_note, my_task.py:MyTask.",
)
@click.option(
    "--corruptions",
    metavar="A,B|all",
    help="Labels of CONFIG or names; all is clean and every corruption.",
)
@click.option(
    "--seeds",
    type=click.IntRange(1, 10_000),
    metavar="N",
    help="Seeds 0 to N-1, instead of CONFIG's.",
)
@click.option(
    "--desktops",
    type=click.IntRange(1, 256),
    metavar="N",
    help="Desktops side by side; by default as many as cores and memory allow.",
)
@click.option(
    "--engine",
    type=click.Choice(("local", "ray")),
    default="local",
    show_default=True,
    help="Where the desktops are: on this machine, or on the nodes of a Ray cluster.",
)
@click.option(
    "--ray-address",
    metavar="auto|HOST:PORT",
    help="A running Ray cluster; by default RAY_ADDRESS, or a Ray that is started and ended here.",
)
@click.option("--resume", is_flag=True, help="Go on with the run in RUNS where it was broken off.")
@click.option(
    "--prompts",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Prompts of models that replace ours by name.",
)
@click.option(
    "--max-cost",
    type=click.FloatRange(0),
    metavar="USD",
    help="Begin no episode once the models have cost that much; --resume goes on.",
)
@click.option(
    "--replay",
    type=click.Path(path_type=Path),
    metavar="RUNS",
    help="Take the models' answers from the log of an earlier run.",
)
@click.option("--sign", metavar="KEY", help="Sign the run at its end with this SSH key.")
@click.option("--dry-run", is_flag=True, help="List the episodes with an estimate, and run none.")
def bench(
    config: str,
    out: Path | None,
    agent: str | None,
    tasks: str | None,
    corruptions: str | None,
    seeds: int | None,
    desktops: int | None,
    engine: str,
    ray_address: str | None,
    resume: bool,
    prompts: Path | None,
    max_cost: float | None,
    replay: Path | None,
    sign: str | None,
    dry_run: bool,
) -> None:
    """Run agents on a live desktop, clean and corrupted.

    Such as: hijack bench embedded_small --out runs/small
    """
    from .config import load_bench, override  # brings the web sites; a report needs none
    from .jobs import estimate, jobs
    from .models import ModelOptions, prepare
    from .pools import LOCAL, open_pool
    from .providers import check_installed
    from .workers import default_desktops

    chosen = override(load_bench(config), agent, tasks, corruptions, seeds)
    models = ModelOptions(
        prompts=prompts,
        replay=replay,
        max_cost=max_cost,
    )
    prepare(chosen.agents, models, None if dry_run else out)
    listed = jobs(chosen)
    if dry_run:
        at_once = min(desktops or default_desktops(), len(listed))
        for job in listed:
            click.echo(str(job))
        click.echo(f"{len(listed)} episodes, {estimate(chosen, listed, at_once)}")
        return
    if out is None:
        raise click.UsageError("--out RUNS: say where the records go (or --dry-run)")
    if sign is not None:
        seal.check_key(sign)
    if engine == LOCAL:  # a node looks for itself
        check_installed(chosen.provider, chosen.tasks)
    setup = _setup(chosen, out, models)
    with (
        open_pool(engine, setup, len(listed), desktops, ray_address) as pool,
        _begun(chosen, listed, out, resume),
    ):
        code = _run(chosen, listed, out, pool, models)
    if sign is not None:
        seal.sign(out, sign)
    raise SystemExit(code)


def _begun(
    chosen: "Bench",
    listed: "Sequence[Job]",
    out: Path,
    resume: bool,
) -> Lock:
    begin = records.resume if resume else records.create
    return begin(out, chosen.to_data(), [job.id for job in listed])


def _run(
    chosen: "Bench",
    listed: "Sequence[Job]",
    out: Path,
    pool: "EpisodePool",
    models: "ModelOptions",
) -> int:
    from .jobs import attempts, estimate
    from .runner import needs_attempt

    earlier = attempts(listed, records.read(out).records)
    left = [job for job in listed if needs_attempt(earlier[job], chosen.retries)]
    screen = console()
    expected = estimate(chosen, left, pool.desktops)
    screen.print(
        f"{len(left)} episodes on {pool.desktops} desktops, {expected}; recovery policy:"
        f" {chosen.recovery}",
    )
    if left:
        try:
            _play(chosen, listed, out, earlier, pool, models)
        except CostLimitError as error:
            click.echo(f"hijack: {error}", err=True)
        except KeyboardInterrupt:
            done = len(records.read(out).records)
            kept = f"the {done} episodes that ended are kept: hijack report {out}"
            click.echo(f"\n{kept}; --resume goes on", err=True)
            raise click.Abort from None
    run = records.read(out)
    show(run)
    return exit_code(run)


def _play(
    chosen: "Bench",
    listed: "Sequence[Job]",
    out: Path,
    earlier: "Mapping[Job, Sequence[records.ResultRecord]]",
    pool: "EpisodePool",
    models: "ModelOptions",
) -> None:
    from .runner import run_jobs
    from .workers import LocalPool

    teller = ProgressDisplay(listed, console())

    def run(episodes: "Callable[[Job, int], records.ResultRecord]", stop: Any = None) -> None:
        run_jobs(
            listed,
            out,
            chosen.retries,
            episodes,
            teller,
            earlier,
            pool.most,
            stop or (lambda: None),
            lambda: costs.check_cost(out, models.max_cost),
            pool.place,
        )

    with teller:
        if isinstance(pool, LocalPool) and pool.most == 1:
            with _here(chosen, out) as episodes:
                run(episodes)
        else:
            run(pool, pool.stop)
            pool.stop()


@contextlib.contextmanager
def _here(chosen: "Bench", out: Path) -> "Iterator[LiveEpisodes]":
    """Play in this process, where a debugger can follow an agent."""
    from ..embedded.runtime import masks
    from ..environment import SmallTasks
    from .episodes import LiveEpisodes
    from .providers import PROVIDERS

    masks.hide(out)
    with PROVIDERS.get(chosen.provider)(chosen.size) as desktop:
        yield LiveEpisodes(chosen, out, SmallTasks(desktop))


def _setup(
    chosen: "Bench",
    out: Path,
    models: "ModelOptions",
) -> "WorkerSetup":
    """Return what another process needs."""
    from .workers import WorkerSetup, references

    return WorkerSetup(
        bench=chosen,
        folder=out.resolve(),
        references=references(chosen),
        models=models,
    )


@click.command()
@click.argument("runs", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="Print a list of rows.")
def report(runs: Path, as_json: bool) -> None:
    """Show the results of a run, such as: hijack report runs/small."""
    run = records.read(runs)
    for damage in run.damaged:
        click.echo(
            f"hijack: {runs / damage.file}:{damage.line}: skipped: {damage.problem}", err=True
        )
    if as_json:
        click.echo(json.dumps(score_rows(run, run.records), indent=1))
    else:
        show(run)
    if run.missing:
        click.echo(f"hijack: {runs}: {_missing(run)}", err=True)
    raise SystemExit(exit_code(run))


def exit_code(run: records.Run) -> int:
    """Return 1 if something is missing, damaged, invalid or failed, else 0."""
    final = scores.latest(run.records).values()
    bad = any(record["status"] != "ok" for record in final)
    return 1 if run.damaged or run.missing or bad else 0


def _missing(run: records.Run) -> str:
    there = f"{run.planned - run.missing} of {run.planned} planned episodes are there"
    command = "score" if run.is_scored else "bench"
    return f"{there}, {run.missing} are missing; hijack {command} ... --resume runs them"


def score_rows(run: records.Run, chosen: Sequence[records.ResultRecord]) -> list[scores.ScoreRow]:
    """Return the rows of the report's table, in the order of the configuration."""
    agents = _entries(run.config.get("agents"))
    corruptions = _entries(run.config.get("corruptions"))
    return scores.rows(chosen, list(agents), list(corruptions))


def _entries(listed: Any) -> dict[str, str]:
    """Return what a list of the configuration names, by label, in its order."""
    found: dict[str, str] = {}
    if not isinstance(listed, list):
        return found
    for entry in listed:
        name = entry
        settings = None
        if isinstance(entry, dict) and len(entry) == 1:
            ((name, settings),) = entry.items()
        label = settings.get("as", name) if isinstance(settings, dict) else name
        found[str(label)] = str(name)
    return found


def show(run: records.Run) -> None:
    """Print the table of a run, its recovery policy, and what went wrong.

    Feasible and infeasible tasks also get tables of their own.
    """
    screen = console()
    screen.print(_table(run, run.records))
    infeasible = [record for record in run.records if record.get("infeasible")]
    if infeasible:
        screen.print(
            _table(run, [r for r in run.records if not r.get("infeasible")], "feasible tasks")
        )
        screen.print(_table(run, infeasible, "infeasible tasks"))
    final = list(scores.latest(run.records).values())
    if not scores.can_infer():
        screen.print("without intervals and tests: scipy and statsmodels are not installed")
    _show_summaries(run)
    early = 0
    if run.is_scored:
        importlib.import_module("online_env.scoring.tables").show_parts(run, screen)
    else:
        _show_recovery(run, final)
        early = scores.unreached(final, _entries(run.config.get("corruptions")))
    used = costs.usage_line(run.records)
    if used:
        screen.print(used, soft_wrap=True)
    if early:
        screen.print(
            f"{early} episodes with a score ended before their corruption was due: they count as"
            " they are"
        )
    if run.missing:
        screen.print(_missing(run), soft_wrap=True)
    for record in final:
        if record["status"] != "ok":
            problem = f"{record['status']}: {record.get('id')}: {record.get('problem')}"
            screen.print(shorten(problem), markup=False, soft_wrap=True)


def _table(
    run: records.Run,
    chosen: Sequence[records.ResultRecord],
    title: str | None = None,
) -> Any:
    from rich.markup import escape
    from rich.table import Table

    table = Table(
        box=None,
        header_style="bold",
        pad_edge=False,
        title=title,
        title_justify="left",
    )
    for name in ("agent", "corruption"):
        table.add_column(name)
    for name in _HEADINGS:
        table.add_column(name, justify="right")
    for row in score_rows(run, chosen):
        cells = [
            str(row["n"]),
            _percent(row["success"]),
            _interval(row["ci_low"], row["ci_high"]),
            _percent(row["delta"], sign="+"),
            _interval(row["delta_low"], row["delta_high"], sign="+"),
            "" if row["p"] is None else f"{row['p']:.3f}",
            _percent(row["retention"]),
            str(row["errors"]),
            str(row["invalid"]),
        ]
        table.add_row(escape(row["agent"]), escape(row["corruption"]), *cells)
    return table


def _show_summaries(run: records.Run) -> None:
    """Print a line on each agent with corrupted episodes."""
    for row in scores.summaries(score_rows(run, run.records)):
        if row["corrupted"] is None:
            continue
        worst = f"worst {row['worst']} {_percent(row['worst_success'])}"
        average = f"average with clean, as in the paper {_percent(row['paper_average'])}"
        click.echo(f"{row['agent']}: corrupted {_percent(row['corrupted'])}, {worst}, {average}")


def _show_recovery(run: records.Run, final: Sequence[records.ResultRecord]) -> None:
    counted: Counter[str] = Counter()
    for record in final:
        recovery = record.get("recovery")
        if not isinstance(recovery, dict):
            continue
        counted.update({key: n for key, n in recovery.items() if isinstance(n, int)})
    policy = run.config.get("recovery", "unknown")
    asked = f"asked for {counted['requests']} times, {counted['false_alarms']} of them false alarms"
    click.echo(f"recovery policy: {policy} ({asked}, {counted['repaired']} repaired)")


def _percent(share: float | None, sign: str = "") -> str:
    return "" if share is None else f"{100 * share:{sign}.1f}"


def _interval(
    low: float | None,
    high: float | None,
    sign: str = "",
) -> str:
    if low is None or high is None:
        return ""
    return f"[{_percent(low, sign)}, {_percent(high, sign)}]"
