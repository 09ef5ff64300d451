"""The bootstrap's resamples: how often each task is drawn, the same for all intervals."""

from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Floats64: TypeAlias = npt.NDArray[np.float64]

RESAMPLES = 9999
BLOCK = 1_000_000  # numbers drawn at once
KEPT = 5_000_000  # the most numbers of resamples that are cached for the next interval: 40 MB


def resample(columns: Sequence[Floats64], seed: int) -> Floats64:
    """Return the sum of each column over each resample of the tasks: float64 `[C, RESAMPLES]`.

    Args:
        columns: for each of C values, one number per task.
        seed: of the draws.
    """
    values = np.stack(columns, axis=1)
    parts = [drawn @ values for drawn in _draws(len(values), seed)]
    return np.concatenate(parts).T


def _draws(tasks: int, seed: int) -> Iterable[Floats64]:
    """Return how often each task is in each resample, in blocks of float64 `[rows, tasks]`.

    All intervals of a report come from the same resamples, so they are cached, unless they are
    large.
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
