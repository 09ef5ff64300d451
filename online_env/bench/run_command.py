"""What `hijack bench` does: plan a run, play what is missing, and show the result."""

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from hijack_data import extras
from hijack_data.cli.terminal import console, echo
from hijack_data.errors import HijackError, ParameterError, StorageError, quantity, shorten_list
from hijack_data.locking import Lock
from hijack_data.runs import seal

from ..agents.guards import check_guard, find_guard
from ..agents.makers import asks_for_reinit
from ..agents.registry import AGENTS
from ..choices import DrawingLayer, ErrorOrder, Recovery
from ..environment.script import check_plans
from ..errors import CostLimitError
from ..report.outcome import exit_code
from ..report.terminal import show
from ..results import costs, records
from ..results.stop_rule import SequentialTest
from ..tasks import TASKS, find_family
from .config import (
    Bench,
    at_severities,
    bench_from_data,
    end_at_retention,
    load_bench,
    on_machines,
    override,
)
from .episodes import LiveEpisodes
from .estimates import estimate, history_near
from .jobs import Job, attempts, jobs
from .models import ModelOptions, check_agents, model_locations, prepare
from .plan_set import PlanSet, read_plan_set
from .playable import check_machines, only_playable
from .pools import LOCAL, EpisodePool, open_pool
from .progress import ProgressDisplay
from .providers import check_installed
from .runner import needs_attempt, run_jobs
from .sample_size import sample_size_lines
from .workers import LocalPool, WorkerSetup, default_desktops, open_stage, references


def run_command(
    *,
    config: str | None,
    plans: Path | None,
    out: Path | None,
    agent: str | None,
    tasks: str | None,
    corruptions: str | None,
    severities: str | None,
    seeds: int | None,
    desktops: int | None,
    max_steps: int | None,
    recovery: Recovery | None,
    environment_errors: ErrorOrder | None,
    layer: DrawingLayer | None,
    osworld_files: str | None,
    vm: tuple[str, ...],
    machines: int,
    vm_options: tuple[str, ...],
    reset_command: str,
    unplayable: str,
    engine: str,
    ray_address: str | None,
    resume: bool,
    prompts: Path | None,
    max_cost: float | None,
    until_retention: float | None,
    replay: Path | None,
    guard: str | None,
    in_process: bool,
    agent_memory: float | None,
    sign: str | None,
    dry_run: bool,
    detect: float | None,
) -> None:
    """Run a benchmark; the arguments are the options of `hijack bench`.

    Raises:
        HijackError: The run is refused.
        SystemExit: With the exit code, once the run is over.
        UsageError: `out` is missing, or an option makes another one idle.
    """
    plan_set = None if plans is None else read_plan_set(plans)
    benchmark = override(
        _load(config, plans, plan_set, agent),
        agent,
        tasks,
        corruptions,
        seeds,
        osworld_files,
        recovery,
        environment_errors,
        max_steps,
        layer,
    )
    benchmark = replace(
        at_severities(benchmark, severities),
        guard=find_guard(guard) if guard else "",
        in_process=in_process,
        agent_memory=agent_memory or 0.0,
    )
    if plan_set is not None:
        _check_plans(plans, plan_set, benchmark)
    if benchmark.text_boxes:
        extras.require("text_boxes", "ocr", ("rapidocr", "onnxruntime"))
    benchmark = on_machines(benchmark, vm, machines, vm_options, reset_command)
    benchmark = only_playable(benchmark, unplayable, echo)
    benchmark = end_at_retention(benchmark, until_retention)
    _warn_of_too_few_tasks(benchmark)
    _warn_of_tasks_without_plan(benchmark)
    _warn_of_unanswered_requests(benchmark)
    check_agents(benchmark)
    check_guard(benchmark.guard, benchmark.agents)
    models = ModelOptions(prompts=prompts, replay=replay, max_cost=max_cost)
    prepare(benchmark, models, None)
    planned_jobs = jobs(benchmark)
    if detect is not None:
        if not dry_run:
            raise click.UsageError("--detect plans a run; give it with --dry-run")
        at_once = desktops or _room(benchmark)
        for line in sample_size_lines(benchmark, detect, history_near(out), at_once):
            echo(line)
        return
    if dry_run:
        remaining = (
            planned_jobs if out is None else _remaining_jobs(benchmark, planned_jobs, out, resume)
        )
        if remaining:
            _check_here(benchmark, engine, len(remaining))
            _print_plan(benchmark, remaining, desktops, out)
        else:
            echo(f"{out}: all {len(planned_jobs)} episodes are there")
        return
    if out is None:
        raise click.UsageError("--out RUNS: say where the records go (or --dry-run)")
    if sign is not None:
        seal.check_key(sign)
    run = play_run(benchmark, out, models, resume, engine, desktops, ray_address)
    show(run)
    if sign is not None:
        seal.sign(out, sign)
    raise SystemExit(exit_code(run))


