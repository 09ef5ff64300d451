"""What the models of a run have cost, from its records."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..errors import CostLimitError
from . import records

COUNTS = ("requests", "input_tokens", "output_tokens")


def check_cost(folder: Path, limit: float | None) -> None:
    """Check that a run may go on.

    Raises:
        CostLimitError: its episodes have cost what they may.
    """
    if limit is None:
        return
    spent = cost_of(records.read(folder).records)
    if spent >= limit:
        raise CostLimitError(
            f"the run has cost {spent:.4f} USD, and --max-cost is {limit:g}: no further episode"
            " begins; go on with --resume and a higher --max-cost"
        )


def cost_of(made: Sequence[Mapping[str, Any]]) -> float:
    """Return what episodes have cost, in USD; those that do not know cost nothing."""
    total = 0.0
    for record in made:
        usage = record.get("usage")
        spent = usage.get("usd") if isinstance(usage, Mapping) else None
        if isinstance(spent, int | float):
            total += spent
    return total


def usage_line(made: Sequence[Mapping[str, Any]]) -> str:
    """Return what all episodes have used, in words; empty if their agents do not count it."""
    counted = list(_counted(made))
    if not counted:
        return ""
    whole: Counter[str] = Counter()
    for usage in counted:
        for key in COUNTS:
            whole[key] += usage[key]
    requests, read, written = [whole[key] for key in COUNTS]
    prices = [usage.get("usd") for usage in counted]
    cost = "price not known" if None in prices else f"{cost_of(made):.2f} USD"
    return f"models: {requests} requests, {read} tokens read, {written} written, {cost}"


def _counted(made: Sequence[Mapping[str, Any]]) -> Iterator[Mapping[str, Any]]:
    """Yield the counts of records that have all of ours."""
    for record in made:
        usage = record.get("usage")
        if not isinstance(usage, Mapping):
            continue
        counts = [usage.get(key) for key in COUNTS]
        if all(isinstance(count, int) for count in counts):
            yield usage
