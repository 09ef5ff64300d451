"""The scores of a report by name, for release gates."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from types import MappingProxyType

from .model import AgentSummary, Cell, RunReport

# Agents whose scores describe tasks and desktops rather than the agent.
YARDSTICKS = ("oracle", "recovering", "do_nothing", "random", "fail")
# Gates and model cards are about none of these: they come with the library.
REFERENCE_AGENTS = (
    *YARDSTICKS,
    "pixel",
    "pixel_onlooker",
    "pixel_onlooker_no_check",
    "pixel_onlooker_no_summary",
)
# Of an agent; for those in LOWER_IS_BETTER, less is better.
SUMMARY = (
    "clean",
    "corrupted",
    "retention",
    "worst",
    "nine",
    "paper_average",
    "mce",
    "malformed",
    "steps",
    "usd",
    "errors",
    "invalid",
)
LOWER_IS_BETTER = frozenset({"mce", "malformed", "steps", "usd", "errors", "invalid"})
CELL = ("success", "retention", "delta", "malformed")


def scores_by_name(report: RunReport) -> Mapping[str, float]:
    """Return the scores of a report by name.

    `clean`, `corrupted` (the mean over the corruptions), `retention`, `worst`, `nine`,
    `paper_average`, `mce`, `malformed`, `steps`, `usd`, `errors` and `invalid` are those of an
    agent over all its conditions; `success.marks`, `retention.marks`, `delta.marks` and
    `malformed.marks` those under one (by its label). Shares are 0..1. Values that do not exist are
    left out.

    If a run has several agents, a name means the least of their values, or the greatest of those
    where less is better, so that a limit holds for every agent; it is left out if one of them has
    no such value. `REFERENCE_AGENTS` do not count, unless a run has no others. `AGENT/retention`
    is that of one agent, whichever it is.
    """
    agent_scores = {row.agent: dict(_agent_scores(report, row)) for row in report.summaries}
    judged = [agent for agent in agent_scores if agent not in REFERENCE_AGENTS] or list(
        agent_scores
    )
    values_by_name: dict[str, list[float]] = {}
    for agent in judged:
        for name, value in agent_scores[agent].items():
            values_by_name.setdefault(name, []).append(value)
    worst_scores = {
        name: _worse(name)(values)
        for name, values in values_by_name.items()
        if len(values) == len(judged)
    }
    for agent, values in agent_scores.items():
        worst_scores.update({f"{agent}/{name}": value for name, value in values.items()})
    return MappingProxyType(worst_scores)


def _worse(name: str) -> Callable[[Iterable[float]], float]:
    return max if name.partition(".")[0] in LOWER_IS_BETTER else min


def _agent_scores(report: RunReport, row: AgentSummary) -> Iterator[tuple[str, float]]:
    for name in SUMMARY:
        value = row.worst_success if name == "worst" else getattr(row, name)
        if value is not None:
            yield name, float(value)
    for cell in report.cells:
        if cell.agent == row.agent:
            yield from _cell_scores(cell)


def _cell_scores(cell: Cell) -> Iterator[tuple[str, float]]:
    for name in CELL:
        value = getattr(cell, name)
        if value is not None:
            yield f"{name}.{cell.corruption}", float(value)
