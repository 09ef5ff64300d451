"""Confidence intervals of success rates, of their differences and of retention.

Episodes of one task resemble each other: another seed changes names and numbers, not the task. So
the intervals rest on how far the tasks differ, not on the number of episodes.

A mean has Wilson's score interval over tasks. Near 0 and 1 it is too narrow (Brown, Cai and
DasGupta 2001), so with few successes or few failures an end is at least as far out as the exact
one-sided bound of the same level. A
difference and a ratio combine the two Wilson intervals of their means by the method of variance
estimates recovery: Newcombe's interval for paired rates (Newcombe 1998), and that of Donner and Zou
(2012) for ratios. The same formulas hold at 0 %, at 100 % and between.

All scores are success rates in 0..1.
"""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import sqrt
from statistics import NormalDist
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from hijack_data.errors import ParameterError

from .exact_bounds import exact_lower_end

Floats64: TypeAlias = npt.NDArray[np.float64]
# The data of one cell: scores and the task of each; or clean scores, corrupted scores, and the task
# of each pair.
Scores: TypeAlias = tuple[Sequence[float], Sequence[Hashable]]
PairedScores: TypeAlias = tuple[Sequence[float], Sequence[float], Sequence[Hashable]]

LEVEL = 0.95
TOLERANCE = 1e-9  # values that differ by less are equal: sums of scores such as 0.1 are not exact
# Weight, in tasks, of a prior that is added to the data. Its content: the seeds of a task tell no
# more than one of them, and clean and corrupted success are unrelated. Few tasks may agree by
# chance, and at 0 and 100 % they always do.
PRIOR_TASKS = 1.0
# Successes; with more, Wilson's lower end is the lower one (with 10 at a level of 95 %).
FEW = 200.0


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


@dataclass(frozen=True, kw_only=True)
class _TaskMeans:
    """Scores by task.

    Attributes:
        means: the mean score of each task, float64 `[tasks]`.
        weights: the share of the episodes that are of each task, float64 `[tasks]`.
        value: the mean score of all episodes.
    """

    means: Floats64
    weights: Floats64
    value: float

    @property
    def tasks(self) -> float:
        """The number of tasks; less if some have more episodes than others."""
        return _effective_tasks(self.weights)

    def covariance(self, other: "_TaskMeans") -> float:
        """Return the covariance over tasks with scores of the same episodes."""
        products = (self.means - self.value) * (other.means - other.value)
        return float(self.weights**2 @ products) * self.tasks

    @property
    def interval(self) -> "_Wilson":
        return _Wilson(self.value, self.covariance(self), len(self.means), self.tasks)


@dataclass(frozen=True)
class _Wilson:
    """What Wilson's interval of a mean over tasks is computed from.

    Attributes:
        value: the mean.
        variance: of the tasks' means.
        count: the number of tasks.
        tasks: the number of equally large tasks that would tell as much.
    """

    value: float
    variance: float
    count: int
    tasks: float

    def at(self, level: float) -> tuple[float, float]:
        """Return the ends of the interval.

        If the episodes of a task always end alike, the tasks' means vary as much as single
        outcomes do, and the interval is Wilson's for this number of tasks. It is narrower if
        they vary less. With fewer than `FEW` successes the lower end is not above the exact bound,
        and with fewer failures the upper end not below it.
        """
        chance = self.value * (1 - self.value)
        doubt = PRIOR_TASKS / self.tasks
        measured = self.variance * self.count / (self.count - 1) if self.count > 1 else chance
        share = min(1.0, (measured + doubt) / (chance + doubt))
        trials = self.tasks / share
        low, high = _wilson_ends(self.value, trials, level)
        successes, failures = self.value * trials, (1 - self.value) * trials
        if TOLERANCE < successes < FEW and low > 0:
            low = exact_lower_end(successes, failures, level, low)
        if TOLERANCE < failures < FEW and high < 1:
            exact = exact_lower_end(failures, successes, level, 1 - high)
            if exact < 1 - high:  # else the last digit would change
                high = 1 - exact
        return max(0.0, min(low, self.value)), min(1.0, max(high, self.value))


def _wilson_ends(share: float, trials: float, level: float) -> tuple[float, float]:
    """Return the ends of Wilson's interval of a share of `trials`, which may be fractional."""
    squared = _normal_quantile((1 + level) / 2) ** 2
    middle = (share + squared / (2 * trials)) / (1 + squared / trials)
    spread = squared * (share * (1 - share) + squared / (4 * trials)) / trials
    half = sqrt(spread) / (1 + squared / trials)
    return middle - half, middle + half


@lru_cache(maxsize=16)
def _normal_quantile(probability: float) -> float:
    return NormalDist().inv_cdf(probability)


def mean_interval(
    scores: Sequence[float], tasks: Sequence[Hashable], *, level: float = LEVEL
) -> Interval:
    """Return the mean score of some episodes, with Wilson's interval over tasks.

    Args:
        scores: one score per episode, 0..1.
        tasks: the task of each episode.
        level: the confidence level, between 0 and 1.

    Raises:
        ParameterError: there are no episodes, the two lists differ in length, or a score is not a
            number in 0..1.
    """
    return _interval(_by_task(scores, tasks).interval, level)


