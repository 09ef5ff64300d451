"""Tasks of a run that could not be played, which the user left out or counts as 0."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any, cast

from ..results.reading import ResultRecord, Run
from .identity import agent_names, corruptions_by_label


def counted_records(run: Run) -> Sequence[ResultRecord]:
    """Return the records of a run, with one for each unplayed episode that has a score."""
    unplayed = list(_unplayed(run))
    return [*run.records, *unplayed] if unplayed else run.records


def unplayable_note(run: Run) -> Iterator[str]:
    """Yield how tasks that could not be played count, if there are any."""
    tasks = _tasks(run)
    if not tasks:
        return
    total = len(tasks) + len(run.config.get("tasks") or ())
    counted_as = "are left out of all denominators"
    if run.config.get("unplayable_score") is not None:
        counted_as = "count 0 in every condition"
    yield (
        f"{len(tasks)} of {total} tasks could not be played and {counted_as}; run.json has the"
        " reason of each."
    )


def _tasks(run: Run) -> Mapping[str, Any]:
    tasks = run.config.get("unplayable")
    return cast("Mapping[str, Any]", tasks) if isinstance(tasks, dict) else {}


def _unplayed(run: Run) -> Iterator[ResultRecord]:
    score = run.config.get("unplayable_score")
    if score is None:
        return
    agents, labels = agent_names(run.config), corruptions_by_label(run.config)
    seeds = [seed for seed in run.config.get("seeds") or () if seed not in run.left_out]
    for (task, about), agent, label, seed in product(_tasks(run).items(), agents, labels, seeds):
        yield {
            "agent": agent,
            "task": task,
            "task_seed": seed,
            "corruption": label,
            "seed": seed,
            "status": "ok",
            "score": score,
            "apps": about.get("apps", []),
            "infeasible": about.get("infeasible", False),
            "unplayable": True,
        }
