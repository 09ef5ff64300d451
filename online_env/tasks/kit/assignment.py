"""Which of the things that were made is which of those that were asked for."""

from collections.abc import Iterator, Sequence
from itertools import permutations


def fewest_problems(said: Sequence[Sequence[Sequence[str]]]) -> Iterator[str]:
    """Yield what is wrong if each thing is taken for the one that it was most likely meant to be.

    One thing may be as good as another where little is asked, so all pairings are tried.

    Args:
        said: `said[n][m]`, what is wrong with the n-th thing that was made if it is the m-th that
            was asked for; as many are asked for as were made.
    """
    orders = permutations(range(len(said)))
    best = min(orders, key=lambda order: sum(len(said[n][m]) for n, m in enumerate(order)))
    for place, asked in enumerate(best):
        yield from said[place][asked]
