"""How many tasks and seeds show a loss of a given size, and what a run of them takes.

The power is that of a paired t test over tasks, at the level of Holm's first step over the
corruptions. How far the losses of tasks differ comes from earlier runs in neighbouring folders. Two
parts are told apart by a one-way analysis of variance: between tasks, and between the seeds of a
task, of which more seeds average only the second.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import sqrt
from statistics import fmean

import numpy as np

from hijack_data.errors import quantity
from hijack_data.plan import CLEAN

from ..extra import require
from ..results.statistics import detectable_effect
from .config import Bench
from .estimates import EpisodeEstimate, History, expected, format_duration
from .jobs import jobs

POWER = 0.8
SIGNIFICANCE = 0.05
SEEDS = (1, 2, 3, 5)
MAX_TASKS = 100_000
# Without an earlier run: clean and corrupted outcomes at 50 %, which have nothing to do with each
# other. Agents that are better or worse, and tasks that stay easy or hard, need fewer tasks.
UNKNOWN_VARIANCE = 0.5


@dataclass(frozen=True, kw_only=True)
class LossVariance:
    """How far the losses of an agent differ, in squared shares.

    Attributes:
        between: variance between tasks.
        within: variance between the seeds of a task.
        source: where both come from, in words.
    """

    between: float
    within: float
    source: str

    def spread(self, seeds: int) -> float:
        """Return the standard deviation of the tasks' mean losses over some seeds."""
        return sqrt(self.between + self.within / seeds)


def sample_size_lines(
    bench: Bench, points: float, history: History, desktops: int
) -> Iterator[str]:
    """Yield which numbers of tasks and seeds show a loss, with hours and cost.

    Args:
        bench: the benchmark, whose agents and conditions are played.
        points: the loss in points, above 0.
        history: of earlier runs.
        desktops: how many play side by side.

    Raises:
        MissingDependencyError: scipy is not installed.
    """
    require("the size of a sample", ("scipy",))
    labels = [label for label in bench.planners if label != CLEAN]
    level = 1 - SIGNIFICANCE / max(1, len(labels))
    yield (
        f"to show a loss of {points:g} points with a probability of {100 * POWER:.0f} %, at p <"
        f" {SIGNIFICANCE:g} adjusted for {quantity(len(labels), 'corruption')} (Holm):"
    )
    estimates = expected(bench, jobs(bench), history)
    case_count = len(bench.tasks) * len(bench.seeds)
    for agent in bench.agents:
        variance = loss_variance(history, agent, labels)
        yield f"{agent}: {variance.source}"
        for seeds in SEEDS if variance.within else (1,):
            tasks = tasks_needed(points / 100, variance.spread(seeds), level)
            cases = tasks * seeds
            yield f"  {quantity(tasks, 'task')} x {quantity(seeds, 'seed')}: " + _costs(
                estimates, cases / case_count, desktops, cases * len(bench.planners)
            )
        loss = detectable_effect(len(bench.tasks), POWER, level) if len(bench.tasks) > 2 else None
        if loss is not None:
            loss *= variance.spread(len(bench.seeds))
            yield (
                f"  {bench.source}, {quantity(len(bench.tasks), 'task')} x"
                f" {quantity(len(bench.seeds), 'seed')}, shows {min(100.0, 100 * loss):.1f} points"
            )


def loss_variance(history: History, agent: str, labels: Sequence[str]) -> LossVariance:
    """Return how far the losses of an agent differ, under the condition where they differ most.

    Args:
        history: of earlier runs.
        agent: its name.
        labels: the conditions.
    """
    measured = {
        label: _analyse(by_task)
        for label in labels
        if len(by_task := history.losses.get((agent, label), {})) > 2
    }
    if not any(map(sum, measured.values())):
        return LossVariance(
            between=UNKNOWN_VARIANCE,
            within=0.0,
            source=(
                "no earlier run here, so success of 50 % is assumed, clean and corrupted unrelated,"
                " and seeds that tell no more than one"
            ),
        )
    worst = max(measured, key=lambda label: sum(measured[label]))
    between, within = measured[worst]
    source = f"the losses of tasks differ as in earlier runs under {worst}, where they differ most"
    if not within:
        source += "; these have one seed a task, so more seeds count as no help"
    return LossVariance(between=between, within=within, source=source)


def _analyse(by_task: Mapping[str, Sequence[float]]) -> tuple[float, float]:
    """Return the variance of losses between tasks, and within them over seeds."""
    means = [fmean(losses) for losses in by_task.values()]
    squares = sum(float(np.var(losses)) * len(losses) for losses in by_task.values())
    freedom = sum(len(losses) - 1 for losses in by_task.values())
    within = squares / freedom if freedom else 0.0
    share = fmean(1 / len(losses) for losses in by_task.values())
    return max(0.0, float(np.var(means, ddof=1)) - within * share), within


def tasks_needed(loss: float, spread: float, level: float) -> int:
    """Return the least number of tasks that shows a loss with the probability `POWER`.

    Args:
        loss: the true one, a share above 0.
        spread: standard deviation of the tasks' losses.
        level: the confidence level of the test.
    """
    low, high = 2, 3
    while high < MAX_TASKS and detectable_effect(high, POWER, level) * spread > loss:
        low, high = high, 2 * high
    while high - low > 1:
        middle = (low + high) // 2
        is_enough = detectable_effect(middle, POWER, level) * spread <= loss
        low, high = (low, middle) if is_enough else (middle, high)
    return high


def _costs(
    estimates: Sequence[EpisodeEstimate], factor: float, desktops: int, episodes: int
) -> str:
    """Return the episodes, time and money of a run that is `factor` times as large as planned."""
    seconds = factor * sum(item.seconds for item in estimates) / desktops
    about = "at most" if any(item.basis == "limit" for item in estimates) else "about"
    text = f"{quantity(episodes, 'episode')}, {about} {format_duration(seconds)}"
    if any(item.usd is None for item in estimates):
        return f"{text}, money not known"
    usd = factor * sum(item.usd or 0.0 for item in estimates)
    return f"{text}, {usd:.2f} USD" if usd else text
