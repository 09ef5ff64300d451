"""Statistics of a benchmark: intervals, paired tests and summaries of success.

Episodes of one task resemble each other: another seed changes names and numbers, not the task.
Intervals therefore resample tasks, not episodes. Tests, power and Wilson's interval come from scipy
and statsmodels; this module arranges the episodes for them.

All scores are success rates in 0..1.
"""

from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import comb
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from scipy import stats
from statsmodels.stats.multitest import multipletests
from statsmodels.stats.power import TTestPower
from statsmodels.stats.proportion import proportion_confint

from hijack_data.errors import ParameterError

Floats64: TypeAlias = npt.NDArray[np.float64]

LEVEL = 0.95
RESAMPLES = 9999
BLOCK = 1_000_000  # numbers drawn at once
KEPT = 5_000_000  # numbers of resamples that are kept for the next interval: 40 MB


@dataclass(frozen=True, kw_only=True)
class Interval:
    """An estimate with its confidence interval.

    Attributes:
        value: the estimate.
        low: the lower end of the interval.
        high: the upper end of the interval.
    """

    value: float
    low: float
    high: float


def mean_interval(
    scores: Sequence[float],
    tasks: Sequence[Hashable],
    *,
    level: float = LEVEL,
    seed: int = 0,
) -> Interval:
    """Return the mean score of some episodes, with a bootstrap interval that resamples tasks.

    If all tasks have the same mean, a bootstrap interval would have no width. The interval is then
    that of an event that was never seen in as many tasks (Wilson's score interval).

    Args:
        scores: one score an episode, 0..1.
        tasks: the task of each episode.
        level: the confidence level, between 0 and 1.
        seed: of the resampling; the same seed gives the same interval.

    Raises:
        ParameterError: there are no episodes, or as many scores as tasks are not given.
    """
    sums, counts = _by_task(scores, tasks)
    low, high = _resampled(sums, counts, level=level, seed=seed)
    return Interval(
        value=float(sums.sum() / counts.sum()),
        low=max(0.0, low),
        high=min(1.0, high),
    )


def difference_interval(
    clean: Sequence[float],
    corrupted: Sequence[float],
    tasks: Sequence[Hashable],
    *,
    level: float = LEVEL,
    seed: int = 0,
) -> Interval:
    """Return the mean difference of paired episodes (corrupted minus clean), with its interval.

    Args:
        clean: the score of each case under the clean condition.
        corrupted: the score of the same case (task and seed) under a corruption.
        tasks: the task of each case.
        level: the confidence level, between 0 and 1.
        seed: of the resampling.

    Raises:
        ParameterError: there are no cases, or the three lists differ in length.
    """
    _same_length(clean, corrupted)
    differences = np.asarray(corrupted, np.float64) - np.asarray(clean, np.float64)
    sums, counts = _by_task(differences.tolist(), tasks)
    low, high = _resampled(sums, counts, level=level, seed=seed)
    value = float(sums.sum() / counts.sum())
    return Interval(
        value=value,
        low=max(-1.0, low),
        high=min(1.0, high),
    )


def retention_interval(
    clean: Sequence[float],
    corrupted: Sequence[float],
    tasks: Sequence[Hashable],
    *,
    level: float = LEVEL,
    seed: int = 0,
) -> Interval | None:
    """Return which share of its clean success an agent keeps, with its interval.

    Args:
        clean: the score of each case under the clean condition.
        corrupted: the score of the same case under a corruption.
        tasks: the task of each case.
        level: the confidence level, between 0 and 1.
        seed: of the resampling.

    Returns:
        `None` if the agent has no clean success, since there is nothing to keep. The interval is
        unbounded above (`inf`) if resampled tasks may have no clean success.

    Raises:
        ParameterError: there are no cases, or the three lists differ in length.
    """
    _same_length(clean, corrupted)
    before, _ = _by_task(clean, tasks)
    after, _ = _by_task(corrupted, tasks)
    if before.sum() == 0:
        return None
    value = float(after.sum() / before.sum())
    ratios = _bootstrap(after, before, level=level, seed=seed)
    return Interval(
        value=value,
        low=ratios[0],
        high=ratios[1],
    )


