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
    found: dict[str, dict[str, _Collected]] = {}
    for (agent, label), scored in groups.scored.items():
        records = groups.last[agent, label]
        for case, score in scored.items():
            app = _app_of(records[case])
            own = found.setdefault(agent, {}).setdefault(app, _Collected())
            own.tasks.update(scores.task_names([case]))
            (own.clean if label == CLEAN else own.corrupted).append(score)
    apps = {app for own in found.values() for app in own}
    if len(apps) < 2:
        return []
    return [
        AppSuccess(
            agent=agent,
            app=app,
            tasks=len(own[app].tasks),
            clean=_mean(own[app].clean),
            corrupted=_mean(own[app].corrupted),
        )
        for agent, own in found.items()
        for app in sorted(own, key=lambda app: (app == SEVERAL, app))
    ]


def _app_of(record: ResultRecord) -> str:
    """Return the application of a record's task; nothing if it names none."""
    apps = record.get("apps")
    if not isinstance(apps, list) or not apps:
        return ""
    return str(apps[0]) if len(apps) == 1 else SEVERAL


def _mean(values: list[float]) -> float | None:
    return fmean(values) if values else None
