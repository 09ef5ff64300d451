"""The exact bound of a success rate from few failures, without scipy, whose import takes 0.3 s.

Tests compare both functions with scipy.
"""

from functools import lru_cache
from math import exp, lgamma, log, log1p

_TINY = 1e-300  # in the place of a zero denominator of the continued fraction
_PRECISION = 1e-12
_MAX_TERMS = 1000
_LEAST_LOG = -600.0  # of a bound that is as good as 0
_DIGITS = 12  # of a bound: the last ones of a logarithm differ between machines
_TOLERANCE = 1e-10  # of the logarithm of a bound


def beta_cdf(value: float, a: float, b: float) -> float:
    """Return the probability that a beta variable is at most `value`.

    It is the incomplete beta function, by the continued fraction of DLMF 8.17.22.

    Args:
        value: above 0 and below 1.
        a: the first shape, above 0.
        b: the second, likewise.
    """
    if value > (a + 1) / (a + b + 2):  # the fraction converges slowly there
        return 1.0 - beta_cdf(1.0 - value, b, a)
    scale = exp(lgamma(a + b) - lgamma(a) - lgamma(b) + a * log(value) + b * log1p(-value))
    front, back = 1.0, 1.0 / _nonzero(1.0 - (a + b) * value / (a + 1))
    fraction = back
    for term in range(1, _MAX_TERMS):
        even = term * (b - term) * value / ((a + 2 * term - 1) * (a + 2 * term))
        odd = -(a + term) * (a + b + term) * value / ((a + 2 * term) * (a + 2 * term + 1))
        for part in (even, odd):
            back = 1.0 / _nonzero(1.0 + part * back)
            front = _nonzero(1.0 + part / front)
            fraction *= front * back
        if abs(front * back - 1.0) < _PRECISION:
            break
    return scale * fraction / a


def _nonzero(value: float) -> float:
    return value if abs(value) > _TINY else _TINY


@lru_cache(maxsize=4096)
def exact_lower_end(successes: float, failures: float, level: float, low: float) -> float:
    """Return the one-sided lower bound of a rate by Clopper and Pearson, or `low` if that is lower.

    Args:
        successes: above 0; may be fractional, as may be `failures`.
        failures: at least 0.
        level: the confidence level, between 0 and 1.
        low: the lower end of another interval, above 0 and below 1.
    """
    a, b, chance = successes, failures + 1, 1 - level
    if beta_cdf(low, a, b) <= chance:
        return low
    # Newton's method in logarithms, in which the tail is nearly a line.
    constant = lgamma(a + b) - lgamma(a) - lgamma(b)
    point, step = log(low), 1.0
    while abs(step) > _TOLERANCE:
        value = exp(point)
        tail = beta_cdf(value, a, b)
        slope = exp(constant + a * point + (b - 1) * log1p(-value)) / tail
        step = (log(tail) - log(chance)) / slope
        point -= step
        if point < _LEAST_LOG:
            return 0.0
    return round(exp(point), _DIGITS)
