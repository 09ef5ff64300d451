"""What tasks keep of their clean success, over a declared distribution of conditions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hijack_data.errors import ParameterError
from hijack_data.plan import CLEAN

from . import scores
from .intervals import Floats64
from .record_score import ResultRecord


@dataclass(frozen=True, kw_only=True)
class TaskRetention:
    """The scores of an agent's tasks, clean and over the distribution.

    Attributes:
        tasks: their names, in the order in which they were drawn.
        clean: the mean clean score of each task, 0..1, float64 `[tasks]`.
        corrupted: the weighted mean of its corrupted scores, likewise.
        episodes: how many have a score.
        missing: ids of episodes without one, which count as lost: 1 clean, 0 corrupted.
        repeats: whether a task has several conditions or seeds.
        unshared: how many rows of a dataset not every condition has; they count for nothing.
    """

    tasks: tuple[str, ...]
    clean: Floats64
    corrupted: Floats64
    episodes: int
    missing: tuple[str, ...]
    repeats: bool
    unshared: int = 0

    @property
    def is_binary(self) -> bool:
        """Whether each task has one clean and one corrupted outcome, each solved or not."""
        values = np.concatenate([self.clean, self.corrupted])
        return not self.repeats and bool(np.all((values == 0) | (values == 1)))

    @property
    def estimate(self) -> float:
        """The mean corrupted score divided by the mean clean one."""
        return float(self.corrupted.sum() / self.clean.sum())


def score_tasks(
    records: Sequence[ResultRecord], agent: str, weights: Mapping[str, float]
) -> TaskRetention:
    """Return what an agent's tasks keep, over all tasks and seeds of some records.

    Every task must have the same seeds under every condition: an episode that ended without a
    score, or that is not there, is `missing`.

    Args:
        records: all attempts, in their order.
        agent: its name.
        weights: of each condition; they add up to 1.

    Raises:
        ParameterError: there is no such record.
    """
    labels = (CLEAN, *weights)
    agent_records = [r for r in records if r["agent"] == agent and r["corruption"] in labels]
    groups = scores.group_records(agent_records)
    positions: dict[str, int] = {}
    seeds: dict[tuple[Any, int], None] = {}
    cases: dict[tuple[str, tuple[Any, int]], scores.PairKey] = {}
    unshared = 0
    for record in agent_records:
        name = scores.task_name(record["task"], record.get("task_seed"))
        repeat = record.get("task_seed"), record["seed"]
        positions.setdefault(name, len(positions))
        seeds.setdefault(repeat)
        cases[name, repeat] = (record["task"], *repeat)
    if any(isinstance(variant, str) for variant, _ in seeds):  # steps of a recording, not repeats
        last = [groups.last.get((agent, label), {}) for label in labels]
        grid = [key for key, case in cases.items() if all(case in cell for cell in last)]
        unshared = len(cases) - len(grid)
        positions = {name: index for index, name in enumerate(dict.fromkeys(n for n, _ in grid))}
    else:
        grid = [(name, repeat) for name in positions for repeat in seeds]
    if not grid:
        raise ParameterError(f"{agent} has no case under {', '.join(labels)}")
    sums = {label: np.zeros(len(positions)) for label in labels}
    counts = np.zeros(len(positions))
    missing: list[str] = []
    for name, repeat in grid:
        counts[positions[name]] += 1
        for label in labels:
            case = cases.get((name, repeat))
            score = groups.scored.get((agent, label), {}).get(case) if case else None
            if score is None:
                missing.append(f"{name} under {label}, seed {repeat[1]}")
                score = float(label == CLEAN)
            sums[label][positions[name]] += score
    corrupted = np.zeros(len(positions))
    for label, weight in weights.items():
        corrupted += weight * sums[label] / counts
    return TaskRetention(
        tasks=tuple(positions),
        clean=sums[CLEAN] / counts,
        corrupted=np.minimum(corrupted, 1.0),
        episodes=len(grid) * len(labels) - len(missing),
        missing=tuple(missing),
        repeats=len(weights) > 1 or len(grid) > len(positions),
        unshared=unshared,
    )
