"""Numbers that others state: what an agent says it has used, and what an endpoint has counted."""

from typing import TypeGuard

MAX_AMOUNT = 2**53  # beyond, floats are no longer exact, and nothing that was counted is so large


def is_amount(value: object) -> TypeGuard[float]:
    """Return whether a value is a number that can be summed: from 0 on, not NaN, not absurd."""
    return (
        isinstance(value, int | float) and not isinstance(value, bool) and 0 <= value <= MAX_AMOUNT
    )


def is_count(value: object) -> TypeGuard[int]:
    """Return whether a value is an amount that is a whole number."""
    return isinstance(value, int) and is_amount(value)