def difference_interval(
    clean: Sequence[float],
    corrupted: Sequence[float],
    tasks: Sequence[Hashable],
    *,
    level: float = LEVEL,
) -> Interval:
    """Return the mean difference of paired episodes (corrupted minus clean), with its interval.

    Args:
        clean: the score of each case under the clean condition.
        corrupted: the score of the same case (task and seed) under a corruption.
        tasks: the task of each case.
        level: the confidence level, between 0 and 1.

    Raises:
        ParameterError: there are no cases, the three lists differ in length, or a score is not a
            number in 0..1.
    """
    before, after = _pairs_by_task(clean, corrupted, tasks)
    return _difference(before, after, _correlation(before, after), level)


def unpaired_difference_interval(
    clean: Scores, corrupted: Scores, *, level: float = LEVEL
) -> Interval:
    """Return the difference of the means of two samples of tasks, with its interval.

    It is Newcombe's interval for unpaired rates, over tasks.

    Args:
        clean: scores, 0..1, and the task of each, under the clean condition.
        corrupted: the same of other tasks, under a corruption.
        level: the confidence level, between 0 and 1.

    Raises:
        ParameterError: there are no episodes, or a score is not a number in 0..1.
    """
    return _difference(_by_task(*clean), _by_task(*corrupted), 0.0, level)


def _difference(
    before: "_TaskMeans", after: "_TaskMeans", related: float, level: float
) -> Interval:
    """Return the difference of two means whose correlation over tasks is `related`."""
    clean_low, clean_high = before.interval.at(level)
    low, high = after.interval.at(level)
    value = after.value - before.value
    below = _combined(after.value - low, clean_high - before.value, related)
    above = _combined(high - after.value, before.value - clean_low, related)
    return Interval(value=value, low=max(-1.0, value - below), high=min(1.0, value + above))


def retention_interval(
    clean: Sequence[float],
    corrupted: Sequence[float],
    tasks: Sequence[Hashable],
    *,
    level: float = LEVEL,
) -> Interval | None:
    """Return the share of its clean success that an agent keeps, with its interval.

    Args:
        clean: the score of each case under the clean condition.
        corrupted: the score of the same case under a corruption.
        tasks: the task of each case.
        level: the confidence level, between 0 and 1.

    Returns:
        `None` if the agent has no clean success, since there is nothing to keep.

    Raises:
        ParameterError: there are no cases, the three lists differ in length, or a score is not a
            number in 0..1.
    """
    before, after = _pairs_by_task(clean, corrupted, tasks)
    return _retention(before, after, _correlation(before, after), level)


def unpaired_retention_interval(
    clean: Scores, corrupted: Scores, *, level: float = LEVEL
) -> Interval | None:
    """Return the ratio of the means of two samples of tasks, with its interval.

    Args and errors are those of `unpaired_difference_interval`.

    Returns:
        `None` if the agent has no clean success.
    """
    return _retention(_by_task(*clean), _by_task(*corrupted), 0.0, level)


def _retention(
    before: "_TaskMeans", after: "_TaskMeans", related: float, level: float
) -> Interval | None:
    """Return the ratio of two means whose correlation over tasks is `related`."""
    if before.value == 0:
        return None
    value = after.value / before.value
    clean_low, clean_high = before.interval.at(level)
    low, high = after.interval.at(level)
    product = after.value * before.value
    # The roots of (after - ratio * before) = its distance to the ends, squared.
    middle = product - related * (after.value - low) * (clean_high - before.value)
    square = low * clean_high * (2 * after.value - low) * (2 * before.value - clean_high)
    bottom = (middle - sqrt(max(0.0, middle**2 - square))) / (
        clean_high * (2 * before.value - clean_high)
    )
    middle = product - related * (high - after.value) * (before.value - clean_low)
    square = high * clean_low * (2 * after.value - high) * (2 * before.value - clean_low)
    top = (middle + sqrt(max(0.0, middle**2 - square))) / (
        clean_low * (2 * before.value - clean_low)
    )
    return Interval(value=value, low=max(0.0, min(bottom, value)), high=max(top, value))


def grand_mean_interval(cells: Sequence[Scores], *, level: float = LEVEL) -> Interval:
    """Return the mean of several cells' mean scores, such as over the nine, with its interval.

    It is Wilson's over tasks: each task counts once, with its episodes of all cells.

    Args:
        cells: for each cell its scores, 0..1, and the task of each.
        level: the confidence level, between 0 and 1.

    Raises:
        ParameterError: there is no cell, a cell has no episodes, or a score is not a number in
            0..1.
    """
    if not cells:
        raise ParameterError("there are no cells to average")
    index_by_task: dict[Hashable, int] = {}
    names_by_cell = [_distinct(tasks) for _, tasks in cells]
    for names in names_by_cell:
        for task in names:
            index_by_task.setdefault(task, len(index_by_task))
    weights = np.zeros(len(index_by_task))
    effects = np.zeros(len(index_by_task))
    values: list[float] = []
    for (scores, tasks), names in zip(cells, names_by_cell, strict=True):
        cell = _by_task(scores, tasks)
        rows = [index_by_task[task] for task in names]
        weights[rows] += cell.weights / len(cells)
        effects[rows] += cell.weights * (cell.means - cell.value) / len(cells)
        values.append(cell.value)
    tasks_told = _effective_tasks(weights)
    variance = float(effects @ effects) * tasks_told
    return _interval(
        _Wilson(float(np.mean(values)), variance, len(index_by_task), tasks_told), level
    )


