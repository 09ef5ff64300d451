"""Compare two runs case by case: the same agent, task, corruption and seed before and after."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hijack_data.errors import quantity, shorten_list

from ..extra import require
from ..results import scores
from ..results.reading import Run
from . import formatting
from .identity import played_commits, run_identity, task_code
from .model import ReportError, RunIdentity
from .notes import partial_note
from .unplayable import counted_records

PACKAGE = "agenthijack"
# Fields of a configuration in which two compared runs may differ.
_FREE_FIELDS = ("source", "agents", "code")


@dataclass(frozen=True, kw_only=True)
class ComparedCell:
    """One condition of two agents, over the cases that both runs have.

    Attributes:
        before: the agent of the first run.
        after: the agent of the second.
        corruption: the label.
        n: cases that are in both.
        only_before: cases with a score only in the first run.
        only_after: cases with a score only in the second run.
        success_before: mean score of the shared cases in the first run.
        success_after: the same in the second.
        difference: second minus first.
        low: lower end of its 95 % interval.
        high: upper end.
        p: of the exact sign-flip test over tasks, adjusted for the conditions of the agent (Holm).
        detectable: the smallest true difference that as many tasks would show with a power of
            80 %.
    """

    before: str
    after: str
    corruption: str
    n: int
    only_before: int = 0
    only_after: int = 0
    success_before: float | None = None
    success_after: float | None = None
    difference: float | None = None
    low: float | None = None
    high: float | None = None
    p: float | None = None
    detectable: float | None = None


@dataclass(frozen=True, kw_only=True)
class RunComparison:
    """A run compared with an earlier one.

    Attributes:
        before: the earlier run.
        after: the later one.
        cells: a row for each pair of agents and each condition of either run.
        notes: sentences about what the runs do not share and what the comparison cannot show.
    """

    before: RunIdentity
    after: RunIdentity
    cells: tuple[ComparedCell, ...]
    notes: tuple[str, ...]


def compare_runs(before: Run, after: Run, pairs: Mapping[str, str] | None = None) -> RunComparison:
    """Return two runs compared case by case.

    A case is a task (with the seed of its variant), a corruption and a seed. Agents of the same
    name are compared; if there are none, and each run has one agent, these two.

    Args:
        before: the earlier run.
        after: the later one.
        pairs: names of agents of the first run, and of the agents of the second with which to
            compare them, instead of equal names.

    Raises:
        ReportError: a run has no episodes, an agent is missing, or the runs share no case.
    """
    require("a comparison of runs", ("scipy",))
    for run in (before, after):
        if not run.records:
            raise ReportError(f"{run.folder}: holds no episodes yet, so there is nothing to pair")
    scores_before = scores.group_records(counted_records(before)).scored
    scores_after = scores.group_records(counted_records(after)).scored
    agent_pairs = _match_agents(before, after, _agents(before), _agents(after), pairs)
    rows = [
        row for names in agent_pairs.items() for row in _rows(names, scores_before, scores_after)
    ]
    if not any(row.n for row in rows):
        raise ReportError(
            f"{before.folder} and {after.folder} share no case (task, corruption and seed); run"
            " both with the same --tasks, --corruptions and --seeds"
        )
    return RunComparison(
        before=run_identity(before),
        after=run_identity(after),
        cells=tuple(rows),
        notes=tuple(_notes(before, after, rows, agent_pairs)),
    )


def _agents(run: Run) -> list[str]:
    return list(dict.fromkeys(record["agent"] for record in run.records))


def _match_agents(
    before: Run,
    after: Run,
    agents_before: Sequence[str],
    agents_after: Sequence[str],
    pairs: Mapping[str, str] | None,
) -> dict[str, str]:
    """Return which agents are compared.

    Raises:
        ReportError: one of them is missing, or it is not clear which to compare.
    """
    for first, second in (pairs or {}).items():
        for run, name, agents in ((before, first, agents_before), (after, second, agents_after)):
            if name not in agents:
                raise ReportError(f"--pair: {name!r} is not in {run.folder} ({', '.join(agents)})")
    if pairs:
        return dict(pairs)
    shared = [agent for agent in agents_before if agent in agents_after]
    if shared:
        return {agent: agent for agent in shared}
    if len(agents_before) == len(agents_after) == 1:
        return {agents_before[0]: agents_after[0]}
    raise ReportError(
        f"nothing to pair: {before.folder} has {', '.join(agents_before)}, {after.folder} has"
        f" {', '.join(agents_after)}; name two with --pair {agents_before[0]}={agents_after[0]}"
    )


def _rows(
    names: tuple[str, str], scores_before: scores.ScoreByCell, scores_after: scores.ScoreByCell
) -> list[ComparedCell]:
    """Return the conditions of two agents, in the order of the first run."""
    from ..results import statistics

    first, second = names
    labels = [label for agent, label in scores_before if agent == first]
    labels += [label for agent, label in scores_after if agent == second]
    values: dict[str, dict[str, Any]] = {}
    for label in dict.fromkeys(labels):
        old = scores_before.get((first, label), {})
        new = scores_after.get((second, label), {})
        values[label] = _row(old, new)
    tests = {label: row["p"] for label, row in values.items() if row["n"]}
    adjusted = statistics.holm(tests)
    for label, value in adjusted.items():
        values[label]["p"] = value
    return [
        ComparedCell(before=first, after=second, corruption=label, **row)
        for label, row in values.items()
    ]


def _row(old: scores.ScoreByCase, new: scores.ScoreByCase) -> dict[str, Any]:
    from ..results import statistics

    before, after, tasks = scores.pairs(old, new)
    row: dict[str, Any] = {
        "n": len(tasks),
        "only_before": len(old) - len(tasks),
        "only_after": len(new) - len(tasks),
    }
    if not tasks:
        return row
    change = statistics.difference_interval(before, after, tasks)
    return row | {
        "success_before": sum(before) / len(before),
        "success_after": sum(after) / len(after),
        "difference": change.value,
        "low": change.low,
        "high": change.high,
        "p": statistics.mcnemar_by_task(before, after, tasks),
        "detectable": statistics.detectable_difference(before, after, tasks),
    }


def _notes(
    before: Run, after: Run, rows: Sequence[ComparedCell], agent_pairs: Mapping[str, str]
) -> Iterator[str]:
    names = _names(before, after)
    for run, name, compared in (
        (before, names[0], agent_pairs.keys()),
        (after, names[1], agent_pairs.values()),
    ):
        uncompared = [agent for agent in _agents(run) if agent not in compared]
        if uncompared:
            yield f"Only in {name}: {', '.join(uncompared)}."
    alone = [(row.only_before, row.only_after) for row in rows]
    first, second = (sum(counts) for counts in zip(*alone, strict=True))
    if first or second:
        yield (
            f"Not compared: {first} cases that only {names[0]} has, {second} that only"
            f" {names[1]} has."
        )
    settings = (_comparable_config(before), _comparable_config(after))
    from ..results.records import difference

    first_difference = difference(*settings)
    if first_difference:
        differing = [key for key in {**settings[0], **settings[1]} if _differs(key, *settings)]
        listed = ", ".join(differing)
        yield (
            f"The runs differ in their settings, too ({listed}), first in this: {first_difference}."
        )
    codes = task_code(before.config), task_code(after.config)
    other_files = [name for name in {**codes[0], **codes[1]} if _differs(name, *codes)]
    if other_files:
        yield (
            f"Other files define {shorten_list(other_files)} in {names[0]} than in {names[1]}:"
            " what differs may be the task, not the agent."
        )
    yield from _instruction_note(before, after, names, agent_pairs)
    yield from partial_note(
        scores.count_partial(before.last_attempts) + scores.count_partial(after.last_attempts)
    )
    versions = [run_identity(run).versions.get(PACKAGE, "unknown") for run in (before, after)]
    if versions[0] != versions[1]:
        yield (
            f"{names[0]} was made with {PACKAGE} {versions[0]}, {names[1]} with {versions[1]}:"
            " tasks and corruptions may have changed."
        )
    commits = [
        ", ".join(dict.fromkeys(commit for _, commit in played_commits(run)))
        for run in (before, after)
    ]
    if versions[0] == versions[1] and commits[0] != commits[1]:
        yield (
            f"{names[0]} was played by commit {commits[0]} of {PACKAGE}, {names[1]} by"
            f" {commits[1]}: tasks, corruptions and agents may have changed."
        )
    yield from _insignificant_notes(rows)


def _instruction_note(
    before: Run, after: Run, names: tuple[str, str], agent_pairs: Mapping[str, str]
) -> Iterator[str]:
    """Yield how many compared cases asked for something else, though they have the same name."""
    earlier = scores.latest(before.records)
    old_names = {new: old for old, new in agent_pairs.items()}
    differing = [
        task
        for (agent, label, task, variant, seed), record in scores.latest(after.records).items()
        if (old := earlier.get((old_names.get(agent, ""), label, task, variant, seed)))
        and old.get("instruction") != record.get("instruction")
    ]
    if differing:
        listed = shorten_list(list(dict.fromkeys(differing)), 3)
        yield (
            f"{quantity(len(differing), 'case')} had another instruction in {names[0]} than in"
            f" {names[1]} ({listed}): what differs may be the task, not the agent."
        )


def _names(before: Run, after: Run) -> tuple[str, str]:
    """Return what the runs are called in a report that is read elsewhere: not by their paths."""
    first, second = (run.folder.resolve().name for run in (before, after))
    return (first, second) if first != second else (f"{first} (before)", f"{second} (after)")


def _comparable_config(run: Run) -> dict[str, Any]:
    """Return the configuration without the fields in which compared runs may differ."""
    return {key: value for key, value in run.config.items() if key not in _FREE_FIELDS}


def _differs(key: str, before: Mapping[str, Any], after: Mapping[str, Any]) -> bool:
    return before.get(key) != after.get(key)


def _insignificant_notes(rows: Sequence[ComparedCell]) -> Iterator[str]:
    """Yield the conditions without a significant difference, and the detectable size of one."""
    hidden: dict[tuple[str, str], list[str]] = {}
    has_size: set[tuple[str, str]] = set()
    for row in rows:
        if row.p is None or row.p < formatting.SIGNIFICANT_P:
            continue
        names = row.before, row.after
        points = ""
        if row.detectable:
            points = f" ({100 * row.detectable:.1f} points)"
            has_size.add(names)
        hidden.setdefault(names, []).append(f"{row.corruption}{points}")
    for names, labels in hidden.items():
        text = f"{_agent_pair(*names)}: no difference is shown under {', '.join(labels)}."
        if names in has_size:
            text += (
                " In brackets is the true difference that as many tasks would show with a"
                " probability of 80 %."
            )
        yield text


def _agent_pair(before: str, after: str) -> str:
    return after if before == after else f"{before} and {after}"
