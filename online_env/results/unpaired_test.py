"""The test of two conditions that were played on different tasks."""

from collections.abc import Hashable, Sequence
from math import comb, sqrt

import numpy as np

from .intervals import Floats64, Scores, are_alike, scores_by_task
from .student_t import noncentral_cdf


def welch_by_task(clean: Scores, corrupted: Scores) -> float | None:
    """Return the two-sided p value of Welch's t test, in which each task is one case.

    If the tasks of each condition all have the same mean, there is no spread to judge by, and p is
    of the exact permutation test: the chance that a random division of the tasks separates them.

    Args:
        clean: scores, 0..1, and the task of each, under the clean condition.
        corrupted: the same of other tasks, under a corruption.

    Returns:
        `None` if a condition has a single task.

    Raises:
        ParameterError: there are no episodes, or a score is not a number in 0..1.
    """
    first, second = _task_means(*clean), _task_means(*corrupted)
    counts = len(first), len(second)
    if min(counts) < 2:
        return None
    if are_alike(first) and are_alike(second):
        if are_alike(np.concatenate([first, second])):
            return 1.0
        return (2 if counts[0] == counts[1] else 1) / comb(sum(counts), counts[0])
    spreads = [float(np.var(means, ddof=1)) / len(means) for means in (first, second)]
    freedom = sum(spreads) ** 2 / sum(
        spread**2 / (count - 1) for spread, count in zip(spreads, counts, strict=True)
    )
    statistic = abs(float(second.mean() - first.mean())) / sqrt(sum(spreads))
    return min(1.0, 2 * noncentral_cdf(-statistic, freedom, 0.0))


def _task_means(scores: Sequence[float], tasks: Sequence[Hashable]) -> Floats64:
    sums, counts = scores_by_task(scores, tasks)
    return sums / counts