def grand_mean_interval(
    cells: Sequence[tuple[Sequence[float], Sequence[Hashable]]],
    *,
    level: float = LEVEL,
    seed: int = 0,
) -> Interval:
    """Return the mean of several cells' mean scores, such as over the nine, with its interval.

    A resample draws tasks, and each of them brings its episodes of all cells. Resamples in which
    some cell has no episode are left out of that cell's mean.

    Args:
        cells: for each cell its scores, 0..1, and the task of each.
        level: the confidence level, between 0 and 1.
        seed: of the resampling.

    Raises:
        ParameterError: there is no cell, or a cell has no episodes.
    """
    if not cells:
        raise ParameterError("there are no cells to average")
    means = [_by_task(scores, tasks)[0].sum() / len(scores) for scores, tasks in cells]
    value = float(np.mean(means))
    place: dict[Hashable, int] = {}
    for _, tasks in cells:
        for task in tasks:
            place.setdefault(task, len(place))
    sums, counts = _cells_by_task(cells, place)
    if np.ptp(sums.sum(axis=1) / counts.sum(axis=1)) == 0:
        half = _unseen(len(place), level)
        return Interval(value=value, low=max(0.0, value - half), high=min(1.0, value + half))
    above = _resample(list(sums.T), seed)
    below = _resample(list(counts.T), seed)
    rates = np.divide(above, below, out=np.full(above.shape, np.nan), where=below > 0)
    low, high = _tails(np.nanmean(rates, axis=0), level)
    return Interval(value=value, low=low, high=high)


def mcnemar(clean: Sequence[float], corrupted: Sequence[float]) -> float:
    """Return the two-sided p value of McNemar's exact test for paired outcomes.

    A case counts as solved if its score is 1. Only cases that differ between the two conditions
    enter; under the null hypothesis either direction has probability 1/2. The test takes cases for
    independent, so seeds of one task make it optimistic: read it beside the clustered interval.

    Raises:
        ParameterError: the two lists differ in length.
    """
    _same_length(clean, corrupted)
    pairs = list(zip(clean, corrupted, strict=True))
    lost = sum(before == 1.0 and after != 1.0 for before, after in pairs)
    won = sum(before != 1.0 and after == 1.0 for before, after in pairs)
    if lost + won == 0:
        return 1.0
    return float(stats.binomtest(lost, lost + won, 0.5).pvalue)


def holm(p_values: Mapping[str, float]) -> dict[str, float]:
    """Return p values adjusted for testing several corruptions (Holm's step-down method)."""
    if not p_values:
        return {}
    adjusted: Any = multipletests(list(p_values.values()), method="holm")[1]
    return dict(zip(p_values, map(float, adjusted), strict=True))


def detectable_difference(
    clean: Sequence[float],
    corrupted: Sequence[float],
    tasks: Sequence[Hashable],
    *,
    power: float = 0.8,
    level: float = LEVEL,
) -> float | None:
    """Return the smallest true difference that as many tasks would show with probability `power`.

    It rests on the spread of the tasks' mean differences in this run, by a paired t test.

    Returns:
        `None` with fewer than three tasks, or if all tasks differ by the same amount.

    Raises:
        ParameterError: there are no cases, or the three lists differ in length.
    """
    _same_length(clean, corrupted)
    differences = np.asarray(corrupted, np.float64) - np.asarray(clean, np.float64)
    sums, counts = _by_task(differences.tolist(), tasks)
    spread = float(np.std(sums / counts, ddof=1)) if len(sums) > 2 else 0.0
    if spread == 0:
        return None
    return min(1.0, _detectable_effect(len(sums), power, level) * spread)


@lru_cache(maxsize=64)
def _detectable_effect(
    tasks: int,
    power: float,
    level: float,
) -> float:
    """Return the difference that a paired t test finds, in standard deviations of the tasks."""
    effect: Any = TTestPower().solve_power(
        nobs=tasks,
        alpha=1 - level,
        power=power,
    )
    return float(effect)


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


