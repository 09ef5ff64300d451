"""One job on a live desktop: an agent plays an episode of `CorruptedEnv`."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
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
from ..agents.guarded import Guarded, Onlooker, joint_usage
from ..agents.guards import make_onlooker
from ..agents.references import is_user_code, reference_to
from ..agents.registry import AGENTS, make
from ..environment import CorruptedEnv
from ..environment.script import Script, check_corruptions
from ..environment.settle import Settle
from ..environment.stage import TaskStage
from ..errors import DesktopError, MissingCapabilityError
from ..results.costs import USAGE_PROBLEM
from ..results.records import ResultRecord
from .config import Bench
from .jobs import Job
from .models import begin

_NO_ACTION = "pyautogui.sleep(0)"  # a step in which the runner does nothing
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

    def record_guard(self, guard: dict[str, Any]) -> None:
        """Store what the agent's guard is, and what it did so far."""
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
        self._was_checked = False

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

        Raises:
            MissingCapabilityError: The desktop cannot have one of the run's corruptions at all.
        """
        bench = self._bench
        if not self._was_checked:
            desktop = self._stage.desktop
            check_corruptions(bench.planners.values(), bench.max_steps, desktop, bench.layer)
            self._was_checked = True
        episode = episode_slug(*job.key[1:3], job.seed, job.agent, attempt)
        chat_run = begin(job.agent, bench.guard, episode)
        settle = getattr(self._stage.desktop, "settle", Settle())
        settings = replace(bench.settings(job.agent, self._folder), settle=settle)
        env = CorruptedEnv(self._stage, settings=settings)
        planner = bench.planners[job.corruption]
        start = time.monotonic()
        is_foreign = is_user_code(AGENTS.get(job.agent))
        inputs = ("process",) if is_foreign and bench.in_process else ()
        try:
            agent = self._make_agent(job.agent, is_foreign and not bench.in_process)
        except AgentError as error:
            problem = f"the agent cannot be made: {error}"
            record = lost_record(job, attempt, problem, start=start)
            return {
                **record,
                "cause": "agent",
                "traceback": list(error.frames),
                "usage": None,
                GIVEN: list(inputs),
            }
        try:
            limit = bench.episode_timeout
            read_plan = self._read_plan
            guard = make_onlooker(bench.guard, job.agent, chat_run) if bench.guard else None
            address = self._open_port(agent, job)
            return _play_episode(
                env,
                agent,
                job,
                attempt,
                planner,
                self._pass_task,
                limit,
                read_plan,
                inputs,
                onlooker=guard,
                address=address,
            )
        finally:
            _call_agent(agent.reset)
            if isinstance(agent, AgentThread):
                agent.close()

    @property
    def hung_in_judging(self) -> bool:
        """Whether judging the last episode did not end in its time."""
        return getattr(self._stage, "hung_in_judging", False)

    def desktop_works(self) -> bool:
        """Return whether the desktop can play another episode, after one that failed."""
        if getattr(self._stage, "was_not_reverted", False):
            return False
        try:
            self._stage.desktop.screenshot()
        except DesktopError:
            return False
        return True

    def _make_agent(self, name: str, own_process: bool) -> RunningAgent:
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

    def _open_port(self, agent: RunningAgent, job: Job) -> str:
        """Return the address of the browser's DevTools for an agent that wants it; "" for others.

        Raises:
            MissingCapabilityError: The desktop is no browser, or the corruption is in the picture.
        """
        desktop = self._stage.desktop
        open_port: Callable[[bool], str] | None = getattr(desktop, "open_port", None)
        if not _uses_devtools(agent):
            return "" if open_port is None else open_port(False)
        if open_port is None:
            raise MissingCapabilityError(
                f"{job.agent} drives a browser by DevTools, and this desktop is none: name tasks of"
                " a browser, such as miniwob/click-test.html"
            )
        script = Script(self._bench.planners[job.corruption], job.seed, "", (), desktop.size)
        plans = [script.plan(step) for step in range(self._bench.max_steps + 1)]
        layer = getattr(self._bench, "layer", "picture")
        if layer == "picture" and any(plan.ops for plan in plans):
            raise MissingCapabilityError(
                f"{job.corruption} is in the pictures that the runner gives, and {job.agent} takes"
                " its own by DevTools: leave it out with --corruptions"
            )
        return open_port(True)

    def _pass_task(self, agent: Agent, job: Job) -> None:
        """Pass the task and the desktop to a privileged agent."""
        cast("Privileged", agent).prepare(self._stage.task, self._stage.machine)

    def _read_plan(self) -> Sequence[str]:
        """Return the plan in words of the current task."""
        return self._stage.plan()


def play(
    env: EpisodeEnv,
    agent: Agent,
    job: Job,
    attempt: int,
    planner: Planner | None,
    show: Callable[[Agent, Job], object] | None = None,
    *,
    privileged_inputs: Sequence[str] = (),
    limit: float = math.inf,
    onlooker: Onlooker | None = None,
) -> ResultRecord:
    """Run one episode and return its record.

    The agent sees instruction and screenshot, nothing else. Its code runs in this process, in a
    thread of its own, and the record says so unless it is the library's. If the agent raises, or
    the desktop fails after the agent's first action, the status of the record is `error`, and
    `cause` names who failed; if the desktop fails earlier, the status is `invalid`.

    Args:
        env: The environment.
        agent: The agent.
        job: What to run.
        attempt: The number of the attempt, from 0.
        planner: The corruption; `None` for a clean episode.
        show: Called once the task is set up, with a privileged agent and the job, to give the agent
            its task and desktop.
        privileged_inputs: What the agent is given besides, of `run_log.GIVEN_KINDS`.
        limit: Seconds that the episode may take.
        onlooker: What watches the agent; `None` for nothing.

    Raises:
        MissingCapabilityError: The desktop lacks a capability that the corruption needs.
    """
    inputs = [*privileged_inputs, *(() if is_ours(type(agent)) else ("process",))]
    with AgentThread(lambda: agent) as thread:
        return _play_episode(
            env,
            thread,
            job,
            attempt,
            planner,
            show,
            limit,
            privileged_inputs=inputs,
            onlooker=onlooker,
        )


def _play_episode(
    env: EpisodeEnv,
    agent: RunningAgent,
    job: Job,
    attempt: int,
    planner: Planner | None,
    show: Callable[[Agent, Job], object] | None,
    limit: float = math.inf,
    read_plan: Callable[[], Sequence[str]] | None = None,
    privileged_inputs: Sequence[str] = (),
    onlooker: Onlooker | None = None,
    address: str = "",
) -> ResultRecord:
    start = time.monotonic()
    guarded = None if onlooker is None else Guarded(agent, onlooker)
    options = {"task": job.task, "corruption": planner, "label": job.corruption, "attempt": attempt}
    error_raised = _call_agent(agent.reset)
    try:
        obs, _ = env.reset(seed=job.seed, options=options)
    except DesktopError as error:
        if env.record is None and isinstance(error, MissingCapabilityError):
            # The episode is refused at the start: the desktop lacks a capability that the
            # configuration needs.
            raise
        problem = f"{type(error).__name__}: {error}"
        return _failed_start_record(env.record, _blank_record(job, attempt, problem, start))
    kinds = list(privileged_inputs)
    if show is not None and error_raised is None:
        error_raised = _call_agent(_prepare, agent, show, job, kinds)
    if read_plan is not None and error_raised is None:
        error_raised = _call_agent(_pass_plan, agent, read_plan, kinds)
    if address and error_raised is None:
        kinds.append("devtools")
        error_raised = _call_agent(agent.connect, address)
    env.declare_privileged_inputs(kinds)
    if error_raised is not None:
        _end_as_failure(env, error_raised)
    while (record := env.record) is None:
        obs = _take_turn(env, agent, obs, guarded)
        if env.record is None and time.monotonic() - start > limit:
            env.abandon(f"the episode took longer than {limit:g} s")
    if onlooker is not None:
        onlooker.reset()
    return record


def _prepare(
    agent: RunningAgent, show: Callable[[Agent, Job], object], job: Job, kinds: list[str]
) -> None:
    """Pass the task and the machine to a privileged agent, and note it in `kinds`.

    Raises:
        AgentError: The agent has a process of its own, which neither can be sent to.
    """
    if not agent.traits.is_privileged:
        return
    if not isinstance(agent, AgentThread):
        raise AgentError(NEEDS_TASK)
    kinds.append("task")
    agent.call(show, agent.agent, job)


def _uses_devtools(agent: RunningAgent) -> bool:
    """Return whether an agent acts in the browser by itself; one that cannot say so does not."""
    try:
        return agent.traits.uses_devtools
    except AgentError:
        return False


def _pass_plan(
    agent: RunningAgent, read_plan: Callable[[], Sequence[str]], kinds: list[str]
) -> None:
    """Pass the plan of the task to an agent that follows plans: as plain words and nothing else.

    The plan is noted in `kinds`.
    """
    if not agent.traits.uses_plan:
        return
    kinds.append("plan")
    agent.follow(read_plan())


def _take_turn(
    env: EpisodeEnv, agent: RunningAgent, obs: dict[str, Any], guarded: Guarded | None
) -> dict[str, Any]:
    """Ask the agent once, or its guard, and take the actions until the episode is over.

    Returns the last observation.
    """
    picture = {"screenshot": obs["screenshot"]}
    try:
        text, actions = (guarded or agent).predict(obs["instruction"], picture)
    except AgentError as error:
        _store_usage(env, agent, guarded)
        _end_as_failure(env, error)
        return obs
    except Exception as error:  # noqa: BLE001  (agents raise AgentError only; a guard anything)
        _store_usage(env, agent, guarded)
        _end_as_failure(env, AgentError(f"{type(error).__name__} in its guard: {error}"))
        return obs
    _store_usage(env, agent, guarded)
    env.record_message(text)
    # An empty list of actions counts as a malformed action: otherwise an agent could stall forever.
    # An agent with DevTools has acted by itself.
    for action in actions or [_NO_ACTION if _uses_devtools(agent) else ""]:
        if env.record is None:
            obs, *_ = env.step(action)
    return obs


def _store_usage(env: EpisodeEnv, agent: RunningAgent, guarded: Guarded | None) -> None:
    """Store in the record what the guard did, and the usage that agent and guard report.

    If the agent's process has ended, what it reported last stays.
    """
    if guarded is not None:
        env.record_guard(guarded.guard_record)
    try:
        usage = agent.usage()
    except AgentGoneError:
        return
    except AgentError as error:
        usage = {USAGE_PROBLEM: f"usage cannot be kept: {error}"[:MAX_PROBLEM_CHARS]}
    if guarded is not None:
        usage = joint_usage(usage, guarded.onlooker.usage)
    if usage is not None:
        env.record_usage(usage)


def _call_agent(function: Callable[..., object], *values: object) -> AgentError | None:
    """Call a function of the agent; return the error that it raised, if any."""
    try:
        function(*values)
    except AgentError as error:
        return error
    return None


def _end_as_failure(env: EpisodeEnv, error: AgentError) -> None:
    env.abandon(f"the agent raised {error}"[:MAX_PROBLEM_CHARS], error.frames)


def lost_record(job: Job, attempt: int, problem: str, *, start: float) -> ResultRecord:
    """Return a record for an episode that was interrupted before it wrote one.

    Args:
        job: What was run.
        attempt: The number of the attempt.
        problem: Why the episode left no record.
        start: When the episode began: a `time.monotonic()` of this process.
    """
    usage = {USAGE_PROBLEM: "the episode left no record of its usage"}
    return {**_blank_record(job, attempt, problem, start), "status": "error", "usage": usage}


def _failed_start_record(record: ResultRecord | None, error: ResultRecord) -> ResultRecord:
    """Return the record of an episode whose desktop failed before the agent saw anything."""
    if record is not None and record.get("instruction"):
        return record
    # If no task could be set up, the environment's record does not have its name.
    identity = {key: error[key] for key in IDENTITY}
    return {**error, **(record or {}), **identity}


def _blank_record(job: Job, attempt: int, problem: str, start: float) -> ResultRecord:
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
        "environment_errors": None,
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
