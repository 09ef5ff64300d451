"""The jobs of a benchmark: one for each agent, seed, task and corruption."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from hijack_data.runs.run_log import slug_of

from .. import tasks
from .config import Bench
from .records import ResultRecord

# Measured with the oracle on two cores (docs/benchmark.md).
EPISODE_SECONDS = 5.0  # to begin and to judge an episode
STEP_SECONDS = 0.8
# A step keeps a full-HD PNG, and a second one if the agent saw something else.
STEP_BYTES = 430_000


@dataclass(frozen=True)
class Job:
    """One episode to run: an agent at a task under a corruption (its label), with a seed."""

    agent: str
    task: str
    corruption: str
    seed: int

    @property
    def key(self) -> tuple[str, str, str, int]:
        """The fields that pair the job with its records."""
        return self.agent, tasks.get(self.task, self.seed).id, self.corruption, self.seed

    @property
    def id(self) -> str:
        """The id of its first attempt."""
        agent, task, corruption, seed = self.key
        return slug_of(task, corruption, seed, agent, 0)

    def __str__(self) -> str:
        return f"{self.agent}  {self.task}  seed {self.seed}  {self.corruption}"


def jobs(bench: Bench) -> list[Job]:
    """Return all jobs in the order of the run.

    A task is played under every corruption by every agent before the next one, so that every cell
    of the table has its first results early.
    """
    return [
        Job(agent, task, corruption, seed)
        for seed in bench.seeds
        for task in bench.tasks
        for corruption in bench.planners
        for agent in bench.agents
    ]


def attempts(
    listed: Sequence[Job], records: Iterable[ResultRecord]
) -> dict[Job, list[ResultRecord]]:
    """Return the records of each job, in their order."""
    by_key: dict[tuple[Any, ...], list[ResultRecord]] = {}
    for record in records:
        key = (record["agent"], record["task"], record["corruption"], record["seed"])
        by_key.setdefault(key, []).append(record)
    return {job: by_key.get(job.key, []) for job in listed}


def estimate(
    bench: Bench,
    listed: Sequence[Job],
    desktops: int = 1,
) -> str:
    """Return how long jobs take and what they write, in words.

    It is an upper bound: most episodes end before their last step.
    """
    steps = len(listed) * bench.max_steps
    seconds = len(listed) * EPISODE_SECONDS + steps * STEP_SECONDS
    time = _time(seconds / desktops)
    gigabytes = steps * STEP_BYTES / 1e9
    return f"at most {time} and {gigabytes:.1f} GB ({bench.max_steps} steps an episode)"


def _time(seconds: float) -> str:
    if seconds > 5400:
        return f"{seconds / 3600:.1f} h"
    minutes = max(1, round(seconds / 60))
    return f"{minutes} min"
