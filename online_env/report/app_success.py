"""Success by application: in which programs an agent fails."""

from dataclasses import dataclass, field
from statistics import fmean

from hijack_data.plan import CLEAN

from ..results import scores
from ..results.reading import ResultRecord
from .model import AppSuccess

SEVERAL = "several"  # tasks that need more than one application


@dataclass
class _Collected:
    tasks: set[str] = field(default_factory=set[str])
    clean: list[float] = field(default_factory=list[float])
    corrupted: list[float] = field(default_factory=list[float])


def app_successes(groups: scores.GroupedRecords) -> list[AppSuccess]:
    """Return the success of each agent in each application.

    Args:
        groups: the records of a run.

    Returns:
        A row for each agent and application: agents in their order, applications in that of the
        alphabet, tasks with several of them last. None if all tasks have the same application, or
        name none, as in a scoring run.
    """
    if not any("apps" in record for records in groups.attempts.values() for record in records):
        return []
    by_agent: dict[str, dict[str, _Collected]] = {}
    for (agent, label), scored in groups.scored.items():
        records = groups.last[agent, label]
        for case, score in scored.items():
            app = record_app(records[case])
            collected = by_agent.setdefault(agent, {}).setdefault(app, _Collected())
            collected.tasks.add(scores.task_name(case[0], case[1]))
            (collected.clean if label == CLEAN else collected.corrupted).append(score)
    apps = {app for collected in by_agent.values() for app in collected}
    if len(apps) < 2:
        return []
    return [
        AppSuccess(
            agent=agent,
            app=app,
            tasks=len(collected[app].tasks),
            clean=_mean(collected[app].clean),
            corrupted=_mean(collected[app].corrupted),
        )
        for agent, collected in by_agent.items()
        for app in sorted(collected, key=lambda app: (app == SEVERAL, app))
    ]


def record_app(record: ResultRecord) -> str:
    """Return the application of a record's task; nothing if it names none."""
    apps = record.get("apps")
    if not isinstance(apps, list) or not apps:
        return ""
    return str(apps[0]) if len(apps) == 1 else SEVERAL


def _mean(values: list[float]) -> float | None:
    return fmean(values) if values else None
