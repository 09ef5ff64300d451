"""Statistics of a benchmark: paired tests, power, summaries of success, and the intervals.

The power of a paired t test comes from the noncentral t distribution of `student_t`. The intervals
are in `intervals`, and are reached through this module, too.

All scores are success rates in 0..1.
"""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import comb, sqrt
from typing import Any, cast

import numpy as np

from hijack_data.errors import ParameterError

from . import student_t
from .intervals import (
    LEVEL,
    Interval,
    PairedScores,
    Scores,
    are_alike,
    check_pairs,
    check_scores,
    difference_interval,
    differences_by_task,
    grand_mean_interval,
    mean_interval,
    retention_interval,
    scores_by_task,
    unpaired_difference_interval,
    unpaired_retention_interval,
)
from .unpaired_test import welch_by_task

__all__ = [
    "Interval",
    "PairedScores",
    "PairedTest",
    "Scores",
    "detectable_difference",
    "detectable_effect",
    "difference_interval",
    "grand_mean_interval",
    "holm",
    "mcnemar_by_task",
    "mean_corruption_error",
    "mean_interval",
    "paired_t",
    "paper_average",
    "pass_hat",
    "pass_hat_k",
    "retention_interval",
    "unpaired_difference_interval",
    "unpaired_retention_interval",
    "welch_by_task",
]

MAX_TOTALS = 1024  # of a sign-flip test, before it drops those less likely than UNLIKELY
UNLIKELY = 1e-40
EFFECT_TOLERANCE = 1e-9  # of the difference that is searched for, in standard deviations


def mcnemar_by_task(
    clean: Sequence[float], corrupted: Sequence[float], tasks: Sequence[Hashable]
) -> float:
    """Return the two-sided p value of the exact sign-flip test, in which each task is one case.

    An episode counts as solved if its score is 1. Under the null hypothesis the two conditions of a
    task, with all its cases, can be exchanged: the sum of its differences has either sign with
    probability 1/2. With one case a task this is McNemar's exact test; with several it does not
    take them for independent.

    Raises:
        ParameterError: there are no cases, the three lists differ in length, or a score is not a
            number in 0..1.
    """
    check_pairs(clean, corrupted)
    check_scores(clean, tasks)
    check_scores(corrupted, tasks)
    before = (np.asarray(clean, np.float64) == 1.0).astype(np.float64)
    after = (np.asarray(corrupted, np.float64) == 1.0).astype(np.float64)
    sums, _ = differences_by_task(cast("Any", before), cast("Any", after), tasks)
    sizes = np.abs(sums).astype(np.int64)
    # Of each total that some signs give, from the least one, in steps of two: a task adds its size
    # twice, or nothing.
    chances, first, dropped = np.ones(1), 0, 0.0
    for size in sizes[sizes > 0]:
        convolved = np.zeros(len(chances) + size)
        convolved[: len(chances)] += chances / 2
        convolved[size:] += chances / 2
        chances = convolved
        if len(chances) > MAX_TOTALS:  # thousands of tasks: without totals that do not happen
            likely = np.flatnonzero(chances > UNLIKELY)
            start, stop = int(likely[0]), int(likely[-1]) + 1
            dropped += float(chances[:start].sum() + chances[stop:].sum())
            chances, first = chances[start:stop], first + start
    totals = 2 * np.arange(first, first + len(chances)) - sizes.sum()
    return min(1.0, float(chances[np.abs(totals) >= abs(sums.sum())].sum()) + dropped)


def holm(p_values: Mapping[str, float]) -> dict[str, float]:
    """Return p values adjusted for testing several corruptions (Holm's step-down method)."""
    if not p_values:
        return {}
    adjusted: dict[str, float] = {}
    least = 0.0
    for rank, name in enumerate(sorted(p_values, key=lambda name: p_values[name])):
        least = max(least, min(1.0, (len(p_values) - rank) * p_values[name]))
        adjusted[name] = least
    return {name: adjusted[name] for name in p_values}


def detectable_difference(
    clean: Sequence[float],
    corrupted: Sequence[float],
    tasks: Sequence[Hashable],
    *,
    power: float = 0.8,
    level: float = LEVEL,
) -> float | None:
    """Return the smallest true difference that this number of tasks shows with probability `power`.

    It is computed for a paired t test, from the spread of the tasks' mean differences in this run.

    Returns:
        `None` with fewer than three tasks, or if all tasks differ by the same amount.

    Raises:
        ParameterError: there are no cases, the three lists differ in length, or a score is not a
            number in 0..1.
    """
    sums, counts = differences_by_task(clean, corrupted, tasks)
    means = sums / counts
    if len(means) < 3 or are_alike(means):
        return None
    spread = float(np.std(means, ddof=1))
    return min(1.0, detectable_effect(len(sums), power, level) * spread)


