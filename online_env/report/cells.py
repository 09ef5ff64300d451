"""The cells of a report: one for each agent and condition."""

from collections.abc import Hashable, Mapping, Sequence

from hijack_data.plan import CLEAN

from ..results import scores
from ..results.reading import ResultRecord, Run
from . import usage
from .identity import agent_names, corruptions_by_label
from .model import Cell
from .unplayable import counted_records

CEILING = "recovering"  # the agent that acts like a careful user


def compute_cells(run: Run, groups: scores.GroupedRecords) -> list[Cell]:
    """Return a cell for each agent and condition in the records of a run, or in some of them."""
    names = corruptions_by_label(run.config) if run.is_live else {}
    order = agent_names(run.config), list(corruptions_by_label(run.config))
    rows = scores.rows_by_group(groups, *order)
    top = {row["corruption"]: row["success"] for row in rows if row["agent"] == CEILING}
    inferred = _estimate_cells(rows, groups)
    cells: list[Cell] = []
    for row in rows:
        key = row["agent"], row["corruption"]
        last = list(groups.last[key].values())
        scored = groups.scored[key]
        cells.append(
            Cell(
                **row,
                **inferred.get(key, {}),
                **usage.means(last, groups.attempts[key]),
                tasks=len(set(scores.task_names(scored))),
                pass_hat=_pass_hat(run, scored),
                ceiling=top.get(row["corruption"]),
                early=scores.count_unreached(last, names),
            )
        )
    return cells


def feasible_and_not(run: Run) -> tuple[list[Cell], list[Cell]]:
    """Return the cells of feasible and of infeasible tasks; no cells if all tasks are feasible."""
    partition: tuple[list[ResultRecord], list[ResultRecord]] = [], []
    for record in counted_records(run):
        partition[bool(record.get("infeasible"))].append(record)
    feasible, infeasible = partition
    if not infeasible:
        return [], []
    return compute_cells(run, scores.group_records(feasible)), compute_cells(
        run, scores.group_records(infeasible)
    )


def _with_clean(key: scores.CellKey, groups: scores.GroupedRecords) -> scores.PairedCases:
    return scores.pairs(groups.scored[key[0], CLEAN], groups.scored[key])


def _estimate_cells(
    rows: Sequence[scores.ScoreRow], groups: scores.GroupedRecords
) -> dict[scores.CellKey, dict[str, float | None]]:
    """Return the intervals of the retention, and the detectable differences, by cell."""
    keys = [(row["agent"], row["corruption"]) for row in rows if row["delta"] is not None]
    if not keys or not scores.can_infer():
        return {}
    from ..results import statistics

    estimates: dict[scores.CellKey, dict[str, float | None]] = {}
    for key in keys:
        cases = _with_clean(key, groups)
        retention = statistics.retention_interval(*cases)
        estimates[key] = {
            "retention_low": retention.low if retention else None,
            "retention_high": retention.high if retention else None,
            "detectable": statistics.detectable_difference(*cases),
        }
    return estimates


def _pass_hat(run: Run, scored: Mapping[scores.PairKey, float]) -> tuple[float, ...]:
    """Return pass^k for k = 1 up to the number of seeds that every task has.

    The rows of a dataset are steps, not repetitions of a task, so a scoring run has none.
    """
    if run.is_scored or not scored or not scores.can_infer():
        return ()
    from ..results.statistics import pass_hat_k

    solved: dict[Hashable, list[bool]] = {}
    for name, score in zip(scores.task_names(scored), scored.values(), strict=True):
        solved.setdefault(name, []).append(score == 1.0)
    seeds = min(map(len, solved.values()))
    values = [pass_hat_k(solved, k) for k in range(1, seeds + 1)]
    return tuple(value for value in values if value is not None)
