"""The summaries of a report: one for each agent, over all its conditions."""

from collections.abc import Iterable, Mapping, Sequence
from statistics import fmean
from typing import Any

from hijack_data.plan import CLEAN
from hijack_data.runs.privileged_inputs import collect_privileged_inputs
from hijack_data.runs.run_log import GIVEN_KINDS

from ..results import scores
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
    errors = {agent: _errors(own) for agent, own in by_agent.items()}
    return [
        AgentSummary(
            agent=agent,
            n=sum(cell.n for cell in own.values()),
            errors=sum(cell.errors for cell in own.values()),
            invalid=sum(cell.invalid for cell in own.values()),
            **_means(own, identity),
            **_retained(agent, groups),
            **_interval([groups.scored[agent, label] for label in own if label != CLEAN]),
            **_used(agent, own, groups),
            mce=_mce(errors[agent], errors.get(reference, {})),
        )
        for agent, own in by_agent.items()
    ]


def _used(agent: str, labels: Iterable[str], groups: scores.GroupedRecords) -> dict[str, Any]:
    """Return what an agent was given, and its usage, over its conditions."""
    keys = [(agent, label) for label in labels]
    attempts = [record for key in keys for record in groups.attempts[key]]
    last = [record for key in keys for record in groups.last[key].values()]
    return {"given": _given(attempts), **usage.means(last, attempts)}


def _given(attempts: Sequence[ResultRecord]) -> tuple[str, ...] | None:
    found = collect_privileged_inputs(attempts)
    there = {kind for given in found for kind in given}
    return tuple(kind for kind in GIVEN_KINDS if kind in there) if found else None


def _means(own: Mapping[str, Cell], identity: RunIdentity) -> dict[str, Any]:
    """Return the means over the conditions of an agent."""
    success = {label: cell.success for label, cell in own.items() if cell.success is not None}
    corrupted = [label for label in success if label != CLEAN]
    means: dict[str, Any] = {
        **scores.means(success),
        "conditions": len(corrupted),
        "ceiling": _mean([own[label].ceiling for label in corrupted]),
    }
    if has_all_nine(identity, set(success)):
        means["nine"] = fmean(success[name] for name in NINE)
        if CLEAN in success:
            means["paper_average"] = fmean(success[name] for name in (CLEAN, *NINE))
    return means


def _retained(agent: str, groups: scores.GroupedRecords) -> dict[str, float | None]:
    """Return the share of its clean success that an agent keeps over all its corruptions."""
    there, here, tasks = scores.pairs_with_clean(agent, groups.scored)
    if not sum(there):
        return {}
    found: dict[str, float | None] = {"retention": sum(here) / sum(there)}
    if scores.can_infer():
        from ..results.statistics import retention_interval

        kept = retention_interval(there, here, tasks)
        found["retention_low"] = kept.low if kept else None
        found["retention_high"] = kept.high if kept else None
    return found


def _interval(cells: Sequence[scores.ScoreByCase]) -> dict[str, float]:
    """Return the interval of the mean over the corruptions."""
    there = [cell for cell in cells if cell]
    if not there or not scores.can_infer():
        return {}
    from ..results.statistics import grand_mean_interval

    pairs = [(list(cell.values()), scores.task_names(cell)) for cell in there]
    interval = grand_mean_interval(pairs)
    return {"corrupted_low": interval.low, "corrupted_high": interval.high}


def _mce(here: Mapping[str, float], there: Mapping[str, float]) -> float | None:
    """Return the mean corruption error over the corruptions that both agents have.

    Args:
        here: the errors of an agent, by corruption.
        there: those of the reference agent.
    """
    shared = [label for label in here if label in there]
    if not shared or not scores.can_infer():
        return None
    from ..results.statistics import mean_corruption_error

    return mean_corruption_error(
        {label: here[label] for label in shared}, {label: there[label] for label in shared}
    )


def _errors(cells: Mapping[str, Cell]) -> dict[str, float]:
    """Return the error of an agent, 1 - success, under each corruption that has a success."""
    return {
        label: 1 - cell.success
        for label, cell in cells.items()
        if label != CLEAN and cell.success is not None
    }


def _mean(values: Sequence[float | None]) -> float | None:
    """Return the mean, or `None` if a value is missing."""
    there = [value for value in values if value is not None]
    return fmean(there) if there and len(there) == len(values) else None
