"""The cells of a report: one for each agent and condition."""

from collections.abc import Mapping, Sequence

from ..results import scores
from ..results.episode_columns import CellEpisodes, EpisodeColumns
from ..results.reading import ResultRecord, Run
from . import usage
from .identity import agent_names, corruptions_by_label, parts_by_label
from .model import Cell
from .unplayable import counted_records

CEILING = "recovering"  # the agent that acts like a careful user


def compute_cells(run: Run, groups: scores.GroupedRecords) -> list[Cell]:
    """Return a cell for each agent and condition in the records of a run, or in some of them."""
    names = parts_by_label(run.config) if run.is_live else {}
    order = agent_names(run.config), list(corruptions_by_label(run.config))
    rows = scores.rows_by_group(groups, *order)
    top = {row["corruption"]: row["success"] for row in rows if row["agent"] == CEILING}
    inferred = _estimate_cells(rows, groups)
    cells: list[Cell] = []
    last: Sequence[ResultRecord]
    for row in rows:
        key = row["agent"], row["corruption"]
        cases = groups.last[key]
        if isinstance(cases, CellEpisodes):
            last = []
            used = usage.column_means([cases])
        else:
            last = list(cases.values())
            used = usage.means(last, groups.attempts[key])
        scored = groups.scored[key]
        cells.append(
            Cell(
                **row,
                **inferred.get(key, {}),
                **used,
                tasks=scores.count_tasks(scored),
                pass_hat=_pass_hat(run, scored),
                ceiling=top.get(row["corruption"]),
                early=scores.count_unreached(last, names),
            )
        )
    return cells


def feasible_and_not(run: Run) -> tuple[list[Cell], list[Cell]]:
    """Return the cells of feasible and of infeasible tasks; no cells if all tasks are feasible."""
    if isinstance(run.records, EpisodeColumns):
        return [], []  # results of other harnesses do not say
    partition: tuple[list[ResultRecord], list[ResultRecord]] = [], []
    for record in counted_records(run):
        partition[bool(record.get("infeasible"))].append(record)
    feasible, infeasible = partition
    if not infeasible:
        return [], []
    return compute_cells(run, scores.group_records(feasible)), compute_cells(
        run, scores.group_records(infeasible)
    )


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
        cases = None
        if groups.paired:
            cases = scores.pairs_in_cell(key, groups)
            retention = statistics.retention_interval(*cases)
        else:
            samples = scores.samples_in_cell(key, groups)
            retention = statistics.unpaired_retention_interval(*samples)
        estimates[key] = {
            "retention_low": retention.low if retention else None,
            "retention_high": retention.high if retention else None,
            "detectable": cases and statistics.detectable_difference(*cases),
        }
    return estimates


def _pass_hat(run: Run, scored: Mapping[scores.PairKey, float]) -> tuple[float, ...]:
    """Return pass^k for k = 1 up to the number of seeds that every task has.

    The rows of a dataset are steps, not repetitions of a task, so a scoring run has none.
    """
    if run.is_scored or not scored or not scores.can_infer():
        return ()
    from ..results.statistics import pass_hat

    return pass_hat(*scores.score_lists(scored))
