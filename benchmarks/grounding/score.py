"""Accuracy with intervals, from how many controls were asked for and how many were hit."""

from typing import NamedTuple

import numpy as np

DRAWS, LEVEL = 4000, 0.95


class Interval(NamedTuple):
    """A value and its 95 % interval, all as shares."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:.1%} ({self.low:.1%} to {self.high:.1%})"


def accuracy(counts: np.ndarray, base: np.ndarray | None = None, draws: int = DRAWS) -> Interval:
    """Return the share of hits with its 95 % interval, or its difference to `base`, paired by seed and page.

    The bootstrap draws training seeds and pages anew, both at once: the controls of a page and the answers of a network
    hang together.

    Args:
        counts: int64 `[seeds, pages, 2]`, asked and hit.
        base: of the same shape, what to compare with.
        draws: bootstrap samples.
    """
    seeds, pages = counts.shape[:2]
    rng = np.random.default_rng(0)
    of_seeds = rng.multinomial(seeds, np.full(seeds, 1 / seeds), draws).astype(np.float64)
    of_pages = rng.multinomial(pages, np.full(pages, 1 / pages), draws).astype(np.float64)

    def shares(some: np.ndarray) -> tuple[float, np.ndarray]:
        drawn = np.einsum("rs,spk,rp->rk", of_seeds, some, of_pages, optimize=True)
        total = some.sum((0, 1))
        return total[1] / total[0], drawn[:, 1] / np.maximum(drawn[:, 0], 1)

    value, spread = shares(counts)
    if base is not None:
        other, others = shares(base)
        value, spread = value - other, spread - others
    low, high = np.quantile(spread, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return Interval(float(value), float(low), float(high))
