"""Statistics of a benchmark: intervals, paired tests and summaries of success.

Episodes of one task resemble each other: another seed changes names and numbers, not the task.
Intervals therefore resample tasks, not episodes. Tests, power and Wilson's interval come from scipy
and statsmodels; this module arranges the episodes for them.

All scores are success rates in 0..1.
"""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
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
    test = TTestPower()
    effect: Any = test.solve_power(
        nobs=len(sums),
        alpha=1 - level,
        power=power,
    )
    return min(1.0, float(effect) * spread)


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
    unseen: Any = proportion_confint(0, len(sums), alpha=1 - level, method="wilson")
    value = float(means[0])
    return value - float(unseen[1]), value + float(unseen[1])


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
    rng = np.random.default_rng(seed)
    picked = rng.integers(0, len(numerators), (RESAMPLES, len(numerators)))
    above = numerators[picked].sum(axis=1)
    below = denominators[picked].sum(axis=1)
    ratios = np.divide(above, below, out=np.full(RESAMPLES, np.inf), where=below > 0)
    tail = (1 - level) / 2
    low, high = np.quantile(ratios, [tail, 1 - tail], method="inverted_cdf")
    return float(low), float(high)
