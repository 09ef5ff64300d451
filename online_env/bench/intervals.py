"""Confidence intervals of success rates, of their differences and of retention.

Episodes of one task resemble each other: another seed changes names and numbers, not the task.
Intervals therefore resample tasks, not episodes. Wilson's interval comes from statsmodels.

All scores are success rates in 0..1.
"""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any, TypeAlias

import numpy as np
from statsmodels.stats.proportion import proportion_confint

from hijack_data.errors import ParameterError

from .resampling import Floats64, resample

# The data of one cell: scores and the task of each; or clean scores, corrupted scores, and the task
# of each pair.
Scores: TypeAlias = tuple[Sequence[float], Sequence[Hashable]]
PairedScores: TypeAlias = tuple[Sequence[float], Sequence[float], Sequence[Hashable]]
# By task: the sums of the numerator, and those of the denominator.
_Ratio: TypeAlias = tuple[Floats64, Floats64]

LEVEL = 0.95
NOISE = 1e-9  # values that differ by less are equal: sums of scores such as 0.1 are not exact
BATCH = 100  # intervals computed at once


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
    scores: Sequence[float], tasks: Sequence[Hashable], *, level: float = LEVEL, seed: int = 0
) -> Interval:
    """Return the mean score of some episodes, with a bootstrap interval that resamples tasks.

    If all tasks have the same mean, a bootstrap interval would have no width. The interval is then
    that of an event never observed in this number of tasks (Wilson's score interval).

    Args:
        scores: one score per episode, 0..1.
        tasks: the task of each episode.
        level: the confidence level, between 0 and 1.
        seed: seed of the resampling; the same seed gives the same interval.

    Raises:
        ParameterError: there are no episodes, or the two lists differ in length.
    """
    return mean_intervals([(scores, tasks)], level=level, seed=seed)[0]


def mean_intervals(
    cells: Sequence[Scores], *, level: float = LEVEL, seed: int = 0
) -> list[Interval]:
    """Return `mean_interval` of each cell, which is faster for all cells at once."""
    found = _intervals([_by_task(*cell) for cell in cells], level=level, seed=seed)
    return [_clipped(interval, 0.0) for interval in found]


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
    return difference_intervals([(clean, corrupted, tasks)], level=level, seed=seed)[0]


def difference_intervals(
    cells: Sequence[PairedScores], *, level: float = LEVEL, seed: int = 0
) -> list[Interval]:
    """Return `difference_interval` of each cell, which is faster for all cells at once."""
    found = _intervals([differences_by_task(*cell) for cell in cells], level=level, seed=seed)
    return [_clipped(interval, -1.0) for interval in found]


def retention_interval(
    clean: Sequence[float],
    corrupted: Sequence[float],
    tasks: Sequence[Hashable],
    *,
    level: float = LEVEL,
    seed: int = 0,
) -> Interval | None:
    """Return the share of its clean success that an agent keeps, with its interval.

    Args:
        clean: the score of each case under the clean condition.
        corrupted: the score of the same case under a corruption.
        tasks: the task of each case.
        level: the confidence level, between 0 and 1.
        seed: of the resampling.

    If every task keeps the same share, a bootstrap interval would have no width. The interval then
    rests on how many tasks have clean success, as in `mean_interval`.

    Returns:
        `None` if the agent has no clean success, since there is nothing to keep. The interval is
        unbounded above (`inf`) if resampled tasks may have no clean success.

    Raises:
        ParameterError: there are no cases, or the three lists differ in length.
    """
    return retention_intervals([(clean, corrupted, tasks)], level=level, seed=seed)[0]


def retention_intervals(
    cells: Sequence[PairedScores], *, level: float = LEVEL, seed: int = 0
) -> list[Interval | None]:
    """Return `retention_interval` of each cell, which is faster for all cells at once."""
    shares: list[_Ratio] = []
    counts: list[int] = []
    for clean, corrupted, tasks in cells:
        check_pairs(clean, corrupted)
        before, _ = _by_task(clean, tasks)
        after, _ = _by_task(corrupted, tasks)
        shares.append((after, before))
        counts.append(len(tasks))
    known = [share for share in shares if share[1].sum() > 0]
    ends = iter(_bootstrap(known, level=level, seed=seed))
    found: list[Interval | None] = []
    for (after, before), cases in zip(shares, counts, strict=True):
        if before.sum() == 0:
            found.append(None)
            continue
        low, high = next(ends)
        value = float(after.sum() / before.sum())
        if are_alike(after - value * before):
            half = _unseen(int((before > 0).sum()), level)
            low = max(0.0, value - half)
            if isfinite(high):
                high = min(value + half, cases / float(before.sum()))  # all of them solved
        found.append(Interval(value=value, low=low, high=high))
    return found


