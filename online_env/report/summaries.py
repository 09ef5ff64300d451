"""The summaries of a report: one for each agent, over all its conditions."""

from collections.abc import Iterable, Mapping, Sequence
from statistics import fmean
from typing import Any

from hijack_data.plan import CLEAN
from hijack_data.runs.privileged_inputs import collect_privileged_inputs
from hijack_data.runs.run_log import GIVEN_KINDS

from ..results import scores
from ..results.episode_columns import CellEpisodes
from ..results.reading import ResultRecord
from . import usage
from .identity import NINE, has_all_nine
from .model import AgentSummary, Cell, RunIdentity


def summarise_agents(
    identity: RunIdentity, cells: Sequence[Cell], groups: scores.GroupedRecords, reference: str
) -> list[AgentSummary]:
    """Return a summary for each agent of a report.

    Args:
        identity: of the run.
        cells: all cells of the report.
        groups: the records that the cells were computed from.
        reference: the reference agent of mCE; empty for no mCE.
    """
    by_agent: dict[str, dict[str, Cell]] = {}
    for cell in cells:
        by_agent.setdefault(cell.agent, {})[cell.corruption] = cell
    names = identity.corruptions
    errors = {agent: _errors(agent_cells) for agent, agent_cells in by_agent.items()}
    return [
        AgentSummary(
            agent=agent,
            n=sum(cell.n for cell in agent_cells.values()),
            errors=sum(cell.errors for cell in agent_cells.values()),
            invalid=sum(cell.invalid for cell in agent_cells.values()),
            **_means(agent_cells, identity),
            **_retention(agent, groups),
            **_interval([groups.scored[agent, label] for label in agent_cells if label != CLEAN]),
            **_inputs_and_usage(agent, agent_cells, groups),
            mce=_mce(errors[agent], errors.get(reference, {}), names),
        )
        for agent, agent_cells in by_agent.items()
    ]


def _inputs_and_usage(
    agent: str, labels: Iterable[str], groups: scores.GroupedRecords
) -> dict[str, Any]:
    """Return what an agent was given, and its usage, over its conditions."""
    keys = [(agent, label) for label in labels]
    columns = [cell for key in keys if isinstance(cell := groups.last[key], CellEpisodes)]
    if columns:
        return {"given": None, **usage.column_means(columns)}
    attempts = [record for key in keys for record in groups.attempts[key]]
    last = [record for key in keys for record in groups.last[key].values()]
    return {"given": _privileged_inputs(attempts), **usage.means(last, attempts)}


def _privileged_inputs(attempts: Sequence[ResultRecord]) -> tuple[str, ...] | None:
    input_sets = collect_privileged_inputs(attempts)
    kinds = {kind for inputs in input_sets for kind in inputs}
    return tuple(kind for kind in GIVEN_KINDS if kind in kinds) if input_sets else None


def _means(agent_cells: Mapping[str, Cell], identity: RunIdentity) -> dict[str, Any]:
    """Return the means over the conditions of an agent."""
    success = {
        label: cell.success for label, cell in agent_cells.items() if cell.success is not None
    }
    corrupted = [label for label in success if label != CLEAN]
    means: dict[str, Any] = {
        **scores.means(success),
        "conditions": len(corrupted),
        "ceiling": _mean([agent_cells[label].ceiling for label in corrupted]),
    }
    if has_all_nine(identity, set(success)):
        means["nine"] = fmean(success[name] for name in NINE)
        if CLEAN in success:
            means["paper_average"] = fmean(success[name] for name in (CLEAN, *NINE))
    return means


def _retention(agent: str, groups: scores.GroupedRecords) -> dict[str, float | None]:
    """Return the share of its clean success that an agent keeps over all its corruptions."""
    corruptions = [label for name, label in groups.scored if name == agent and label != CLEAN]
    interval: Any = None
    if groups.paired:
        cases = scores.pooled_pairs(agent, corruptions, groups)
        clean_scores, corrupted_scores, _ = cases
        if scores.can_infer() and len(clean_scores):
            from ..results.statistics import retention_interval

            interval = retention_interval(*cases)
    else:
        samples = scores.pooled_samples(agent, corruptions, groups)
        (clean_scores, _), (corrupted_scores, _) = samples
        if scores.can_infer() and len(clean_scores) and len(corrupted_scores):
            from ..results.statistics import unpaired_retention_interval

            interval = unpaired_retention_interval(*samples)
    if not sum(clean_scores) or not len(corrupted_scores):
        return {}
    counts_apart = len(clean_scores) / len(corrupted_scores)  # 1 for pairs
    ratio = sum(corrupted_scores) / sum(clean_scores) * counts_apart
    values: dict[str, float | None] = {"retention": ratio}
    if scores.can_infer():
        values["retention_low"] = interval.low if interval else None
        values["retention_high"] = interval.high if interval else None
    return values


def _interval(cells: Sequence[scores.ScoreByCase]) -> dict[str, float]:
    """Return the interval of the mean over the corruptions."""
    scored_cells = [cell for cell in cells if cell]
    if not scored_cells or not scores.can_infer():
        return {}
    from ..results.statistics import grand_mean_interval

    interval = grand_mean_interval([scores.score_lists(cell) for cell in scored_cells])
    return {"corrupted_low": interval.low, "corrupted_high": interval.high}


def _mce(
    agent_errors: Mapping[str, float],
    reference_errors: Mapping[str, float],
    names: Mapping[str, str],
) -> float | None:
    """Return the mean corruption error over the corruptions that both agents have.

    The errors of a corruption's severities are added first.

    Args:
        agent_errors: the errors of an agent, by label.
        reference_errors: those of the reference agent.
        names: the corruption of each label.
    """
    shared = [label for label in agent_errors if label in reference_errors]
    if not shared or not scores.can_infer():
        return None
    from ..results.statistics import mean_corruption_error

    sums: tuple[dict[str, float], dict[str, float]] = {}, {}
    for label in shared:
        name = names.get(label, label)
        for total, errors in zip(sums, (agent_errors, reference_errors), strict=True):
            total[name] = total.get(name, 0.0) + errors[label]
    return mean_corruption_error(*sums)


def _errors(cells: Mapping[str, Cell]) -> dict[str, float]:
    """Return the error of an agent, 1 - success, under each corruption that has a success."""
    return {
        label: 1 - cell.success
        for label, cell in cells.items()
        if label != CLEAN and cell.success is not None
    }


def _mean(values: Sequence[float | None]) -> float | None:
    """Return the mean, or `None` if a value is missing."""
    present = [value for value in values if value is not None]
    return fmean(present) if present and len(present) == len(values) else None
