"""What becomes of the tests of a report if each task is one case, with all its seeds."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from ..bench import scores
from . import words


class Compared(NamedTuple):
    """The p value of a comparison as reported, and its cases; see `scores.pairs`."""

    p: float
    cases: scores.PairedCases


def by_task_note(agents: Mapping[str, Mapping[str, Compared]], is_scored: bool) -> Iterator[str]:
    """Yield which differences of a report are not significant if a task's cases belong together.

    Nothing is yielded if every task has one case.

    Args:
        agents: all comparisons of each agent, by condition.
        is_scored: whether the cases are steps of recordings instead of seeds of tasks.
    """
    listed = [row.cases[-1] for rows in agents.values() for row in rows.values()]
    if all(len(tasks) == len(set(tasks)) for tasks in listed):
        return
    lost = [name for agent, rows in agents.items() for name in _lost(agent, rows)]
    cases, group = ("steps", "recording") if is_scored else ("seeds", "task")
    said = f"p takes the {cases} of a {group} for independent cases. With each {group} as one case"
    if lost:
        yield f"{said}, these differences are not significant: {', '.join(lost)}."
        return
    yield f"{said}, the same differences are significant."


def p_by_task(rows: Mapping[str, Compared]) -> dict[str, float]:
    """Return the p value of each condition of an agent with each task as one case (Holm).

    Args:
        rows: all comparisons of the agent, by condition.
    """
    from ..bench import statistics

    tests = {label: statistics.mcnemar_by_task(*row.cases) for label, row in rows.items()}
    return statistics.holm(tests)


def _lost(agent: str, rows: Mapping[str, Compared]) -> Iterator[str]:
    """Yield the conditions in which an agent's difference is significant as reported alone."""
    for label, by_task in p_by_task(rows).items():
        p = rows[label].p
        if p < words.SHOWN <= by_task:
            values = f"p {words.p_value(by_task)} instead of {words.p_value(p)}"
            yield f"{agent} under {label} ({values})"
