"""One job on a live desktop: an agent plays an episode of `CorruptedEnv`."""

import math
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Protocol, cast

from hijack_data.planner import Planner
from hijack_data.registry import is_ours
from hijack_data.runs.run_log import GIVEN, VERSION, episode_slug

from .. import tasks
from ..agents.agent_calls import NEEDS_TASK, AgentError, AgentGoneError, RunningAgent
from ..agents.agent_process import AgentProcess
from ..agents.agent_thread import AgentThread
from ..agents.base import Agent, Privileged
from ..agents.references import is_user_code, reference_to
from ..agents.registry import AGENTS, make
from ..environment import CorruptedEnv, EvalSettings
from ..environment.stage import TaskStage
from ..errors import DesktopError, MissingCapabilityError
from ..results.records import ResultRecord
from .config import Bench
from .jobs import Job
from .models import begin

MAX_PROBLEM_CHARS = 2000  # characters of a problem
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

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, Any]:
        """Take one action."""
        ...

    def record_message(self, text: str) -> None:
        """Log the agent's words for its next action."""
        ...

    def record_usage(self, usage: dict[str, Any]) -> None:
        """Store the usage that the agent has reported so far."""
        ...

    def declare_privileged_inputs(self, kinds: Sequence[str]) -> None:
        """Store what the agent is given in addition to instruction and pictures."""
        ...

    def abandon(self, why: str, traceback: Sequence[str] = ()) -> None:
        """End the episode with the status `error`, as the agent's failure."""
        ...


class LiveEpisodes:
    """Runs jobs on one embedded desktop; use it in a `with` statement if agents have processes.

    Args:
        bench: The benchmark.
        folder: The folder of the run, where the frames go.
        stage: The desktop and its tasks.
    """

    def __init__(self, bench: Bench, folder: Path, stage: TaskStage) -> None:
        self._bench = bench
        self._folder = folder
        self._stage = stage
        self._processes: dict[str, AgentProcess] = {}  # each plays all episodes of its agent

    def __enter__(self) -> "LiveEpisodes":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the processes of agents."""
        while self._processes:
            self._processes.popitem()[1].close()

    def __call__(self, job: Job, attempt: int) -> ResultRecord:
        """Run a job.

        Raises `MissingCapabilityError` if the desktop cannot have the corruption at all.
        """
        bench = self._bench
        begin(job.agent, episode_slug(*job.key[1:3], job.seed, job.agent, attempt))
        settings = EvalSettings(
            max_steps=bench.max_steps, recovery=bench.recovery, log=self._folder, agent=job.agent
        )
        env = CorruptedEnv(self._stage, settings=settings)
        planner = bench.planners[job.corruption]
        start = time.monotonic()
        foreign = is_user_code(AGENTS.get(job.agent))
        given = ("process",) if foreign and bench.in_process else ()
        try:
            agent = self._made(job.agent, foreign and not bench.in_process)
        except AgentError as error:
            problem = f"the agent cannot be made: {error}"
            made = lost_record(job, attempt, problem, start=start)
            return {**made, "cause": "agent", "traceback": list(error.where), GIVEN: list(given)}
        try:
            limit = bench.episode_timeout
            told = self._plan
            return _played(env, agent, job, attempt, planner, self._show, limit, told, given)
        finally:
            _called(agent.reset)
            if isinstance(agent, AgentThread):
                agent.close()

    def _made(self, name: str, own_process: bool) -> RunningAgent:
        """Return an agent with a new object: in its process, or in a thread of this one.

        Raises:
            AgentError: It cannot be made.
        """
        bench = self._bench
        if not own_process:
            return AgentThread(partial(make, name), bench.agent_timeout)
        process = self._processes.get(name)
        if process is None:
            reference = reference_to(AGENTS.get(name), name)
            memory = int(bench.agent_memory * 2**30) or None
            process = AgentProcess(reference, bench.agent_timeout, memory=memory)
            self._processes[name] = process
        process.make()
        return process

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

    The agent sees instruction and screenshot, nothing else. Its code runs in this process, in a
    thread of its own, and the record says so unless it is the library's. If the agent raises, or
    the desktop fails after the agent's first action, the status of the record is `error`, and
    `cause` names who failed; if the desktop fails earlier, the status is `invalid`.
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
    given = () if is_ours(type(agent)) else ("process",)
    with AgentThread(lambda: agent) as apart:
        return _played(env, apart, job, attempt, planner, show, given=given)


def _played(
    env: EpisodeEnv,
    agent: RunningAgent,
    job: Job,
    attempt: int,
    planner: Planner | None,
    show: Callable[[Agent, Job], object] | None,
    limit: float = math.inf,
    told: Callable[[], Sequence[str]] | None = None,
    given: Sequence[str] = (),
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
    kinds = list(given)
    if show is not None and failed is None:
        failed = _called(_prepare, agent, show, job, kinds)
    if told is not None and failed is None:
        failed = _called(_tell, agent, told, kinds)
    env.declare_privileged_inputs(kinds)
    if failed is not None:
        _blame(env, failed)
    while (record := env.record) is None:
        obs = _turn(env, agent, obs)
        if env.record is None and time.monotonic() - start > limit:
            env.abandon(f"the episode took longer than {limit:g} s")
    return record


def _prepare(
    agent: RunningAgent, show: Callable[[Agent, Job], object], job: Job, given: list[str]
) -> None:
    """Pass the task and the machine to a privileged agent, and note it in `given`.

    Raises:
        AgentError: The agent has a process of its own, which neither can be sent to.
    """
    if not agent.traits.is_privileged:
        return
    if not isinstance(agent, AgentThread):
        raise AgentError(NEEDS_TASK)
    given.append("task")
    agent.call(show, agent.agent, job)


def _tell(agent: RunningAgent, told: Callable[[], Sequence[str]], given: list[str]) -> None:
    """Pass the plan of the task to an agent that follows plans: as plain words and nothing else.

    The plan is noted in `given`.
    """
    if not agent.traits.uses_plan:
        return
    given.append("plan")
    agent.follow(told())


def _turn(env: EpisodeEnv, agent: RunningAgent, obs: dict[str, Any]) -> dict[str, Any]:
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
    env.record_message(said)
    # An empty list of actions counts as a malformed action: otherwise an agent could stall forever.
    for action in actions or [""]:
        if env.record is None:
            obs, *_ = env.step(action)
    return obs


def _account(env: EpisodeEnv, agent: RunningAgent) -> None:
    """Store the usage that the agent reports in the record.

    If its process has ended, what it reported last stays.
    """
    try:
        usage = agent.usage()
    except AgentGoneError:
        return
    except AgentError as error:
        usage = {"problem": f"usage cannot be kept: {error}"[:MAX_PROBLEM_CHARS]}
    if usage is not None:
        env.record_usage(usage)


def _called(function: Callable[..., object], *values: object) -> AgentError | None:
    """Call a function of the agent; return the error that it raised, if any."""
    try:
        function(*values)
    except AgentError as error:
        return error
    return None


def _blame(env: EpisodeEnv, error: AgentError) -> None:
    env.abandon(f"the agent raised {error}"[:MAX_PROBLEM_CHARS], error.where)


def lost_record(job: Job, attempt: int, problem: str, *, start: float) -> ResultRecord:
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
        "id": episode_slug(task.id, job.corruption, job.seed, job.agent, attempt),
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
        "problem": problem[:MAX_PROBLEM_CHARS],
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
