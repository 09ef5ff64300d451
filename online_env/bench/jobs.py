"""The jobs of a benchmark: one for each agent, seed, task and corruption."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from hijack_data.runs.run_log import episode_slug

from .. import tasks
from ..results.records import ResultRecord
from .config import Bench


@dataclass(frozen=True)
class Job:
    """One episode to run: an agent at a task under a corruption (its label), with a seed."""

    agent: str
    task: str
    corruption: str
    seed: int

    @property
    def key(self) -> tuple[str, str, str, int]:
        """The fields by which records of the job are found."""
        return self.agent, tasks.get(self.task, self.seed).id, self.corruption, self.seed

    @property
    def id(self) -> str:
        """The id of its first attempt."""
        agent, task, corruption, seed = self.key
        return episode_slug(task, corruption, seed, agent, 0)

    def __str__(self) -> str:
        return f"{self.agent}  {self.task}  seed {self.seed}  {self.corruption}"


def jobs(bench: Bench) -> list[Job]:
    """Return all jobs in the order of the run.

    Every agent plays a task under every corruption before the next task begins, so that every cell
    of the table has its first results early. A run that may end early plays a task with all its
    seeds, so that each task is one independent case.
    """
    if bench.until_retention is not None:
        cases = [(seed, task) for task in bench.tasks for seed in bench.seeds]
    else:
        cases = [(seed, task) for seed in bench.seeds for task in bench.tasks]
    return [
        Job(agent, task, corruption, seed)
        for seed, task in cases
        for corruption in bench.planners
        for agent in bench.agents
    ]


def attempts(
    listed: Sequence[Job], records: Iterable[ResultRecord]
) -> dict[Job, list[ResultRecord]]:
    """Return the records of each job, in order."""
    by_key: dict[tuple[Any, ...], list[ResultRecord]] = {}
    for record in records:
        key = (record["agent"], record["task"], record["corruption"], record["seed"])
        by_key.setdefault(key, []).append(record)
    return {job: by_key.get(job.key, []) for job in listed}