def mean_corruption_error(
    errors: Mapping[str, float], reference: Mapping[str, float]
) -> float | None:
    """Return the mean ratio of an agent's errors to those of a reference agent (mCE).

    Args:
        errors: 1 minus success, by corruption.
        reference: the same of the reference agent.

    Returns:
        `None` if the reference never fails under some corruption: no ratio exists there.

    Raises:
        ParameterError: the two name different corruptions, or none.
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


def _same_length(clean: Sequence[float], corrupted: Sequence[float]) -> None:
    if len(clean) != len(corrupted):
        counts = f"{len(clean)} clean and {len(corrupted)} corrupted scores"
        raise ParameterError(f"scores must come in pairs, got {counts}")


def _by_task(scores: Sequence[float], tasks: Sequence[Hashable]) -> tuple[Floats64, Floats64]:
    """Return the sum and the number of scores of each task, in the order of first appearance."""
    if len(scores) != len(tasks):
        raise ParameterError(f"{len(scores)} scores for {len(tasks)} tasks: give one for each")
    if not scores:
        raise ParameterError("there are no episodes to summarise")
    place = {task: number for number, task in enumerate(dict.fromkeys(tasks))}
    numbers = [place[task] for task in tasks]
    sums: Any = np.bincount(numbers, weights=np.asarray(scores, np.float64))
    counts: Any = np.bincount(numbers)
    return sums.astype(np.float64), counts.astype(np.float64)


def _resampled(
    sums: Floats64,
    counts: Floats64,
    *,
    level: float,
    seed: int,
) -> tuple[float, float]:
    """Return the interval of a mean over tasks; of Wilson's width if all tasks agree."""
    means = sums / counts
    if np.ptp(means) > 0:
        return _bootstrap(sums, counts, level=level, seed=seed)
    half = _unseen(len(sums), level)
    value = float(means[0])
    return value - half, value + half


def _unseen(tasks: int, level: float) -> float:
    """Return the upper end of Wilson's interval for an event never seen in so many tasks."""
    interval: Any = proportion_confint(0, tasks, alpha=1 - level, method="wilson")
    return float(interval[1])


def _cells_by_task(
    cells: Sequence[tuple[Sequence[float], Sequence[Hashable]]],
    place: Mapping[Hashable, int],
) -> tuple[Floats64, Floats64]:
    """Return the sums and the numbers of scores, each float64 `[tasks, cells]`."""
    sums = np.zeros((len(place), len(cells)))
    counts = np.zeros((len(place), len(cells)))
    for column, (scores, tasks) in enumerate(cells):
        rows = [place[task] for task in tasks]
        np.add.at(sums, (rows, column), np.asarray(scores, np.float64))
        np.add.at(counts, (rows, column), 1.0)
    return sums, counts


def _bootstrap(
    numerators: Floats64,
    denominators: Floats64,
    *,
    level: float,
    seed: int,
) -> tuple[float, float]:
    """Return the percentile interval of a ratio of sums, resampling both by task.

    `scipy.stats.bootstrap` refuses ratios that may be infinite, as retention may.
    """
    above, below = _resample([numerators, denominators], seed)
    ratios = np.divide(above, below, out=np.full(RESAMPLES, np.inf), where=below > 0)
    return _tails(ratios, level)


def _tails(values: Floats64, level: float) -> tuple[float, float]:
    """Return the ends of the middle part of resampled values."""
    tail = (1 - level) / 2
    low, high = np.quantile(values, [tail, 1 - tail], method="inverted_cdf")
    return float(low), float(high)


def _resample(columns: Sequence[Floats64], seed: int) -> Floats64:
    """Return the sum of each column over each resample of the tasks: float64 `[C, RESAMPLES]`.

    Args:
        columns: for each of C values, one number a task.
        seed: of the draws.
    """
    values = np.stack(columns, axis=1)
    parts = [drawn @ values for drawn in _draws(len(values), seed)]
    return np.concatenate(parts).T


def _draws(tasks: int, seed: int) -> Iterable[Floats64]:
    """Return how often each task is in each resample, in blocks of float64 `[rows, tasks]`.

    All intervals of a report come from the same resamples, so they are kept, unless they are large.
    """
    if tasks * RESAMPLES <= KEPT:
        return _kept_draws(tasks, seed)
    return _new_draws(tasks, seed)


@lru_cache(maxsize=4)
def _kept_draws(tasks: int, seed: int) -> tuple[Floats64, ...]:
    return tuple(_new_draws(tasks, seed))


def _new_draws(tasks: int, seed: int) -> Iterator[Floats64]:
    rng = np.random.default_rng(seed)
    rows = max(1, BLOCK // tasks)
    for start in range(0, RESAMPLES, rows):
        count = min(rows, RESAMPLES - start)
        picked = rng.integers(0, tasks, (count, tasks))
        places = picked + tasks * np.arange(count)[:, np.newaxis]
        counted: Any = np.bincount(places.ravel(), minlength=count * tasks)
        yield counted.reshape(count, tasks).astype(np.float64)