@lru_cache(maxsize=64)
def detectable_effect(tasks: int, power: float, level: float) -> float:
    """Return the difference that a paired t test finds, in standard deviations of the tasks.

    Args:
        tasks: how many, at least 2.
        power: the probability to find it, between 0 and 1.
        level: the confidence level of the two-sided test.
    """
    freedom = tasks - 1
    limit = student_t.quantile((1 + level) / 2, freedom)

    def miss_probability(effect: float) -> float:
        shift = effect * sqrt(tasks)
        upper = student_t.noncentral_cdf(limit, freedom, shift)
        return upper - student_t.noncentral_cdf(-limit, freedom, shift)

    low, high = 0.0, 1.0
    while miss_probability(high) > 1 - power:
        low, high = high, 2 * high
    while high - low > EFFECT_TOLERANCE:
        middle = (low + high) / 2
        low, high = (middle, high) if miss_probability(middle) > 1 - power else (low, middle)
    return high


@dataclass(frozen=True, kw_only=True)
class PairedTest:
    """A paired t test.

    Attributes:
        low: lower end of the interval of the mean difference.
        high: upper end.
        p: two-sided.
    """

    low: float
    high: float
    p: float


def paired_t(differences: Sequence[float], *, level: float = LEVEL) -> PairedTest | None:
    """Return the paired t test of tasks' differences, such as in steps or tokens.

    Args:
        differences: one for each task, of any unit.
        level: the confidence level, between 0 and 1.

    Returns:
        `None` with fewer than two tasks, or if all differ by the same amount.
    """
    values = np.asarray(differences, np.float64)
    if len(values) < 2 or are_alike(values):
        return None
    mean, error = float(values.mean()), float(values.std(ddof=1)) / sqrt(len(values))
    freedom = len(values) - 1
    half = student_t.quantile((1 + level) / 2, freedom) * error
    p = 2 * student_t.noncentral_cdf(-abs(mean) / error, freedom, 0.0)
    return PairedTest(low=mean - half, high=mean + half, p=p)


def pass_hat_k(solved: Mapping[Hashable, Sequence[bool]], k: int) -> float | None:
    """Return the probability that `k` episodes of one task, drawn at random, are all solved.

    Args:
        solved: for each task, whether each of its episodes was solved.
        k: how many episodes must all be solved, at least 1.

    Returns:
        The mean over the tasks with at least `k` episodes; `None` if there is none.

    Raises:
        ParameterError: `k` is less than 1.
    """
    if k < 1:
        raise ParameterError(f"k must be at least 1, got {k}")
    enough = [outcomes for outcomes in solved.values() if len(outcomes) >= k]
    if not enough:
        return None
    shares = [comb(sum(outcomes), k) / comb(len(outcomes), k) for outcomes in enough]
    return float(np.mean(shares))


def pass_hat(scores: Sequence[float], tasks: Sequence[Hashable]) -> tuple[float, ...]:
    """Return `pass_hat_k` for k = 1 up to the number of episodes that every task has.

    Args:
        scores: of each episode, 0..1; it is solved if its score is 1.
        tasks: the task of each.

    Raises:
        ParameterError: there are no episodes, the two lists differ in length, or a score is not a
            number in 0..1.
    """
    solved, counts = scores_by_task(cast("Any", np.asarray(scores) == 1.0), tasks)
    # Few tasks differ in both numbers, so each pair of them is computed once.
    outcomes = list(zip(solved.astype(int).tolist(), counts.astype(int).tolist(), strict=True))
    distinct = set(outcomes)
    values: list[float] = []
    for k in range(1, int(counts.min()) + 1):
        share = {(won, count): comb(won, k) / comb(count, k) for won, count in distinct}
        values.append(float(np.mean([share[outcome] for outcome in outcomes])))
    return tuple(values)


def mean_corruption_error(
    errors: Mapping[str, float], reference: Mapping[str, float]
) -> float | None:
    """Return the mean ratio of an agent's errors to those of a reference agent (mCE).

    Args:
        errors: 1 minus success, by corruption.
        reference: the same for the reference agent.

    Returns:
        `None` if the reference agent never fails under some corruption, where the ratio does not
        exist.

    Raises:
        ParameterError: the two have different corruptions, or none.
    """
    if not errors or set(errors) != set(reference):
        named = f"{sorted(errors)} and {sorted(reference)}"
        raise ParameterError(f"mCE compares the same corruptions of two agents, got {named}")
    if any(reference[name] == 0 for name in errors):
        return None
    ratios = [errors[name] / reference[name] for name in errors]
    return float(np.mean(ratios))


def paper_average(success: Mapping[str, float]) -> float:
    """Return the "Average" of the paper's main table: over all columns, Clean included.

    Raises:
        ParameterError: there is no column.
    """
    if not success:
        raise ParameterError("there is no success rate to average")
    return float(np.mean(list(success.values())))
