"""What becomes of the tests of a report if each task is one case, with all its seeds."""

from collections.abc import Iterator, Mapping

from ..bench import scores
from . import words


def by_task_note(
    agents: Mapping[str, Mapping[str, scores.PairedCases]], is_scored: bool
) -> Iterator[str]:
    """Yield which differences of a report are not significant if a task's cases belong together.

    Nothing is yielded if every task has one case.

    Args:
        agents: the compared cases of each agent, by condition; see `scores.pairs`.
        is_scored: whether the cases are steps of recordings instead of seeds of tasks.
    """
    several = any(
        len(tasks) > len(set(tasks)) for cells in agents.values() for *_, tasks in cells.values()
    )
    if not several or not scores.can_infer():
        return
    lost = [name for agent, cells in agents.items() for name in _lost(agent, cells)]
    cases, group = ("steps", "recording") if is_scored else ("seeds", "task")
    said = f"p takes the {cases} of a {group} for independent cases. With each {group} as one case"
    if lost:
        yield f"{said}, these differences are not significant: {', '.join(lost)}."
        return
    yield f"{said}, the same differences are significant."


def _lost(agent: str, cells: Mapping[str, scores.PairedCases]) -> Iterator[str]:
    """Yield the conditions in which an agent's difference is significant as reported alone."""
    from ..bench import statistics

    there = {label: pairs for label, pairs in cells.items() if pairs[-1]}
    reported = statistics.holm(
        {label: statistics.mcnemar(before, after) for label, (before, after, _) in there.items()}
    )
    by_task = statistics.holm(
        {label: statistics.mcnemar_by_task(*pairs) for label, pairs in there.items()}
    )
    for label, p in reported.items():
        if p < words.SHOWN <= by_task[label]:
            values = f"p {words.p_value(by_task[label])} instead of {words.p_value(p)}"
            yield f"{agent} under {label} ({values})"