def grand_mean_interval(
    cells: Sequence[Scores], *, level: float = LEVEL, seed: int = 0
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
    if are_alike(sums.sum(axis=1) / counts.sum(axis=1)):
        half = _unseen(len(place), level)
        return Interval(value=value, low=max(0.0, value - half), high=min(1.0, value + half))
    above = resample(list(sums.T), seed)
    below = resample(list(counts.T), seed)
    rates = np.divide(above, below, out=np.full(above.shape, np.nan), where=below > 0)
    low, high = _tails(np.nanmean(rates, axis=0), level)
    return Interval(value=value, low=low, high=high)


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


def differences_by_task(
    clean: Sequence[float], corrupted: Sequence[float], tasks: Sequence[Hashable]
) -> tuple[Floats64, Floats64]:
    """Return the sum of the differences (corrupted minus clean) and their number, by task.

    Both are float64 `[tasks]`.

    Raises:
        ParameterError: there are no cases, or the three lists differ in length.
    """
    check_pairs(clean, corrupted)
    differences = np.asarray(corrupted, np.float64) - np.asarray(clean, np.float64)
    return _by_task(differences.tolist(), tasks)


def _clipped(interval: Interval, least: float) -> Interval:
    return Interval(
        value=interval.value, low=max(least, interval.low), high=min(1.0, interval.high)
    )


def _intervals(cells: Sequence[_Ratio], *, level: float, seed: int) -> list[Interval]:
    """Return the means over tasks with intervals, which have Wilson's width if all tasks agree."""
    differing = [cell for cell in cells if not are_alike(cell[0] / cell[1])]
    ends = iter(_bootstrap(differing, level=level, seed=seed))
    found: list[Interval] = []
    for sums, counts in cells:
        value = float(sums.sum() / counts.sum())
        if are_alike(sums / counts):
            half = _unseen(len(sums), level)
            low, high = value - half, value + half
        else:
            low, high = next(ends)
        found.append(Interval(value=value, low=low, high=high))
    return found


def _unseen(tasks: int, level: float) -> float:
    """Return the upper end of Wilson's interval for an event never observed in `tasks` tasks."""
    interval: Any = proportion_confint(0, tasks, alpha=1 - level, method="wilson")
    return float(interval[1])


def _cells_by_task(
    cells: Sequence[Scores], place: Mapping[Hashable, int]
) -> tuple[Floats64, Floats64]:
    """Return the sums and the numbers of scores, each float64 `[tasks, cells]`."""
    sums = np.zeros((len(place), len(cells)))
    counts = np.zeros((len(place), len(cells)))
    for column, (scores, tasks) in enumerate(cells):
        rows = [place[task] for task in tasks]
        np.add.at(sums, (rows, column), np.asarray(scores, np.float64))
        np.add.at(counts, (rows, column), 1.0)
    return sums, counts


def _bootstrap(ratios: Sequence[_Ratio], *, level: float, seed: int) -> list[tuple[float, float]]:
    """Return the percentile interval of each ratio of sums, resampling both by task.

    `scipy.stats.bootstrap` refuses ratios that may be infinite, such as retention, and draws new
    resamples for each ratio. Here ratios over equally many tasks share their resamples: one product
    of matrices.
    """
    found: dict[int, tuple[float, float]] = {}
    sizes: dict[int, list[int]] = {}
    for place, (numerators, _) in enumerate(ratios):
        sizes.setdefault(len(numerators), []).append(place)
    for places in sizes.values():
        for start in range(0, len(places), BATCH):
            batch = places[start : start + BATCH]
            ends = _ends([ratios[place] for place in batch], level, seed)
            found.update(zip(batch, ends, strict=True))
    return [found[place] for place in range(len(ratios))]


def _ends(ratios: Sequence[_Ratio], level: float, seed: int) -> list[tuple[float, float]]:
    """Return the intervals of ratios over equally many tasks."""
    above = resample([numerators for numerators, _ in ratios], seed)
    below = resample([denominators for _, denominators in ratios], seed)
    values = np.divide(above, below, out=np.full(above.shape, np.inf), where=below > 0)
    return [_tails(row, level) for row in values]


def _tails(values: Floats64, level: float) -> tuple[float, float]:
    """Return the ends of the middle part of resampled values."""
    tail = (1 - level) / 2
    low, high = np.quantile(values, [tail, 1 - tail], method="inverted_cdf")
    return float(low), float(high)
