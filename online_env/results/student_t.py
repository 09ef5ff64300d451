"""Student's t distribution, central and noncentral, without scipy, whose import takes 0.3 s.

Tests compare both functions with scipy.
"""

from functools import lru_cache
from math import erfc, exp, lgamma, log, log1p, sqrt

# Points of the quadrature, with which it is exact to 1e-10; few degrees of freedom have long tails.
_POINTS, _POINTS_OF_FEW, _FEW = 240, 600, 10
_TOLERANCE = 1e-13


def noncentral_cdf(value: float, freedom: float, shift: float) -> float:
    """Return the probability that a noncentral t variable is at most `value`.

    Such a variable is a normal one with mean `shift`, divided by an independent spread. This is the
    mean over spreads of the normal probability, by the trapezoidal rule on their logarithms, where
    the integrand falls off at both ends.

    Args:
        value: any number.
        freedom: degrees of freedom, at least 1; a fraction for Welch's test.
        shift: the noncentrality; 0 for Student's t.
    """
    root = sqrt(2)
    total = sum(
        weight * erfc((shift - value * spread) / root) for weight, spread in _spreads(freedom)
    )
    return min(1.0, total / 2)


def quantile(probability: float, freedom: float) -> float:
    """Return the value below which a t variable is with `probability`, 0.5 to 1."""
    low, high = 0.0, 2.0
    while noncentral_cdf(high, freedom, 0.0) < probability:
        low, high = high, 2 * high
    while high - low > _TOLERANCE * high:
        middle = (low + high) / 2
        if noncentral_cdf(middle, freedom, 0.0) < probability:
            low = middle
        else:
            high = middle
    return high


@lru_cache(maxsize=16)
def _spreads(freedom: float) -> tuple[tuple[float, float], ...]:
    """Return spreads, sqrt(chi squared / freedom), and the weight of each."""
    wide = 9 / sqrt(2 * freedom)
    low, high = -(40 / freedom + wide), log1p(80 / freedom) / 2 + wide
    count = _POINTS_OF_FEW if freedom < _FEW else _POINTS
    step = (high - low) / (count - 1)
    scale = log(2) + freedom / 2 * log(freedom / 2) - lgamma(freedom / 2)
    points = [low + step * number for number in range(count)]
    return tuple(
        (step * exp(scale + freedom * u - freedom / 2 * exp(2 * u)), exp(u)) for u in points
    )