def _load(
    config: str | None, plans: Path | None, plan_set: PlanSet | None, agent: str | None
) -> Bench:
    """Return the benchmark of a file, with the corruptions of a set of plans if there is one.

    Without `--agent`, plans are played by the agent for which they were searched.

    Raises:
        HijackError: One of the files is wrong.
        UsageError: There is no benchmark, or it has another agent than the set of plans.
    """
    if plan_set is None:
        if config is None:
            raise click.UsageError("Missing argument 'CONFIG'")
        return load_bench(config)
    if config is None and plan_set.bench is None:
        raise click.UsageError(
            f"{plans} was found over the rows of a dataset: name a CONFIG to play it live, or"
            f" score it with hijack score DATASET --plans {plans}"
        )
    base = load_bench(config) if config else bench_from_data(plan_set.bench or {}, str(plans))
    if agent is None and config is None:
        try:
            base = override(base, agent=plan_set.agent)
        except HijackError as error:
            raise click.UsageError(
                f"{plans} was searched for the agent {plan_set.agent!r}, which is not known here"
                f" ({error}); name it, or another, with --agent"
            ) from None
    if agent is None and plan_set.agent not in base.agents:
        raise click.UsageError(
            f"{plans} was searched for the agent {plan_set.agent!r}, and {config} plays"
            f" {', '.join(base.agents)}; say with --agent which one plays"
        )
    return replace(base, corruptions=plan_set.planners)


def _check_plans(plans: Path | None, plan_set: PlanSet, benchmark: Bench) -> None:
    """Print what is luck when a set of plans is played again.

    Raises:
        UsageError: None of its corruptions is played.
    """
    labels = [plan.label for plan in plan_set.plans]
    if not any(label in benchmark.planners for label in labels):
        raise click.UsageError(f"--corruptions names none of {plans} ({', '.join(labels)})")
    notice = plan_set.selection_notice(benchmark.agents)
    if notice:
        _notice(f"{plans}: {notice}")


def play_run(
    benchmark: Bench,
    out: Path,
    models: ModelOptions,
    resume: bool = False,
    engine: str = LOCAL,
    desktops: int | None = None,
    ray_address: str | None = None,
) -> records.Run:
    """Play the episodes of a benchmark that are missing in a folder, and return the run.

    Args:
        benchmark: The benchmark.
        out: The folder of the run.
        models: The options of the command line about models.
        resume: Whether to go on with a run that is there.
        engine: `"local"` or `"ray"`.
        desktops: The most desktops; by default as many as fit.
        ray_address: A running cluster.

    Raises:
        HijackError: The run is refused.
        Abort: It was interrupted by Ctrl-C.
    """
    prepare(benchmark, models, out)
    planned_jobs = jobs(benchmark)
    _check_here(benchmark, engine, len(planned_jobs))
    setup = _setup(benchmark, out, models)
    with (
        open_pool(engine, setup, len(planned_jobs), desktops, ray_address, _notice) as pool,
        _begin_run(benchmark, planned_jobs, out, resume, pool.desktops),
    ):
        return _run(benchmark, planned_jobs, out, pool, models)


