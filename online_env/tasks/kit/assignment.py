"""Match created items to requested items."""

from collections.abc import Iterator, Sequence
from itertools import permutations


def best_assignment_problems(problem_table: Sequence[Sequence[Sequence[str]]]) -> Iterator[str]:
    """Yield the problems of the assignment of created to requested items that has the fewest.

    All assignments are tried: a task asks for a few items only.

    Args:
        problem_table: `problem_table[n][m]` holds what is wrong with the n-th created item if it is
            the m-th requested one; as many items are created as requested.
    """
    orders = permutations(range(len(problem_table)))
    best = min(orders, key=lambda order: sum(len(problem_table[n][m]) for n, m in enumerate(order)))
    for created, requested in enumerate(best):
        yield from problem_table[created][requested]
