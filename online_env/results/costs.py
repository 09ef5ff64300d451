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
        made: the records of the run so far.
    """

    def __init__(self, limit: float, made: Sequence[Mapping[str, Any]] = ()) -> None:
        self._limit = limit
        self._spent = 0.0
        self._unknown = ""
        for record in made:
            self.add(record)

    def add(self, record: Mapping[str, Any]) -> None:
        """Count an episode that has ended."""
        self._spent += total_cost([record])
        usage = record.get("usage")
        if isinstance(usage, Mapping) and usage.get("requests") and usage.get("usd", 0.0) is None:
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


def total_cost(made: Sequence[Mapping[str, Any]]) -> float:
    """Return the cost of episodes in USD; episodes with unknown cost count as 0."""
    total = 0.0
    for record in made:
        usage = record.get("usage")
        spent = usage.get("usd") if isinstance(usage, Mapping) else None
        if is_amount(spent):
            total += spent
    return total


def usage_line(made: Sequence[Mapping[str, Any]]) -> str:
    """Return the usage of all episodes in words; empty if their agents do not count it."""
    counted = list(_counted(made))
    if not counted:
        return ""
    whole: Counter[str] = Counter()
    for usage in counted:
        for key in COUNTS:
            whole[key] += usage[key]
    requests, read, written = [whole[key] for key in COUNTS]
    known = all(is_amount(usage.get("usd")) for usage in counted)
    cost = "price not known" if not known else f"{total_cost(made):.2f} USD"
    return f"models: {requests} requests, {read} tokens read, {written} written, {cost}"


def _counted(made: Sequence[Mapping[str, Any]]) -> Iterator[Mapping[str, Any]]:
    """Yield the usage of the records that have all our counts."""
    for record in made:
        usage = record.get("usage")
        if not isinstance(usage, Mapping):
            continue
        if has_counts(usage):
            yield usage


def has_counts(usage: Mapping[str, Any]) -> bool:
    """Return whether the counts of requests and tokens are present, as integers."""
    return all(is_count(usage.get(key)) for key in COUNTS)