def _print_plan(
    benchmark: Bench, remaining: Sequence[Job], desktops: int | None, out: Path | None
) -> None:
    """Print the episodes that would be played, with an estimate."""
    at_once = min(desktops or _room(benchmark), len(remaining))
    for job in remaining:
        echo(str(job))
    expected = estimate(benchmark, remaining, at_once, history_near(out))
    echo(f"{_size_text(remaining, at_once)}, {expected}")


def _remaining_jobs(
    benchmark: Bench, planned_jobs: Sequence[Job], out: Path, resume: bool
) -> Sequence[Job]:
    """Return what a run in a folder would still play.

    Raises:
        RunError: The run would be refused.
    """
    ids = [job.id for job in planned_jobs]
    if not records.check_folder(out, benchmark.to_data(), ids, goes_on=resume):
        return planned_jobs
    return _due_jobs(benchmark, attempts(planned_jobs, records.read(out).records))


def _due_jobs(benchmark: Bench, earlier: Mapping[Job, Sequence[records.ResultRecord]]) -> list[Job]:
    """Return the jobs that need another attempt, given the earlier ones of each."""
    test = _test(benchmark, earlier)
    is_over = test is not None and test.is_over
    return [
        job
        for job, attempt_records in earlier.items()
        if needs_attempt(attempt_records, benchmark.retries)
        and not (is_over and not attempt_records)
    ]


def _test(
    benchmark: Bench, earlier: Mapping[Job, Sequence[records.ResultRecord]]
) -> SequentialTest | None:
    """Return the test that ends a run early, if there is one."""
    if benchmark.until_retention is None:
        return None
    earlier_records = [record for attempt_records in earlier.values() for record in attempt_records]
    ids = [job.id for job in earlier]
    return SequentialTest(benchmark.until_retention, benchmark.to_data(), ids, earlier_records)


def _warn_of_too_few_tasks(benchmark: Bench) -> None:
    """Print that a run cannot end at its bound, even if its agent loses nothing."""
    rule = benchmark.until_retention
    if rule is not None and len(benchmark.tasks) < rule.tasks_needed:
        _notice(
            f"--until-retention {rule.retention:g} cannot be shown with"
            f" {quantity(len(benchmark.tasks), 'task')}: {rule.tasks_needed} are needed even if"
            " nothing is lost, so the run plays all; name more with --tasks, or a lower bound"
        )


def _warn_of_tasks_without_plan(benchmark: Bench) -> None:
    """Print which tasks an agent cannot do because nobody has written their plan."""
    followers = [name for name in benchmark.agents if getattr(AGENTS.get(name), "uses_plan", False)]
    if not followers:
        return
    unplanned = [name for name in benchmark.tasks if not TASKS.get(name)(0).has_plan]
    if unplanned:
        _notice(
            f"{' and '.join(followers)} can only follow plans in words, and there is none for"
            f" {quantity(len(unplanned), 'task')} of {len(benchmark.tasks)}, which score 0:"
            f" {shorten_list(unplanned, 6)}; leave them out with --tasks"
        )


def _warn_of_unanswered_requests(benchmark: Bench) -> None:
    """Print which agents will ask for a re-initialisation that changes nothing."""
    if benchmark.recovery != "none":
        return
    names = [name for name in benchmark.asked_agents if asks_for_reinit(AGENTS.get(name))]
    if names:
        _notice(
            f"{' and '.join(names)} may ask for re-initialisation, which changes nothing under"
            " recovery: none; --recovery reset sets the task up again, as in the paper"
        )


def _begin_run(
    benchmark: Bench, planned_jobs: Sequence[Job], out: Path, resume: bool, desktops: int
) -> Lock:
    return records.begin(
        out,
        benchmark.to_data(),
        [job.id for job in planned_jobs],
        goes_on=resume,
        notice=_notice,
        desktops=desktops,
    )


def _size_text(listed: Sequence[Job], desktops: int) -> str:
    """Return how many episodes are played on how many desktops."""
    return f"{quantity(len(listed), 'episode')} on {quantity(desktops, 'desktop')}"


