"""One job on a live desktop: an agent plays an episode of `CorruptedEnv`."""

import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Protocol, cast

from hijack_data.planner import Planner
from hijack_data.runs.run_log import GIVEN, VERSION, slug_of

from .. import tasks
from ..agents.apart import AgentError, Apart
from ..agents.base import Agent, Privileged
from ..agents.registry import make
from ..environment import CorruptedEnv, EvalSettings
from ..environment.stage import TaskStage
from ..errors import DesktopError, MissingCapabilityError
from .config import Bench
from .jobs import Job
from .models import begin
from .records import ResultRecord

KEPT = 2000  # characters of a problem
_LONGEST_USAGE = 2**20  # characters of JSON, because lines of the journal are limited
# The fields of a record that identify an episode, and by which episodes are paired.
IDENTITY = (
    "id",
    "agent",
    "task",
    "task_seed",
    "instruction",
    "apps",
    "corruption",
    "seed",
    "sample",
    "attempt",
)


class EpisodeEnv(Protocol):
    """The part of `CorruptedEnv` that an episode needs."""

    @property
    def record(self) -> ResultRecord | None:
        """The record of the episode; `None` until it is over."""
        ...

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], Any]:
        """Begin an episode."""
        ...

    def step(self, action: str) -> tuple[dict[str, Any], float, bool, bool, Any]:
        """Take one action."""
        ...

    def hear(self, said: str) -> None:
        """Log the agent's words for its next action."""
        ...

    def account(self, usage: dict[str, Any]) -> None:
        """Store the usage that the agent has reported so far."""
        ...

    def give(self, what: Sequence[str]) -> None:
        """Store what the agent is given in addition to instruction and pictures."""
        ...

    def abandon(self, why: str, traceback: Sequence[str] = ()) -> None:
        """End the episode with the status `error`, as the agent's failure."""
        ...


class LiveEpisodes:
    """Runs jobs on one embedded desktop.

    Args:
        bench: The benchmark.
        folder: The folder of the run, where the frames go.
        stage: The desktop and its tasks.
    """

    def __init__(self, bench: Bench, folder: Path, stage: TaskStage) -> None:
        self._bench = bench
        self._folder = folder
        self._stage = stage

    def __call__(self, job: Job, attempt: int) -> ResultRecord:
        """Run a job.

        Raises `MissingCapabilityError` if the desktop cannot have the corruption at all.
        """
        bench = self._bench
        begin(job.agent, slug_of(*job.key[1:3], job.seed, job.agent, attempt))
        settings = EvalSettings(
            max_steps=bench.max_steps, recovery=bench.recovery, log=self._folder, agent=job.agent
        )
        env = CorruptedEnv(self._stage, settings=settings)
        planner = bench.planners[job.corruption]
        start = time.monotonic()
        try:
            apart = Apart(partial(make, job.agent), bench.agent_timeout)
        except AgentError as error:
            problem = f"the agent cannot be made: {error}"
            made = lost(job, attempt, problem, start=start)
            return {**made, "cause": "agent", "traceback": list(error.where)}
        with apart as agent:
            try:
                limit = bench.episode_timeout
                told = self._plan
                return _played(env, agent, job, attempt, planner, self._show, limit, told)
            finally:
                _called(agent.reset)

    def _show(self, agent: Agent, job: Job) -> None:
        """Pass the task and the desktop to a privileged agent."""
        cast("Privileged", agent).prepare(self._stage.task, self._stage.machine)

    def _plan(self) -> Sequence[str]:
        """Return the plan in words of the current task."""
        return tuple(self._stage.task.plan())


def play(
    env: EpisodeEnv,
    agent: Agent,
    job: Job,
    attempt: int,
    planner: Planner | None,
    show: Callable[[Agent, Job], object] | None = None,
) -> ResultRecord:
    """Run one episode and return its record.

    The agent sees instruction and screenshot, nothing else, and runs in a thread of its own. If the
    agent raises, or the desktop fails after the agent's first action, the status of the record is
    `error`, and `cause` names who failed; if the desktop fails earlier, the status is `invalid`.
    Errors by which `CorruptedEnv.reset` refuses the episode are passed on.

    Args:
        env: The environment.
        agent: The agent.
        job: What to run.
        attempt: The number of the attempt, from 0.
        planner: The corruption; `None` for a clean episode.
        show: Called once the task is set up, with a privileged agent and the job, to give the agent
            its task and desktop.
    """
    with Apart(lambda: agent) as apart:
        return _played(env, apart, job, attempt, planner, show)


