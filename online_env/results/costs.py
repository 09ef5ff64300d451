"""The cost of the models of a run, computed from its records."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

from hijack_data.errors import quantity
from hijack_data.runs.amounts import is_amount, is_count

from ..errors import CostLimitError
from .record_score import counts

COUNTS = ("requests", "input_tokens", "output_tokens")
USAGE_PROBLEM = "problem"  # the key of a usage that says why nobody knows what an episode used


class Budget:
    """The budget for the models of a run, and the amount spent so far.

    Args:
        limit: in USD.
        records: the records of the run so far.
        models: the models that each agent asks and where, in words; agents without are free unless
            they count requests.
    """

    def __init__(
        self,
        limit: float,
        records: Sequence[Mapping[str, Any]] = (),
        models: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self._limit = limit
        self._models = models
        self._spent = 0.0
        self._unknown = ""
        for record in records:
            self.add(record)

    def add(self, record: Mapping[str, Any]) -> None:
        """Count an episode that has ended."""
        self._spent += total_cost([record])
        models = self._models.get(str(record.get("agent")), "")
        usage = record.get("usage")
        usage_fields: Mapping[str, Any] = usage if isinstance(usage, Mapping) else {}
        has_asked = usage_fields.get("requests") or (
            models and (USAGE_PROBLEM in usage_fields or lacks_counts(record))
        )
        if has_asked and not is_amount(usage_fields.get("usd")):
            self._unknown = f"{record.get('id')} cost{f' ({models})' if models else ''}"

    def check(self) -> None:
        """Check that another episode may begin.

        Raises:
            CostLimitError: the budget is spent, or the cost of an episode is unknown.
        """
        if self._unknown:
            raise CostLimitError(
                f"--max-cost {self._limit:g} cannot be kept: what episode {self._unknown} is not"
                " known, perhaps since its endpoint counts no tokens or it was killed; let the"
                " endpoint report `usage`, or go on with --resume and without --max-cost"
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
    counting = {record["agent"] for record in records if has_counts(record.get("usage"))}
    played = [record for record in records if record["agent"] in counting]
    usages = [record["usage"] for record in played if has_counts(record.get("usage"))]
    if not usages:
        return ""
    requests, tokens_read, tokens_written = (sum(usage[key] for usage in usages) for key in COUNTS)
    has_prices = all(is_amount(usage.get("usd")) for usage in usages)
    cost = "price not known" if not has_prices else f"{total_cost(records):.2f} USD"
    silent = sum(map(lacks_counts, played))
    gap = f", without {quantity(silent, 'episode')} of unknown usage" if silent else ""
    return (
        f"models: {requests} requests, {tokens_read} tokens read, {tokens_written} written, {cost}"
        f"{gap}"
    )


def lacks_counts(record: Mapping[str, Any]) -> bool:
    """Return whether an agent acted in an episode, and its record does not say what that took."""
    has_acted = counts(dict(record)) or bool(record.get("steps"))
    return has_acted and not has_counts(record.get("usage"))


def has_counts(usage: Any) -> bool:
    """Return whether a usage has the counts of requests and tokens, as integers."""
    return isinstance(usage, Mapping) and all(is_count(usage.get(key)) for key in COUNTS)
