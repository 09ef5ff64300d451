"""Confidence intervals of success rates, of their differences and of retention.

Episodes of one task resemble each other: another seed changes names and numbers, not the task. So
the intervals rest on how far the tasks differ, not on the number of episodes.

A mean has Wilson's score interval over tasks (from statsmodels), which is valid up to 0 and 1. A
difference and a ratio combine the two Wilson intervals of their means by the method of variance
estimates recovery: Newcombe's interval for paired rates (Newcombe 1998), and that of Donner and Zou
(2012) for ratios. The same formulas hold at 0 %, at 100 % and between.

All scores are success rates in 0..1.
"""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from statsmodels.stats.proportion import proportion_confint

from hijack_data.errors import ParameterError

Floats64: TypeAlias = npt.NDArray[np.float64]
# The data of one cell: scores and the task of each; or clean scores, corrupted scores, and the task
# of each pair.
Scores: TypeAlias = tuple[Sequence[float], Sequence[Hashable]]
PairedScores: TypeAlias = tuple[Sequence[float], Sequence[float], Sequence[Hashable]]

LEVEL = 0.95
NOISE = 1e-9  # values that differ by less are equal: sums of scores such as 0.1 are not exact
# Tasks' worth of doubt that is added to what the tasks show: that the seeds of a task tell no more
# than one of them, and that clean and corrupted success are not related. Few tasks may agree by
# chance, and at 0 and 100 % they always do.
DOUBT = 1.0


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
        they vary less.
        """
        chance = self.value * (1 - self.value)
        doubt = DOUBT / self.tasks
        shown = self.variance * self.count / (self.count - 1) if self.count > 1 else chance
        share = min(1.0, (shown + doubt) / (chance + doubt))
        trials = self.tasks / share
        ends: Any = proportion_confint(
            self.value * trials, trials, alpha=1 - level, method="wilson"
        )
        return max(0.0, min(float(ends[0]), self.value)), min(1.0, max(float(ends[1]), self.value))


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
    least, most = before.interval.at(level)
    low, high = after.interval.at(level)
    related = _correlation(before, after)
    value = after.value - before.value
    below = _combined(after.value - low, most - before.value, related)
    above = _combined(high - after.value, before.value - least, related)
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
    if before.value == 0:
        return None
    value = after.value / before.value
    least, most = before.interval.at(level)
    low, high = after.interval.at(level)
    related = _correlation(before, after)
    product = after.value * before.value
    # The roots of (after - ratio * before) = its distance to the ends, squared.
    middle = product - related * (after.value - low) * (most - before.value)
    square = low * most * (2 * after.value - low) * (2 * before.value - most)
    bottom = (middle - sqrt(max(0.0, middle**2 - square))) / (most * (2 * before.value - most))
    middle = product - related * (high - after.value) * (before.value - least)
    square = high * least * (2 * after.value - high) * (2 * before.value - least)
    top = (middle + sqrt(max(0.0, middle**2 - square))) / (least * (2 * before.value - least))
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
    place: dict[Hashable, int] = {}
    for _, tasks in cells:
        for task in tasks:
            place.setdefault(task, len(place))
    weights = np.zeros(len(place))
    effects = np.zeros(len(place))
    values: list[float] = []
    for scores, tasks in cells:
        cell = _by_task(scores, tasks)
        rows = [place[task] for task in dict.fromkeys(tasks)]
        weights[rows] += cell.weights / len(cells)
        effects[rows] += cell.weights * (cell.means - cell.value) / len(cells)
        values.append(cell.value)
    tasks_told = _effective_tasks(weights)
    variance = float(effects @ effects) * tasks_told
    return _interval(_Wilson(float(np.mean(values)), variance, len(place), tasks_told), level)


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
    for score, task in zip(scores, tasks, strict=True):
        if not 0 <= score <= 1:  # NaN, too
            raise ParameterError(
                f"the score of task {task!r} is {score!r}; scores are numbers from 0 to 1"
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
    return float(np.ptp(values)) <= NOISE


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
    before, counts = _sums_by_task(clean, tasks)
    after, _ = _sums_by_task(corrupted, tasks)
    return after - before, counts


def _sums_by_task(scores: Sequence[float], tasks: Sequence[Hashable]) -> tuple[Floats64, Floats64]:
    """Return the sum and the number of scores of each task, in the order of first appearance."""
    check_scores(scores, tasks)
    place: Mapping[Hashable, int] = {
        task: number for number, task in enumerate(dict.fromkeys(tasks))
    }
    numbers = [place[task] for task in tasks]
    sums: Any = np.bincount(numbers, weights=np.asarray(scores, np.float64))
    counts: Any = np.bincount(numbers)
    return sums.astype(np.float64), counts.astype(np.float64)


def _by_task(scores: Sequence[float], tasks: Sequence[Hashable]) -> _TaskMeans:
    sums, counts = _sums_by_task(scores, tasks)
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
    doubt = DOUBT / before.tasks
    spreads = [one.covariance(one) + doubt for one in (before, after)]
    return before.covariance(after) / sqrt(spreads[0] * spreads[1])


def _combined(one: float, other: float, related: float) -> float:
    """Return the distance to an end of a difference from those of its two means."""
    return sqrt(max(0.0, one**2 - 2 * related * one * other + other**2))
