"""The cost of the models of a run, computed from its records."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from hijack_data.runs.amounts import is_amount, is_count

from ..errors import CostLimitError

COUNTS = ("requests", "input_tokens", "output_tokens")


class Budget:
    """The budget for the models of a run, and the amount spent so far.

    Args:
        limit: in USD.
        records: the records of the run so far.
    """

    def __init__(self, limit: float, records: Sequence[Mapping[str, Any]] = ()) -> None:
        self._limit = limit
        self._spent = 0.0
        self._unknown = ""
        for record in records:
            self.add(record)

    def add(self, record: Mapping[str, Any]) -> None:
        """Count an episode that has ended."""
        self._spent += total_cost([record])
        usage = record.get("usage")
        if not isinstance(usage, Mapping):
            return
        if usage.get("requests") and not is_amount(usage.get("usd")):
            self._unknown = str(record.get("id"))

    def check(self) -> None:
        """Check that another episode may begin.

        Raises:
            CostLimitError: the budget is spent, or the cost of an episode is unknown.
        """
        if self._unknown:
            raise CostLimitError(
                f"--max-cost {self._limit:g} cannot be kept: what episode {self._unknown} cost is"
                " not known, perhaps since its endpoint counts no tokens; let it report `usage`, or"
                " go on with --resume and without --max-cost"
            )
        if self._spent >= self._limit:
            raise CostLimitError(
                f"the run has cost {self._spent:.4f} USD, and --max-cost is {self._limit:g}: no"
                " further episode begins; go on with --resume and a higher --max-cost"
            )


def total_cost(records: Sequence[Mapping[str, Any]]) -> float:
    """Return the cost of episodes in USD; episodes with unknown cost count as 0."""
    total = 0.0
    for record in records:
        usage = record.get("usage")
        usd = usage.get("usd") if isinstance(usage, Mapping) else None
        if is_amount(usd):
            total += usd
    return total


def usage_line(records: Sequence[Mapping[str, Any]]) -> str:
    """Return the usage of all episodes in words; empty if their agents do not count it."""
    usages = list(_full_usages(records))
    if not usages:
        return ""
    totals: Counter[str] = Counter()
    for usage in usages:
        for key in COUNTS:
            totals[key] += usage[key]
    requests, tokens_read, tokens_written = [totals[key] for key in COUNTS]
    has_prices = all(is_amount(usage.get("usd")) for usage in usages)
    cost = "price not known" if not has_prices else f"{total_cost(records):.2f} USD"
    return (
        f"models: {requests} requests, {tokens_read} tokens read, {tokens_written} written, {cost}"
    )


def _full_usages(records: Sequence[Mapping[str, Any]]) -> Iterator[Mapping[str, Any]]:
    """Yield the usage of the records that have all our counts."""
    for record in records:
        usage = record.get("usage")
        if not isinstance(usage, Mapping):
            continue
        if has_counts(usage):
            yield usage


def has_counts(usage: Mapping[str, Any]) -> bool:
    """Return whether the counts of requests and tokens are present, as integers."""
    return all(is_count(usage.get(key)) for key in COUNTS)