def _played(
    env: EpisodeEnv,
    agent: Apart,
    job: Job,
    attempt: int,
    planner: Planner | None,
    show: Callable[[Agent, Job], object] | None,
    limit: float = math.inf,
    told: Callable[[], Sequence[str]] | None = None,
) -> ResultRecord:
    start = time.monotonic()
    options = {"task": job.task, "corruption": planner, "label": job.corruption, "attempt": attempt}
    failed = _called(agent.reset)
    try:
        obs, _ = env.reset(seed=job.seed, options=options)
    except DesktopError as error:
        if env.record is None and isinstance(error, MissingCapabilityError):
            # The episode is refused at the start: the desktop lacks a capability that the
            # configuration needs.
            raise
        problem = f"{type(error).__name__}: {error}"
        return _never_begun(env.record, _not_begun(job, attempt, problem, start))
    given: list[str] = []
    if show is not None and failed is None:
        failed = _called(_prepare, agent, show, job, given)
    if told is not None and failed is None:
        failed = _called(_tell, agent, told, given)
    env.give(given)
    if failed is not None:
        _blame(env, failed)
    while (record := env.record) is None:
        obs = _turn(env, agent, obs)
        if env.record is None and time.monotonic() - start > limit:
            env.abandon(f"the episode took longer than {limit:g} s")
    return record


def _prepare(
    agent: Apart, show: Callable[[Agent, Job], object], job: Job, given: list[str]
) -> None:
    """Pass the task and the machine to a privileged agent, and note it in `given`."""
    if not agent.call(isinstance, agent.agent, Privileged):
        return
    given.append("task")
    agent.call(show, agent.agent, job)


def _tell(agent: Apart, told: Callable[[], Sequence[str]], given: list[str]) -> None:
    """Pass the plan of the task to an agent that follows plans: as plain words and nothing else.

    The agent is called from its own thread, so that its callers do not lead to the episode. The
    plan is noted in `given`.
    """
    if not agent.call(getattr, agent.agent, "uses_plan", False):
        return
    follow = agent.call(getattr, agent.agent, "follow")
    given.append("plan")
    agent.call(follow, told())


def _turn(env: EpisodeEnv, agent: Apart, obs: dict[str, Any]) -> dict[str, Any]:
    """Ask the agent once and take its actions until the episode is over.

    Returns the last observation.
    """
    try:
        said, actions = agent.predict(obs["instruction"], {"screenshot": obs["screenshot"]})
    except AgentError as error:
        _account(env, agent)
        _blame(env, error)
        return obs
    _account(env, agent)
    env.hear(said)
    # An empty list of actions counts as a malformed action: otherwise an agent could stall forever.
    for action in actions or [""]:
        if env.record is None:
            obs, *_ = env.step(action)
    return obs


def _account(env: EpisodeEnv, agent: Apart) -> None:
    """Store the agent's `usage` in the record, if it is a mapping."""
    try:
        usage = agent.call(getattr, agent.agent, "usage", None)
        if isinstance(usage, Mapping):
            text = json.dumps(dict(usage), allow_nan=False)
            if len(text) > _LONGEST_USAGE:
                raise ValueError(f"{len(text)} characters, of which {_LONGEST_USAGE} are allowed")
            env.account(json.loads(text))
    except (AgentError, TypeError, ValueError) as error:
        env.account({"problem": f"usage cannot be kept: {error}"[:KEPT]})


def _called(function: Callable[..., object], *values: object) -> AgentError | None:
    """Call a function of the agent; return the error that it raised, if any."""
    try:
        function(*values)
    except AgentError as error:
        return error
    return None


def _blame(env: EpisodeEnv, error: AgentError) -> None:
    env.abandon(f"the agent raised {error}"[:KEPT], error.where)


def lost(job: Job, attempt: int, problem: str, *, start: float) -> ResultRecord:
    """Return a record for an episode that was interrupted before it wrote one.

    Args:
        job: What was run.
        attempt: The number of the attempt.
        problem: Why the episode left no record.
        start: When the episode began: a `time.monotonic()` of this process.
    """
    return {**_not_begun(job, attempt, problem, start), "status": "error"}


def _never_begun(record: ResultRecord | None, error: ResultRecord) -> ResultRecord:
    """Return the record of an episode whose desktop failed before the agent saw anything."""
    if record is not None and record.get("instruction"):
        return record
    # If no task could be set up, the environment's record does not have its name.
    identity = {key: error[key] for key in IDENTITY}
    return {**error, **(record or {}), **identity}


def _not_begun(job: Job, attempt: int, problem: str, start: float) -> ResultRecord:
    """Return the record of an episode that the environment could not begin."""
    task = tasks.get(job.task, job.seed)
    return {
        "version": VERSION,
        "id": slug_of(task.id, job.corruption, job.seed, job.agent, attempt),
        "agent": job.agent,
        "task": task.id,
        "task_seed": job.seed,
        "instruction": task.instruction,
        "apps": list(task.apps),
        "corruption": job.corruption,
        "seed": job.seed,
        "sample": task.id,
        "attempt": attempt,
        "infeasible": bool(task.infeasible),
        "params": {},
        "status": "invalid",
        "score": None,
        "reason": "",
        "steps": 0,
        "seconds": round(time.monotonic() - start, 3),
        "effects": [],
        "problem": problem[:KEPT],
        "cause": "machine",
        "traceback": [],
        "recovery": {},
        "malformed": 0,
        "last_action": None,
        "said": "",
        "usage": None,
        GIVEN: None,
        "desktop": {},
    }
