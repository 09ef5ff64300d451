"""Compute from the records of a run one row for each agent and corruption."""

import importlib.util
from collections.abc import Hashable, Iterable, Mapping, Sequence
from functools import lru_cache
from statistics import fmean
from typing import Any, NamedTuple, TypeAlias, cast

import numpy as np

from hijack_data.choices import CLEAN

from .episode_columns import CellEpisodes, CellKey, CellScores, EpisodeColumns, PairKey
from .record_score import ResultRecord, score_value
from .record_score import counts as counts

ScoreRow: TypeAlias = dict[str, Any]
COLUMNS = (
    "agent",
    "corruption",
    "n",
    "success",
    "ci_low",
    "ci_high",
    "delta",
    "delta_low",
    "delta_high",
    "p",
    "retention",
    "errors",
    "invalid",
)
Cases: TypeAlias = Mapping[PairKey, ResultRecord]
ScoreByCase: TypeAlias = Mapping[PairKey, float]
ScoreByCell: TypeAlias = Mapping[CellKey, ScoreByCase]
# The two scores and the task of each case; arrays, with numbers of tasks, for `EpisodeColumns`.
ScoreLists: TypeAlias = tuple[Sequence[float], Sequence[Hashable]]
PairedCases: TypeAlias = tuple[Sequence[float], Sequence[float], Sequence[Hashable]]


class GroupedRecords(NamedTuple):
    """The records of a run by agent and corruption.

    Attributes:
        last: the last attempt at each case.
        attempts: all attempts; those that were repeated were paid for, too. None of
            `EpisodeColumns`, which do not say what an episode took.
        scored: the score of each case that counts for the agent.
        pairs_by_cell: the pairs with clean that were asked for, each made once.
        paired: whether conditions are compared case by case; else as samples of different tasks.
    """

    last: Mapping[CellKey, Cases]
    attempts: Mapping[CellKey, Sequence[ResultRecord]]
    scored: ScoreByCell
    pairs_by_cell: dict[CellKey, PairedCases]
    paired: bool = True


def rows(
    records: Iterable[ResultRecord], agents: Sequence[str] = (), corruptions: Sequence[str] = ()
) -> list[ScoreRow]:
    """Return one row for each agent and corruption that has records, with the keys `COLUMNS`.

    `n` is the number of episodes that count for the agent (see `counts`). `errors` is the number of
    those without a score, for example because the agent raised; they score 0. `invalid` is the
    number of all others, which say nothing about the agent: the corruption did not hold, or the
    desktop died. `success` is the mean score, 0..1, with the ends of its 95 % interval, which
    rests on how far tasks differ. `delta` is the mean difference to the clean condition over the
    cases (task and seed) that have both, with its interval; `retention` is the ratio over the same
    cases. `p` is that of the exact sign-flip test over their tasks, adjusted for all corruptions of
    the agent (Holm).

    Args:
        records: of one run or several.
        agents: names in the order of the rows; others follow in the order of their records.
        corruptions: labels in the order of the rows, likewise.
    """
    return rows_by_group(group_records(records), agents, corruptions)


def rows_by_group(
    groups: GroupedRecords, agents: Sequence[str] = (), corruptions: Sequence[str] = ()
) -> list[ScoreRow]:
    """Return the rows that `rows` describes, of records that `group_records` has grouped."""
    agent_order = _positions([*agents, *(agent for agent, _ in groups.last)])
    label_order = _positions([*corruptions, *(label for _, label in groups.last)])
    keys = sorted(groups.last, key=lambda key: (agent_order[key[0]], label_order[key[1]]))
    rows_made = [_row(*key, groups.last[key], groups) for key in keys]
    if can_infer():
        _infer(rows_made, groups)
    return rows_made


def summaries(table: Sequence[ScoreRow]) -> list[ScoreRow]:
    """Return one row for each agent of a table that `rows` made.

    `clean` is its clean success, `corrupted` the mean over its corruptions, `worst` the label of
    its worst corruption (the first of `worst_labels`), `worst_success` the success under it,
    `paper_average` the paper's "Average", which includes the clean condition. Missing values are
    `None`.
    """
    agent_rows: list[ScoreRow] = []
    for agent in dict.fromkeys(row["agent"] for row in table):
        success = {row["corruption"]: row["success"] for row in table if row["agent"] == agent}
        values = [value for value in success.values() if value is not None]
        agent_rows.append(
            {"agent": agent, **means(success), "paper_average": fmean(values) if values else None}
        )
    return agent_rows


def means(success: Mapping[str, float | None]) -> dict[str, Any]:
    """Return `clean`, `corrupted`, `worst` and `worst_success` of an agent, as in `summaries`.

    Args:
        success: the mean score under each condition; `None` where nothing was scored.
    """
    scored_success = {label: value for label, value in success.items() if value is not None}
    corrupted = {label: value for label, value in scored_success.items() if label != CLEAN}
    return {
        "clean": scored_success.get(CLEAN),
        "corrupted": fmean(corrupted.values()) if corrupted else None,
        "worst": next(iter(worst_labels(scored_success)), None),
        "worst_success": min(corrupted.values(), default=None),
    }