def check_scores(scores: Sequence[float], tasks: Sequence[Hashable]) -> None:
    """Check that there is a score for each task, and that each is one.

    Raises:
        ParameterError: the two lists differ in length or are empty, or a score is not a number in
            0..1.
    """
    if len(scores) != len(tasks):
        raise ParameterError(f"{len(scores)} scores for {len(tasks)} tasks: give one for each")
    if not len(scores):
        raise ParameterError("there are no episodes to summarise")
    values = np.asarray(scores, np.float64)
    wrong = np.flatnonzero(~((values >= 0) & (values <= 1)))  # NaN, too
    if wrong.size:
        index = int(wrong[0])
        raise ParameterError(
            f"the score of task {tasks[index]!r} is {scores[index]!r}; scores are numbers from 0 to"
            " 1"
        )


def check_pairs(clean: Sequence[float], corrupted: Sequence[float]) -> None:
    """Check that each clean score has a corrupted one.

    Raises:
        ParameterError: the two lists differ in length.
    """
    if len(clean) != len(corrupted):
        counts = f"{len(clean)} clean and {len(corrupted)} corrupted scores"
        raise ParameterError(f"scores must come in pairs, got {counts}")


def are_alike(values: Floats64) -> bool:
    """Return whether values are equal but for rounding."""
    return float(np.ptp(values)) <= TOLERANCE


def differences_by_task(
    clean: Sequence[float], corrupted: Sequence[float], tasks: Sequence[Hashable]
) -> tuple[Floats64, Floats64]:
    """Return the sum of the differences (corrupted minus clean) and their number, by task.

    Both are float64 `[tasks]`.

    Raises:
        ParameterError: there are no cases, the three lists differ in length, or a score is not a
            number in 0..1.
    """
    check_pairs(clean, corrupted)
    before, counts = scores_by_task(clean, tasks)
    after, _ = scores_by_task(corrupted, tasks)
    return after - before, counts


def scores_by_task(scores: Sequence[float], tasks: Sequence[Hashable]) -> tuple[Floats64, Floats64]:
    """Return the sum and the number of scores of each task, in the order of first appearance."""
    check_scores(scores, tasks)
    numbers = number_tasks(tasks)
    sums: Any = np.bincount(numbers, weights=np.asarray(scores, np.float64))
    counts: Any = np.bincount(numbers)
    return sums.astype(np.float64), counts.astype(np.float64)


def number_tasks(tasks: Sequence[Hashable]) -> Any:
    """Return the number of the task of each case, from 0 in the order of first appearance."""
    if isinstance(tasks, np.ndarray):
        _, first, numbers = np.unique(tasks, return_index=True, return_inverse=True)
        return np.argsort(np.argsort(first))[numbers]
    number_by_task = {task: number for number, task in enumerate(dict.fromkeys(tasks))}
    return [number_by_task[task] for task in tasks]


def _distinct(tasks: Sequence[Hashable]) -> Sequence[Hashable]:
    """Return each task once, in the order of first appearance."""
    if isinstance(tasks, np.ndarray):
        names, first = np.unique(tasks, return_index=True)
        return names[np.argsort(first)].tolist()
    return list(dict.fromkeys(tasks))


def _by_task(scores: Sequence[float], tasks: Sequence[Hashable]) -> _TaskMeans:
    sums, counts = scores_by_task(scores, tasks)
    total = counts.sum()
    value = min(1.0, float(sums.sum() / total))
    return _TaskMeans(means=sums / counts, weights=counts / total, value=value)


def _pairs_by_task(
    clean: Sequence[float], corrupted: Sequence[float], tasks: Sequence[Hashable]
) -> tuple[_TaskMeans, _TaskMeans]:
    check_pairs(clean, corrupted)
    return _by_task(clean, tasks), _by_task(corrupted, tasks)


def _effective_tasks(weights: Floats64) -> float:
    """Return the number of equally large tasks that tell as much as tasks with these weights."""
    return float(1 / (weights @ weights))


def _interval(wilson: _Wilson, level: float) -> Interval:
    low, high = wilson.at(level)
    return Interval(value=wilson.value, low=low, high=high)


def _correlation(before: _TaskMeans, after: _TaskMeans) -> float:
    """Return the correlation of clean and corrupted success over tasks, which is not overrated."""
    doubt = PRIOR_TASKS / before.tasks
    spreads = [means.covariance(means) + doubt for means in (before, after)]
    return before.covariance(after) / sqrt(spreads[0] * spreads[1])


def _combined(first: float, second: float, related: float) -> float:
    """Return the distance to an end of a difference from those of its two means."""
    return sqrt(max(0.0, first**2 - 2 * related * first * second + second**2))
