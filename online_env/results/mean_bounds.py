"""One-sided bounds of means and ratios of means that hold for few tasks and at 0 and 100 %.

A task is one case, whatever its episodes: its scores are means over seeds and conditions, in 0..1.
Tasks are taken as a random sample. Three methods:

* **Clopper-Pearson** (Clopper and Pearson 1934): exact for trials that succeed or fail.
* **Gaffke** (Gaffke 2005; Learned-Miller and Thomas 2019, arXiv:1905.06208): for values of any
  distribution above a least one. It is the Bayesian bootstrap over tasks with one more task that
  has the least value, so it does not fail where all tasks agree. With outcomes 0 and 1 it is
  Clopper-Pearson's; beyond them its coverage is a conjecture that no simulation has refuted, and
  `benchmarks/interval_coverage.py` measures it.
* **Betting** (Waudby-Smith and Ramdas 2024, "Estimating means of bounded random variables by
  betting", JRSS B 86): a confidence sequence. A fortune is bet against the hypothesis; it exceeds
  1 / alpha at any time with a probability of at most alpha (Ville's inequality), so one may look
  after every task and stop. The bets are the authors' grid Kelly: several constant ones, averaged.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import log, pi

import numpy as np
import numpy.typing as npt

from hijack_data.errors import ParameterError

from .intervals import LEVEL, Floats64

LOG_STEP = 0.05  # of the integral, in log t; its error is below 1e-9
TAIL = 1e-12  # share of the integral's scale that is left out at either end
MAX_TERMS = (
    2000  # different values; of more, each is rounded down, by at most 1 / 1000 of the range
)
BOUND_TOLERANCE = 1e-7
# Shares of the largest bet that cannot ruin: 1, 0.71, 0.5 ... 0.03. A loss of success needs small
# bets, a success without loss the largest.
BETS: Floats64 = 2.0 ** (-np.arange(11) / 2)


def clopper_pearson_lower(successes: int, trials: int, level: float = LEVEL) -> float:
    """Return the exact one-sided lower bound of a probability.

    Args:
        successes: 0 to `trials`.
        trials: independent ones, at least 1.
        level: the confidence level, between 0 and 1.

    Raises:
        ParameterError: there is no trial, or there are more successes than trials.
    """
    from scipy.special import betaincinv

    if not 0 <= successes <= trials or not trials:
        raise ParameterError(f"successes must be 0 to the trials, got {successes} of {trials}")
    if not successes:
        return 0.0
    return float(betaincinv(successes, trials - successes + 1, 1 - level))


def mean_p_value(values: npt.ArrayLike, least: float) -> float:
    """Return Gaffke's p value of the hypothesis that a mean is at most 0.

    Args:
        values: one for each task, `[tasks]`.
        least: the least value that a task can have; below 0.

    Returns:
        The probability that the sum of `values` and `least`, each times a standard exponential
        variable, is at most 0 (inverted from its characteristic function, as Imhof 1961 does).

    Raises:
        ParameterError: there is no value, one is below `least`, or `least` is not below 0.
    """
    numbers = np.asarray(values, np.float64)
    if not numbers.size or not least < 0 or not numbers.min() >= least - 1e-9:
        raise ParameterError(f"give values of at least {least!r}, which must be below 0")
    terms, counts = np.unique(np.append(numbers, least), return_counts=True)
    if len(terms) > MAX_TERMS:
        grid = float(np.ptp(terms)) / 1000
        rounded = np.maximum(np.floor(np.append(numbers, least) / grid) * grid, least)
        terms, counts = np.unique(rounded, return_counts=True)
    scale = float(np.abs(terms) @ counts)
    step = LOG_STEP if len(numbers) <= 10_000 else LOG_STEP / 4  # more tasks, narrower peaks
    points = np.arange(log(TAIL / scale), log(1 / (TAIL * float(np.abs(terms).max()))), step)
    products = np.outer(np.exp(points), terms)
    angle = np.arctan(products) @ counts
    decay = np.log1p(products**2) @ counts / 2
    integral = float(np.sum(np.sin(angle) * np.exp(-decay))) * step
    return min(1.0, max(0.0, 0.5 - integral / pi))


def gaffke_retention_bound(clean: Floats64, corrupted: Floats64, level: float = LEVEL) -> float:
    """Return Gaffke's lower bound of the ratio of two means over tasks.

    The added task is solved clean, and lost.

    Args:
        clean: the clean score of each task, 0..1, float64 `[tasks]`.
        corrupted: its corrupted score, likewise.
        level: the confidence level, between 0 and 1.

    Raises:
        ParameterError: no task has any clean success.
    """
    return _largest_ratio(
        lambda ratio: mean_p_value(corrupted - ratio * clean, -ratio) <= 1 - level,
        _check_tasks(clean, corrupted),
    )


@dataclass(frozen=True, kw_only=True)
class BettingSequence:
    """The bets on the tasks of a run, in the order in which they were drawn.

    Attributes:
        clean: the clean score of each task, 0..1, float64 `[tasks]`.
        corrupted: its corrupted score, likewise.
    """

    clean: Floats64
    corrupted: Floats64

    def fortunes(self, ratio: float) -> Floats64:
        """Return the fortune after each task, float64 `[tasks]`, from 1 at the start.

        It grows where tasks keep more of their clean success than `ratio`, which is the hypothesis
        that is bet against.

        Raises:
            ParameterError: `ratio` is not above 0.
        """
        if not ratio > 0:
            raise ParameterError(f"the retention must be above 0, got {ratio!r}")
        bets = BETS[:, None]
        factors = 1 + bets * (self.corrupted / ratio - self.clean)
        with np.errstate(divide="ignore"):
            logs = np.cumsum(np.log(np.maximum(factors, 0.0)), axis=1)
        return np.exp(np.minimum(logs, 700.0)).mean(axis=0)

    def stop(self, ratio: float, level: float = LEVEL) -> int | None:
        """Return after how many tasks a retention above `ratio` is shown; `None` if it is not."""
        crossed = np.flatnonzero(self.fortunes(ratio) >= 1 / (1 - level))
        return int(crossed[0]) + 1 if crossed.size else None

    def bound(self, level: float = LEVEL) -> float:
        """Return the lower bound of the retention, which holds at all times together.

        Raises:
            ParameterError: no task has any clean success.
        """
        return _largest_ratio(
            lambda ratio: self.stop(ratio, level) is not None,
            _check_tasks(self.clean, self.corrupted),
        )


def _check_tasks(clean: Floats64, corrupted: Floats64) -> float:
    """Return a ratio that is above every bound of some tasks.

    Raises:
        ParameterError: no task has any clean success.
    """
    if not clean.sum() > 0:
        raise ParameterError("no task is solved clean, so there is no success to keep")
    # A bound of a prefix may exceed the ratio of all, but not the best ratio of a prefix.
    before = np.cumsum(clean)
    return float(np.max(np.cumsum(corrupted)[before > 0] / before[before > 0])) + 1e-6


def _largest_ratio(is_excluded: Callable[[float], bool], high: float) -> float:
    """Return the largest ratio that data exclude, from below, by bisection."""
    low = 0.0
    while high - low > BOUND_TOLERANCE:
        middle = (low + high) / 2
        low, high = (middle, high) if is_excluded(middle) else (low, middle)
    return low