def worst_labels(success: Mapping[str, float]) -> tuple[str, ...]:
    """Return the labels of the corruptions under which an agent does worst.

    None if no corruption is worse than another: the agent solves nothing at all, or as much under
    each of several.

    Args:
        success: the mean score under each condition.
    """
    corrupted = {label: value for label, value in success.items() if label != CLEAN}
    least = min(corrupted.values(), default=0.0)
    worst = tuple(label for label, value in corrupted.items() if value == least)
    are_alike = len(worst) == len(corrupted) > 1
    return worst if any(success.values()) and not are_alike else ()


def pairs(before: ScoreByCase, after: ScoreByCase) -> PairedCases:
    """Return the two scores and the task of each case that has both, in the order of `after`."""
    if isinstance(before, CellScores) and isinstance(after, CellScores):
        paired = after.pair(before)
        if paired is not None:
            return cast("PairedCases", paired)
    cases = [case for case in after if case in before]
    return ([before[case] for case in cases], [after[case] for case in cases], task_names(cases))


def score_lists(cell: ScoreByCase) -> ScoreLists:
    """Return the scores of a cell, and the task of each."""
    if isinstance(cell, CellScores):
        return cast("ScoreLists", (cell.scores, cell.tasks))
    return list(cell.values()), task_names(cell)


def pooled_pairs(agent: str, labels: Iterable[str], groups: GroupedRecords) -> PairedCases:
    """Return the cases of `pairs_in_cell` of several corruptions of an agent, after each other."""
    columns: tuple[list[Any], list[Any], list[Any]] = [], [], []
    for label in labels:
        for column, values in zip(columns, pairs_in_cell((agent, label), groups), strict=True):
            column += values.tolist() if isinstance(values, np.ndarray) else values
    return columns


def pooled_samples(
    agent: str, labels: Iterable[str], groups: GroupedRecords
) -> tuple[ScoreLists, ScoreLists]:
    """Return the clean scores of an agent, and those of several corruptions after each other."""
    pooled: tuple[list[Any], list[Any]] = [], []
    for label in labels:
        cell = score_lists(groups.scored[agent, label])
        for column, values in zip(pooled, cell, strict=True):
            column += values.tolist() if isinstance(values, np.ndarray) else values
    return score_lists(groups.scored.get((agent, CLEAN), {})), pooled


def _infer(table: Sequence[ScoreRow], groups: GroupedRecords) -> None:
    """Add intervals and tests to rows, in place; the p values are adjusted for each agent."""
    from . import statistics  # scipy takes a second to load

    for row in table:
        if row["n"]:
            cell = groups.scored[row["agent"], row["corruption"]]
            mean = statistics.mean_interval(*score_lists(cell))
            row.update(ci_low=mean.low, ci_high=mean.high)
    compared = [row for row in table if row["delta"] is not None]
    tests: dict[str, dict[str, float]] = {}
    for row in compared:
        key = row["agent"], row["corruption"]
        p: float | None
        if groups.paired:
            cases = pairs_in_cell(key, groups)
            change = statistics.difference_interval(*cases)
            p = statistics.mcnemar_by_task(*cases)
        else:
            samples = samples_in_cell(key, groups)
            change = statistics.unpaired_difference_interval(*samples)
            p = statistics.welch_by_task(*samples)
        row.update(delta_low=change.low, delta_high=change.high)
        if p is not None:
            tests.setdefault(row["agent"], {})[row["corruption"]] = p
    adjusted = {agent: statistics.holm(p_values) for agent, p_values in tests.items()}
    for row in compared:
        row["p"] = adjusted.get(row["agent"], {}).get(row["corruption"])


def pairs_in_cell(key: CellKey, groups: GroupedRecords) -> PairedCases:
    """Return the cases of a corruption that the clean condition has, too; none for clean."""
    if key not in groups.pairs_by_cell:
        clean = groups.scored.get((key[0], CLEAN), {}) if key[1] != CLEAN else {}
        groups.pairs_by_cell[key] = pairs(clean, groups.scored[key])
    return groups.pairs_by_cell[key]


def samples_in_cell(key: CellKey, groups: GroupedRecords) -> tuple[ScoreLists, ScoreLists]:
    """Return the clean scores of an agent, and those of a cell, each with their tasks."""
    return score_lists(groups.scored[key[0], CLEAN]), score_lists(groups.scored[key])


def latest(records: Iterable[ResultRecord]) -> dict[tuple[str, str, str, Any, int], ResultRecord]:
    """Return the last attempt at each case.

    The keys are agent, corruption, task, the task's seed and the corruption's.
    """
    return {
        (r["agent"], r["corruption"], r["task"], r.get("task_seed"), r["seed"]): r for r in records
    }


