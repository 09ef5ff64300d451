"""The record of an episode: the request, the events, and the verdict."""

import json
import math
import time
from dataclasses import asdict, dataclass, field
from typing import Any, Literal, SupportsFloat, TypeAlias

from hijack_data.errors import HijackError
from hijack_data.planner import Planner
from hijack_data.runs.run_log import GIVEN, VERSION, episode_slug
from hijack_data.runs.run_planners import dump_planner, planner_params

from ..choices import ErrorOrder
from ..desktops.protocol import Desktop
from ..errors import DesktopError
from ..tasks.base import Verdict
from .settings import EvalSettings
from .settle import Settle
from .stage import Setting

EpisodeRecord: TypeAlias = dict[str, Any]
Status: TypeAlias = Literal["ok", "invalid", "error"]
# "outside" is a limit outside the environment.
Ended: TypeAlias = Literal["agent", "max_steps", "outside"]
Cause: TypeAlias = Literal["agent", "machine", "outside"]

SCORE_ROUNDING = 1e-6  # by which a mean of scores may lie outside 0 to 1


@dataclass(frozen=True, kw_only=True)
class EpisodeRequest:
    """What is to be played.

    Args:
        planner: The corruption of the episode; `None` for a clean one.
        label: The corruption's name in the record.
        task: The task, in a form that the stage accepts.
        seed: Decides the task's variant and all draws of the corruption.
        attempt: The number of the attempt; `None` takes the first that is not in the log.
    """

    planner: Planner | None
    label: str
    task: Any
    seed: int
    attempt: int | None = None


@dataclass
class EpisodeCounts:
    """The counts of an episode for its record."""

    setting: Setting
    attempt: int = 0
    actions: int = 0  # all of them: observation k follows on action k
    free: int = 0  # of those, requests that cost no step
    malformed: int = 0
    points: int = 0  # points that the agent's code named
    fractions: int = 0  # of those, points that can only be fractions of the picture
    requests: int = 0
    false_alarms: int = 0
    repaired: int = 0
    said: str = ""  # the agent's last words
    usage: dict[str, Any] | None = None  # usage counted by the agent itself: tokens, money
    guard: dict[str, Any] | None = None  # what watched the agent; `None` for nothing
    # What the agent was given in addition to instruction and pictures; `None` if unknown.
    given: list[str] | None = None
    history: list[str] = field(default_factory=list[str])
    start: float = field(default_factory=time.monotonic)
    setup_seconds: float | None = None  # seconds to reset the desktop and set up the task
    order: ErrorOrder | None = None  # when its environment errors came, if it has any

    @property
    def steps(self) -> int:
        """The actions that count."""
        return self.actions - self.free


@dataclass(frozen=True, kw_only=True)
class End:
    """How an episode ended.

    Only `"ok"` has a verdict: an episode whose corruption did not hold does not count as 0.

    Args:
        status: The status of the record.
        problem: The problem, if the status is not `"ok"`.
        verdict: How the task was judged.
        ended: What ended a judged episode: `DONE` or `FAIL`, `max_steps`, or a limit outside the
            environment.
        cause: Who caused an error; errors of the agent count against it, others do not.
        traceback: Where an agent raised, the innermost call last.
    """

    status: Status
    problem: str = ""
    verdict: Verdict | None = None
    ended: Ended | None = None
    cause: Cause = "machine"
    traceback: tuple[str, ...] = ()


def make_record(
    *,
    request: EpisodeRequest,
    settings: EvalSettings,
    counts: EpisodeCounts,
    end: End,
    effects: list[EpisodeRecord],
    inputs: list[EpisodeRecord] | None,
    desktop: Desktop,
) -> EpisodeRecord:
    """Return the record as JSON data."""
    setting = counts.setting
    record: EpisodeRecord = {
        "version": VERSION,
        "id": episode_slug(setting.id, request.label, request.seed, settings.agent, counts.attempt),
        "agent": settings.agent,
        "task": setting.id,
        "task_seed": setting.seed,
        "instruction": setting.instruction,
        "apps": list(setting.apps),
        "infeasible": setting.infeasible,
        "corruption": request.label,
        "params": planner_params(request.planner),
        "planner": dump_planner(request.planner),
        "seed": request.seed,
        "sample": setting.id,
        "attempt": counts.attempt,
        "max_steps": settings.max_steps,
        "allow_code": settings.allow_code,
        "status": end.status,
        "score": None if end.verdict is None else float(end.verdict.score),
        "reason": "" if end.verdict is None else end.verdict.reason,
        "ended": end.ended,
        "steps": counts.steps,
        "seconds": since(counts.start),
        "setup_seconds": counts.setup_seconds,
        "effects": effects,
        "environment_errors": counts.order,
        "problem": end.problem,
        "cause": end.cause if end.status == "error" else None,
        "traceback": list(end.traceback),
        "recovery": {
            "policy": settings.recovery,
            "requests": counts.requests,
            "false_alarms": counts.false_alarms,
            "repaired": counts.repaired,
            "free": counts.free,
        },
        "malformed": counts.malformed,
        "points": {"named": counts.points, "fractions": counts.fractions},
        "last_action": counts.history[-1] if counts.history else None,
        "said": counts.said,
        "usage": counts.usage,
        GIVEN: counts.given,
        "desktop": _about(desktop, settings.settle),
    }
    if inputs or (request.planner is not None and request.planner.inputs):
        record["inputs"] = inputs or []
    if counts.guard is not None:
        record["guard"] = counts.guard
    return json.loads(json.dumps(record, default=repr))


def checked_score(score: object) -> float:
    """Return what an evaluator gave as a score, 0 to 1.

    Raises:
        HijackError: It is none.
    """
    number = float(score) if isinstance(score, SupportsFloat) else math.nan
    if not -SCORE_ROUNDING <= number <= 1 + SCORE_ROUNDING:
        raise HijackError(f"the task's evaluator gave {score!r:.80}, which is no score from 0 to 1")
    return min(max(number, 0.0), 1.0)


def task_label(task: object) -> str:
    """Return the name of a task that could not be set up, for its record."""
    task_id = task.get("id") if isinstance(task, dict) else getattr(task, "id", task)
    return task_id if isinstance(task_id, str) else "unknown"


def since(start: float) -> float:
    """Return the seconds since a `time.monotonic()`."""
    return round(time.monotonic() - start, 4)


def _about(desktop: Desktop, settle: Settle) -> EpisodeRecord:
    size: list[int] | None = None
    try:
        height, width = desktop.size
        size = [width, height]
    except DesktopError:
        pass
    about = {"provider": type(desktop).__name__.lstrip("_"), "size": size, "settle": asdict(settle)}
    name = getattr(desktop, "machine_name", "")
    return {**about, "machine": name} if name else about
