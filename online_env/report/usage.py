"""An agent's usage: actions, seconds, tokens and money, from the records of its episodes."""

from collections.abc import Iterable, Sequence
from statistics import fmean
from typing import Any

import numpy as np

from hijack_data.runs.amounts import is_amount

from ..results.costs import COUNTS, has_counts, lacks_counts
from ..results.episode_columns import CellEpisodes, Floats
from ..results.reading import ResultRecord
from ..results.scores import counts


def means(last: Iterable[ResultRecord], attempts: Iterable[ResultRecord]) -> dict[str, Any]:
    """Return the usage fields of a cell, by name.

    Steps, seconds and malformed actions cover the episodes that count for the agent. Tokens and
    money cover all attempts, since all were paid for; they are known only if every attempt in which
    the agent acted has them: a part would pass for the whole.

    Args:
        last: The last attempt at each case.
        attempts: All attempts.
    """
    finished = [record for record in last if counts(record)]
    steps = [record["steps"] for record in finished if is_amount(record.get("steps"))]
    seconds = [record["seconds"] for record in finished if is_amount(record.get("seconds"))]
    parsed = [
        (record["malformed"], record["steps"])
        for record in finished
        if is_amount(record.get("malformed")) and is_amount(record.get("steps"))
    ]
    broken, actions = map(sum, zip(*parsed, strict=True)) if parsed else (0, 0)
    values: dict[str, Any] = {
        "steps": fmean(steps) if steps else None,
        "seconds": fmean(seconds) if seconds else None,
        "malformed": broken / actions if actions else None,
    }
    return values | _tokens(attempts)


def column_means(cells: Sequence[CellEpisodes]) -> dict[str, Any]:
    """Return the usage fields of results of other harnesses, by name.

    Steps cover the episodes that have a score and say how many they took. Money covers all
    episodes, and is known only if each in which the agent acted says what it cost, as in `means`.
    """
    values: dict[str, Any] = {}
    steps = np.concatenate([cell.amounts("steps").scores for cell in cells])
    if steps.size:
        values["steps"] = float(steps.mean())
    costs = np.concatenate([_cell_amounts(cell, "cost") for cell in cells])
    scored = np.concatenate([cell.columns.score[cell.positions] for cell in cells])
    actions = np.concatenate([_cell_amounts(cell, "steps") for cell in cells])
    has_cost = ~np.isnan(costs)
    has_acted = ~np.isnan(scored) | (actions > 0)
    if has_cost.any() and has_cost[has_acted].all():
        values["usd"] = float(costs[has_cost].sum())
    return values


def _cell_amounts(cell: CellEpisodes, name: str) -> Floats:
    """Return what each episode of a cell took, NaN where the source does not say."""
    amounts = cell.columns.amounts.get(name)
    return np.full(len(cell), np.nan) if amounts is None else amounts[cell.positions]


def _tokens(records: Iterable[ResultRecord]) -> dict[str, Any]:
    attempts = list(records)
    usages = [record["usage"] for record in attempts if has_counts(record.get("usage"))]
    if not usages or any(map(lacks_counts, attempts)):
        return {}
    values: dict[str, Any] = {key: sum(usage[key] for usage in usages) for key in COUNTS}
    prices = [usage.get("usd") for usage in usages]
    if all(is_amount(price) for price in prices):
        values["usd"] = float(sum(filter(is_amount, prices)))
    return values
