"""Accuracy with bootstrap intervals, from the numbers of labels asked for and hit."""

from typing import NamedTuple

import numpy as np

DRAWS = 4000
LEVEL = 0.95


class Interval(NamedTuple):
    """A value and its 95 % interval, all as shares."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:.1%} ({self.low:.1%} to {self.high:.1%})"


def accuracy(counts: np.ndarray, base: np.ndarray | None = None, draws: int = DRAWS) -> Interval:
    """Return the share of hits with its 95 % interval, or its difference to `base`.

    The bootstrap resamples training seeds and pages, both at once, since the controls of a page and
    the answers of a network are correlated. A difference is paired by seed and page.

    Args:
        counts: int64 `[seeds, pages, 2]`, asked and hit.
        base: the counts to compare with, of the same shape.
        draws: number of bootstrap samples.
    """
    seeds, pages = counts.shape[:2]
    rng = np.random.default_rng(0)
    seed_weights = _resampled(rng, seeds, draws)
    page_weights = _resampled(rng, pages, draws)
    value, spread = _shares(counts, seed_weights, page_weights)
    if base is not None:
        second, remaining = _shares(base, seed_weights, page_weights)
        value = value - second
        spread = spread - remaining
    tail = (1 - LEVEL) / 2
    low, high = np.quantile(spread, [tail, (1 + LEVEL) / 2])
    return Interval(float(value), float(low), float(high))


def _resampled(rng: np.random.Generator, count: int, draws: int) -> np.ndarray:
    """Return how often each of `count` things is in each sample, float64 `[draws, count]`."""
    chances = np.full(count, 1 / count)
    draw_counts = rng.multinomial(count, chances, draws)
    return draw_counts.astype(np.float64)


def _shares(
    counts: np.ndarray, seed_weights: np.ndarray, page_weights: np.ndarray
) -> tuple[float, np.ndarray]:
    """Return the share of hits, and that of each bootstrap sample, float64 `[draws]`."""
    path = "rs,spk,rp->rk"
    draw_means = np.einsum(path, seed_weights, counts, page_weights, optimize=True)
    requests, hit = counts.sum((0, 1))
    return hit / requests, draw_means[:, 1] / np.maximum(draw_means[:, 0], 1)
