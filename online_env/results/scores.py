"""Compute from the records of a run one row for each agent and corruption."""

import importlib.util
from collections.abc import Iterable, Mapping, Sequence
from statistics import fmean
from typing import Any, NamedTuple, TypeAlias

from hijack_data.choices import CLEAN

from .reading import ResultRecord

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
# Agent and corruption.
CellKey: TypeAlias = tuple[str, str]
# The key of paired episodes: the task, the seed of its variant and the seed of the corruption's
# draws.
PairKey: TypeAlias = tuple[str, Any, int]
Cases: TypeAlias = dict[PairKey, ResultRecord]
ScoreByCase: TypeAlias = dict[PairKey, float]
ScoreByCell: TypeAlias = Mapping[CellKey, ScoreByCase]
# The two scores and the task of each case.
PairedCases: TypeAlias = tuple[list[float], list[float], list[str]]


class GroupedRecords(NamedTuple):
    """The records of a run by agent and corruption.

    Attributes:
        last: the last attempt at each case.
        attempts: all attempts; those that were repeated were paid for, too.
        scored: the score of each case that counts for the agent.
    """

    last: dict[CellKey, Cases]
    attempts: dict[CellKey, list[ResultRecord]]
    scored: dict[CellKey, ScoreByCase]


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
    rows_made = [_row(*key, groups.last[key], groups.scored) for key in keys]
    if can_infer():
        _infer(rows_made, groups.scored)
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
    cases = [case for case in after if case in before]
    return ([before[case] for case in cases], [after[case] for case in cases], task_names(cases))


def pairs_with_clean(agent: str, scores: ScoreByCell) -> PairedCases:
    """Return the cases of `pairs` of clean and each corruption of an agent, after each other."""
    clean = scores.get((agent, CLEAN), {})
    clean_scores: list[float] = []
    corrupted_scores: list[float] = []
    tasks: list[str] = []
    for (name, label), cell in scores.items():
        if name != agent or label == CLEAN:
            continue
        before, after, of_tasks = pairs(clean, cell)
        clean_scores += before
        corrupted_scores += after
        tasks += of_tasks
    return clean_scores, corrupted_scores, tasks


def _infer(table: Sequence[ScoreRow], scores: ScoreByCell) -> None:
    """Add intervals and tests to rows, in place; the p values are adjusted for each agent."""
    from . import statistics  # scipy takes a second to load

    for row in table:
        if row["n"]:
            cell = scores[row["agent"], row["corruption"]]
            mean = statistics.mean_interval(list(cell.values()), task_names(cell))
            row.update(ci_low=mean.low, ci_high=mean.high)
    compared = [row for row in table if row["delta"] is not None]
    tests: dict[str, dict[str, float]] = {}
    for row in compared:
        cases = _with_clean(row, scores)
        change = statistics.difference_interval(*cases)
        row.update(delta_low=change.low, delta_high=change.high)
        tests.setdefault(row["agent"], {})[row["corruption"]] = statistics.mcnemar_by_task(*cases)
    adjusted = {agent: statistics.holm(p_values) for agent, p_values in tests.items()}
    for row in compared:
        row["p"] = adjusted[row["agent"]][row["corruption"]]


def _with_clean(row: ScoreRow, scores: ScoreByCell) -> PairedCases:
    agent = row["agent"]
    return pairs(scores.get((agent, CLEAN), {}), scores[agent, row["corruption"]])


def latest(records: Iterable[ResultRecord]) -> dict[tuple[str, str, str, Any, int], ResultRecord]:
    """Return the last attempt at each case.

    The keys are agent, corruption, task, the task's seed and the corruption's.
    """
    return {
        (r["agent"], r["corruption"], r["task"], r.get("task_seed"), r["seed"]): r for r in records
    }


