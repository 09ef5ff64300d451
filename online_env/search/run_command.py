"""What `hijack search` does: search, confirm, and write `worst.json`."""

import importlib.metadata
from collections.abc import Mapping
from pathlib import Path

import click

from hijack_data import extras
from hijack_data.cli.terminal import echo
from hijack_data.corruption import SETS, Corruption, make_corruption
from hijack_data.errors import ParameterError, quantity
from hijack_data.types import Size

from ..bench.config import Bench, load_bench, override
from ..bench.models import check_agents
from ..bench.plan_set import Loss, PlanSet, WorstPlan
from ..scoring.cases import Selection, open_feed
from ..scoring.run import ScoreSettings
from .players import LivePlayer, RowPlayer
from .search import SearchSettings, begin, search
from .space import SearchSpace


def run_search(
    *,
    source: str,
    agent: str,
    out: Path | None,
    resume: bool,
    budget: int,
    tasks: str | None,
    seeds: int | None,
    corruptions: str | None,
    pairs: bool,
    keep: int,
    seed: int,
    limit: int | None,
    workers: int | None,
    desktops: int | None,
    dry_run: bool,
) -> None:
    """Search; the arguments are the options of `hijack search`.

    Raises:
        HijackError: The search is refused.
        UsageError: `out` is missing, or an option is for the other kind of search.
    """
    extras.require("hijack search", "search", ("optuna",))
    if out is None and not dry_run:
        raise click.UsageError("--out DIR: say where the search goes (or --dry-run)")
    out = out or Path()
    is_dataset = Path(source).is_dir()
    if is_dataset:
        _check_options({"tasks": tasks, "seeds": seeds, "desktops": desktops}, "live searches")
    else:
        _check_options({"limit": limit, "workers": workers}, "the rows of a dataset")
    space = SearchSpace(_names(corruptions, is_dataset), pairs)
    settings = SearchSettings(space=space, budget=budget, seed=seed, keep=keep)
    chosen: Bench = override(Bench(), agent=agent)
    if len(chosen.agents) != 1:
        raise ParameterError(f"--agent: a search is for one agent, got {agent!r}")
    about = {
        "corruptions": list(space.names),
        "pairs": pairs,
        "budget": budget,
        "seed": seed,
        "keep": keep,
        "optuna": importlib.metadata.version("optuna"),
    }
    player: LivePlayer | RowPlayer
    if is_dataset:
        dataset = Path(source)
        scored = ScoreSettings(
            dataset=dataset,
            agents=chosen.agents,
            workers=workers or 1,
            selection=Selection(limit=limit),
        )
        player = RowPlayer(scored, seed, _screen_size(dataset), out)
        about = {**about, "rows": player.cases, "held_out": player.held_out, "limit": limit}
        bench_data = None
    else:
        bench = override(load_bench(source), agent, tasks, None, seeds)
        check_agents(bench)
        player = LivePlayer(bench, out, desktops)
        about = {**about, "held_out_seeds": list(player.held_out_seeds)}
        both = (*bench.seeds, *player.held_out_seeds)
        bench_data = {**bench.to_file_data(), "seeds": list(both)}
    count = settings.count_trials(player)
    echo(
        f"{quantity(count, 'corruption')} on {quantity(player.cases, 'case')}, the worst {keep} of"
        f" them on {player.held_out} others"
    )
    if dry_run:
        return
    if isinstance(player, LivePlayer):
        player.check(map(make_corruption, space.names))
    begin(out, {**about, "source": source, "agent": agent, "bench": bench_data}, resume)
    try:
        plans = search(player, settings, out, echo)
    except KeyboardInterrupt:
        raise click.Abort from None
    plan_set = PlanSet(
        agent=chosen.agents[0], search=about, bench=bench_data, size=player.size, plans=plans
    )
    path = out / "worst.json"
    plan_set.write(path)
    _show(plans)
    if plans:
        replay = f"score {source}" if is_dataset else "bench"
        echo(f"{path}; again: hijack {replay} --plans {path} --agent {agent} --out RUNS")


def _check_options(options: Mapping[str, object], use: str) -> None:
    """Check that no option is for the other kind of search.

    Raises:
        UsageError: One is.
    """
    for name, value in options.items():
        if value is not None:
            raise click.UsageError(f"--{name} is for {use}; leave it out")


def _names(text: str | None, is_dataset: bool) -> tuple[str, ...]:
    """Return the corruptions of an option; by default all that can be played.

    Raises:
        UnknownNameError: There is no such corruption.
        ParameterError: One is given twice, or is no corruption with its default parameters.
    """
    planners = override(Bench(), corruption=text or ",".join(("all", *SETS))).planners
    names: list[str] = []
    for label, planner in planners.items():
        if planner is None or (text is None and is_dataset and (planner.effects or planner.inputs)):
            continue
        if not isinstance(planner, Corruption) or planner.name != label:
            raise ParameterError(
                f"--corruptions: {label!r} is not the name of a corruption; a search varies"
                " parameters itself, and tries pairs with --pairs"
            )
        names.append(label)
    return tuple(names)


def _screen_size(dataset: Path) -> Size:
    """Return the size of the first row's picture, for which the plans are compared."""
    height, width = open_feed(dataset, "steps").row(0)["screenshot"].shape[:2]
    return height, width


def _show(plans: list[WorstPlan]) -> None:
    """Print what was found, in points of score, with the number of cases in brackets."""
    if not plans:
        echo("no corruption cost anything: is there a case that the agent solves clean?")
        return
    wide = max(len(plan.label) for plan in plans)
    echo(f"{'points lost':{wide}}  {'found':>12}  {'confirmed':>12}  shrinkage")
    for plan in plans:
        shrinkage = f"{100 * plan.shrinkage:9.1f}" if plan.confirmed.n else f"{'-':>9}"
        echo(
            f"{plan.label:{wide}}  {_points(plan.found):>12}  {_points(plan.confirmed):>12} "
            f" {shrinkage}"
        )


def _points(loss: Loss) -> str:
    return f"{100 * loss.loss:.1f} ({loss.n})" if loss.n else "no score"