def group_records(records: Iterable[ResultRecord]) -> GroupedRecords:
    """Return the records of a run by agent and corruption."""
    if isinstance(records, EpisodeColumns):
        cells = records.cells()
        scores = {key: cell.scored for key, cell in cells.items()}
        return GroupedRecords(cells, dict.fromkeys(cells, ()), scores, {}, records.paired)
    attempts: dict[CellKey, list[ResultRecord]] = {}
    last: dict[CellKey, dict[PairKey, ResultRecord]] = {}
    for record in records:
        cell = record["agent"], record["corruption"]
        case = record["task"], record.get("task_seed"), record["seed"]
        attempts.setdefault(cell, []).append(record)
        last.setdefault(cell, {})[case] = record
    return GroupedRecords(last, attempts, {cell: scored(cases) for cell, cases in last.items()}, {})


def count_unreached(records: Iterable[ResultRecord], corruptions: Mapping[str, str]) -> int:
    """Return how many episodes with a score ended before their corruption acted on the machine.

    Args:
        records: the last attempts.
        corruptions: the name of each label, or the names of several that act together, joined by
            `+`; only a corruption with effects on the machine, or one that changes the agent's
            input, can come too late.
    """
    waiting = _acting_labels(tuple(corruptions.items()))
    scored = [
        record
        for record in records
        if record["status"] == "ok"
        and record["corruption"] in waiting
        and not record.get("unplayable")
    ]
    return sum(not record.get("effects") and not record.get("inputs") for record in scored)


@lru_cache(maxsize=4)
def _acting_labels(corruptions: tuple[tuple[str, str], ...]) -> frozenset[str]:
    """Return the labels, of labels and names, all of whose corruptions act on machine or input."""
    from hijack_data.corruption import CORRUPTIONS, find_corruption

    types = {name: find_corruption(name) for name in CORRUPTIONS.names()}
    acting = {name for name, kind in types.items() if kind.effects or kind.inputs}
    return frozenset(label for label, names in corruptions if acting.issuperset(names.split("+")))


def _positions(listed: Sequence[str]) -> dict[str, int]:
    """Return the position of the first occurrence of each name."""
    return {name: position for position, name in enumerate(dict.fromkeys(listed))}


def _row(agent: str, label: str, cases: Cases, groups: GroupedRecords) -> ScoreRow:
    cell = groups.scored[agent, label]
    base = groups.scored.get((agent, CLEAN), {}) if label != CLEAN else {}
    if groups.paired:
        clean_scores, corrupted_scores, _ = pairs_in_cell((agent, label), groups)
    else:
        clean_scores, corrupted_scores = score_lists(base)[0], score_lists(cell)[0]
    row: ScoreRow = {
        **dict.fromkeys(COLUMNS),
        "agent": agent,
        "corruption": label,
        "n": len(cell),
        "errors": _count_errors(cases),
        "invalid": len(cases) - len(cell),
    }
    if cell:
        row["success"] = fmean(score_lists(cell)[0])
    if groups.paired and len(corrupted_scores):
        row["delta"] = (sum(corrupted_scores) - sum(clean_scores)) / len(corrupted_scores)
    elif len(clean_scores) and len(corrupted_scores):
        row["delta"] = fmean(corrupted_scores) - fmean(clean_scores)
    if row["delta"] is not None and sum(clean_scores):
        counts_apart = len(clean_scores) / len(corrupted_scores)  # 1 for pairs
        row["retention"] = sum(corrupted_scores) / sum(clean_scores) * counts_apart
    return row


def _count_errors(cases: Cases) -> int:
    """Return how many episodes count although they have no score."""
    if isinstance(cases, CellEpisodes):
        return 0  # what other harnesses did not score is invalid
    return sum(record["status"] == "error" and counts(record) for record in cases.values())


@lru_cache(maxsize=1)
def can_infer() -> bool:
    """Return whether scipy is installed, which intervals and tests need."""
    return importlib.util.find_spec("scipy") is not None


def distinct_tasks(cell: ScoreByCase) -> set[Hashable]:
    """Return the tasks that the cases of a cell are of, whatever their variants."""
    tasks = score_lists(cell)[1]
    return set(np.unique(tasks).tolist() if isinstance(tasks, np.ndarray) else tasks)


def count_tasks(cell: ScoreByCase) -> int:
    """Return how many tasks the cases of a cell are of, whatever their variants."""
    return len(distinct_tasks(cell))


def task_names(cases: Iterable[PairKey]) -> list[str]:
    """Return the task of each case; see `task_name`."""
    return [task_name(task, variant) for task, variant, _ in cases]


@lru_cache(maxsize=65_536)
def task_name(task: str, variant: object) -> str:
    """Return a task without the seed of its variant.

    In a run of `hijack score` the variant is the text of a step, and the task the name of a
    recording, which stays whole.
    """
    return task.removesuffix(f"-{variant}") if isinstance(variant, int) else task


def scored(cases: Cases) -> dict[PairKey, float]:
    """Return the score (0..1) of each case that counts for the agent; an error scores 0."""
    return {case: score_value(record) for case, record in cases.items() if counts(record)}


def count_partial(records: Iterable[ResultRecord]) -> int:
    """Return how many of the last attempts count and have a score that is neither 0 nor 1."""
    if isinstance(records, EpisodeColumns):
        return int(((records.score > 0) & (records.score < 1)).sum())
    return sum(counts(record) and 0 < score_value(record) < 1 for record in records)