def group_records(records: Iterable[ResultRecord]) -> GroupedRecords:
    """Return the records of a run by agent and corruption."""
    attempts: dict[CellKey, list[ResultRecord]] = {}
    last: dict[CellKey, Cases] = {}
    for record in records:
        cell = record["agent"], record["corruption"]
        case = record["task"], record.get("task_seed"), record["seed"]
        attempts.setdefault(cell, []).append(record)
        last.setdefault(cell, {})[case] = record
    return GroupedRecords(last, attempts, {cell: scored(cases) for cell, cases in last.items()})


def count_unreached(records: Iterable[ResultRecord], corruptions: Mapping[str, str]) -> int:
    """Return how many episodes with a score ended before their corruption acted on the machine.

    Args:
        records: the last attempts.
        corruptions: the name of each label; only a corruption with effects on the machine can come
            too late.
    """
    from hijack_data.corruption import corruption_names, find_corruption

    acting = {name for name in corruption_names() if find_corruption(name).effects}
    waiting = {label for label, name in corruptions.items() if name in acting}
    scored = [
        record
        for record in records
        if record["status"] == "ok"
        and record["corruption"] in waiting
        and not record.get("unplayable")
    ]
    return sum(not record.get("effects") for record in scored)


def _positions(listed: Sequence[str]) -> dict[str, int]:
    """Return the position of the first occurrence of each name."""
    return {name: position for position, name in enumerate(dict.fromkeys(listed))}


def _row(agent: str, label: str, cases: Cases, scores: ScoreByCell) -> ScoreRow:
    cell = scores[agent, label]
    base = scores.get((agent, CLEAN), {}) if label != CLEAN else {}
    clean_scores, corrupted_scores, _ = pairs(base, cell)
    counted_records = [record for record in cases.values() if counts(record)]
    row: ScoreRow = {
        **dict.fromkeys(COLUMNS),
        "agent": agent,
        "corruption": label,
        "n": len(cell),
        "errors": sum(record["status"] == "error" for record in counted_records),
        "invalid": len(cases) - len(counted_records),
    }
    if cell:
        row["success"] = fmean(cell.values())
    if corrupted_scores:
        row["delta"] = (sum(corrupted_scores) - sum(clean_scores)) / len(corrupted_scores)
    if sum(clean_scores):
        row["retention"] = sum(corrupted_scores) / sum(clean_scores)
    return row


def can_infer() -> bool:
    """Return whether scipy is installed, which intervals and tests need."""
    return importlib.util.find_spec("scipy") is not None


def task_names(cases: Iterable[PairKey]) -> list[str]:
    """Return the task of each case; see `task_name`."""
    return [task_name(task, variant) for task, variant, _ in cases]


def task_name(task: str, variant: object) -> str:
    """Return a task without the seed of its variant.

    In a run of `hijack score` the variant is the text of a step, and the task the name of a
    recording, which stays whole.
    """
    return task.removesuffix(f"-{variant}") if isinstance(variant, int) else task


def counts(record: ResultRecord) -> bool:
    """Return whether an episode counts for the agent.

    An episode whose desktop died is repeated, and counts if the desktop dies again: once is the
    machine's failure, but an agent must not escape a bad episode by killing its desktop. An error
    without a cause counts.
    """
    if record["status"] != "error":
        return record["status"] == "ok"
    cause = record.get("cause", "agent")
    return cause == "agent" or (cause == "machine" and (record.get("attempt") or 0) > 0)


def scored(cases: Cases) -> ScoreByCase:
    """Return the score (0..1) of each case that counts for the agent; an error scores 0."""
    return {case: _score(record) for case, record in cases.items() if counts(record)}


def count_partial(records: Iterable[ResultRecord]) -> int:
    """Return how many of the last attempts count and have a score that is neither 0 nor 1."""
    return sum(counts(record) and 0 < _score(record) < 1 for record in records)


def _score(record: ResultRecord) -> float:
    return float(record["score"]) if record["status"] == "ok" else 0.0