def _run(
    benchmark: Bench,
    planned_jobs: Sequence[Job],
    out: Path,
    pool: EpisodePool,
    models: ModelOptions,
) -> records.Run:
    earlier = attempts(planned_jobs, records.read(out).records)
    remaining = _due_jobs(benchmark, earlier)
    screen = console()
    expected = ""
    if remaining:
        expected = f", {estimate(benchmark, remaining, pool.desktops, history_near(out))}"
    screen.print(
        f"{_size_text(remaining, pool.desktops)}{expected}; recovery policy: {benchmark.recovery}",
        soft_wrap=True,
    )
    if remaining:
        try:
            _play(benchmark, planned_jobs, out, earlier, pool, models)
        except CostLimitError as error:
            echo(f"hijack: {error}", err=True)
        except KeyboardInterrupt:
            _print_records_kept(out)
            raise click.Abort from None
        except StorageError:
            _print_records_kept(out)
            raise
    return records.read(out)


def _print_records_kept(out: Path) -> None:
    count = len(records.read(out).records)
    message = f"the {count} episodes that ended are kept: hijack report {out}"
    echo(f"\n{message}; --resume goes on", err=True)


def _play(
    benchmark: Bench,
    planned_jobs: Sequence[Job],
    out: Path,
    earlier: Mapping[Job, Sequence[records.ResultRecord]],
    pool: EpisodePool,
    models: ModelOptions,
) -> None:

    finished = sum(not needs_attempt(earlier[job], benchmark.retries) for job in planned_jobs)
    display = ProgressDisplay(planned_jobs, console(), finished)
    budget = _budget(benchmark, out, models.max_cost)

    def run(episodes: Callable[[Job, int], records.ResultRecord], stop: Any = None) -> None:
        run_jobs(
            planned_jobs,
            out,
            benchmark.retries,
            episodes,
            display,
            earlier,
            at_once=pool.max_episodes,
            stop=stop or (lambda: None),
            budget=budget,
            reserve=pool.reserve,
            test=_test(benchmark, earlier),
        )

    with display:
        if isinstance(pool, LocalPool) and pool.max_episodes == 1:
            with _local_episodes(benchmark, out) as episodes:
                run(episodes)
        else:
            run(pool, pool.stop)
            pool.stop()


def _budget(benchmark: Bench, out: Path, limit: float | None) -> costs.Budget | None:
    """Return the remaining budget of a run; its journal is read once to compute it."""
    if limit is None:
        return None
    return costs.Budget(limit, records.read(out).records, model_locations(benchmark))


def _notice(text: str) -> None:
    echo(f"hijack: {text}", err=True)


def _room(benchmark: Bench) -> int:
    """Return how many episodes can be played side by side."""
    if benchmark.machines is not None:
        return len(benchmark.machines.single_machines())
    return default_desktops()


def _check_here(benchmark: Bench, engine: str, episodes: int) -> None:
    """Check that the run's episodes can be played here; nodes of Ray check themselves.

    Raises:
        ParameterError: Tasks of a family are to be played on a cluster, or a corruption cannot work
            on a desktop of this size. That of a user's machine is not known yet.
    """
    if benchmark.machines is None:
        planners = benchmark.planners.values()
        check_plans(planners, benchmark.max_steps, benchmark.size, benchmark.layer)
    family = find_family(benchmark.tasks)
    if family is None:
        if engine == LOCAL:
            check_installed(benchmark.provider, benchmark.tasks)
        return
    if engine != LOCAL:
        raise ParameterError(
            f"{family.title}'s tasks are played from this machine; leave out --engine {engine},"
            " and name the machines with --vm"
        )
    check_machines(benchmark, episodes)


@contextlib.contextmanager
def _local_episodes(benchmark: Bench, out: Path) -> Iterator[LiveEpisodes]:
    """Play episodes from this process; with `--in-process` a debugger can follow the agent."""
    with open_stage(benchmark, out) as stage, LiveEpisodes(benchmark, out, stage) as episodes:
        yield episodes


def _setup(benchmark: Bench, out: Path, models: ModelOptions) -> WorkerSetup:
    """Return the settings that another process needs to play episodes."""
    return WorkerSetup(
        bench=benchmark, folder=out.resolve(), references=references(benchmark), models=models
    )
