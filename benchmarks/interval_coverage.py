"""How often the intervals of a report hold the true value, and whether a better result has a lower one.

Benchmarks are simulated: tasks differ in how often they are solved (a beta distribution), the seeds
of a task are drawn from its own probability, and the corruption lowers it by a share that differs
by task. An interval of 95 % should hold the true value in 95 of 100 benchmarks.

    python benchmarks/interval_coverage.py
"""

from collections.abc import Sequence

import numpy as np
from common import machine, table

from online_env.results import statistics

BENCHMARKS = 1000
TASKS = (12, 24, 122)
SEEDS = (1, 3)
RATES = (0.05, 0.3, 0.5, 0.9, 0.95, 0.99)
SHARES_KEPT = (0.95, 0.5, 0.05)
CLEAN_RATES = (0.5, 0.95)
CONCENTRATION = 1.0  # of the beta distribution: low, so most tasks are solved always or never
IMPROVED = 300  # drawn benchmarks of which single failures become successes


def draw_tasks(rng: np.random.Generator, rate: float, tasks: int) -> np.ndarray:
    """Return how often each task is solved, float64 `[tasks]`, of the mean `rate`."""
    return rng.beta(CONCENTRATION * rate, CONCENTRATION * (1 - rate), tasks)


def draw_scores(rng: np.random.Generator, solved: np.ndarray, seeds: int) -> list[float]:
    """Return the scores of all episodes, task by task."""
    return (rng.random((len(solved), seeds)) < solved[:, None]).astype(float).ravel().tolist()


def mean_coverage(rate: float, tasks: int, seeds: int) -> float:
    """Return the share of benchmarks whose interval of the mean holds the rate."""
    rng = np.random.default_rng(0)
    names = [task for task in range(tasks) for _ in range(seeds)]
    held = 0
    for _ in range(BENCHMARKS):
        found = statistics.mean_interval(
            draw_scores(rng, draw_tasks(rng, rate, tasks), seeds), names
        )
        held += found.low <= rate <= found.high
    return held / BENCHMARKS


def pair_coverage(rate: float, kept: float, tasks: int, seeds: int) -> tuple[float, float]:
    """Return the shares of benchmarks whose intervals hold the true loss, and the true retention.

    Benchmarks without any clean success have no retention, and are left out of its share.
    """
    rng = np.random.default_rng(1)
    names = [task for task in range(tasks) for _ in range(seeds)]
    held = held_kept = with_retention = 0
    for _ in range(BENCHMARKS):
        solved = draw_tasks(rng, rate, tasks)
        clean = draw_scores(rng, solved, seeds)
        corrupted = draw_scores(rng, solved * draw_tasks(rng, kept, tasks), seeds)
        change = statistics.difference_interval(clean, corrupted, names)
        held += change.low <= rate * (kept - 1) <= change.high
        retention = statistics.retention_interval(clean, corrupted, names)
        if retention is not None:
            with_retention += 1
            held_kept += retention.low <= kept <= retention.high
    return held / BENCHMARKS, held_kept / max(1, with_retention)


def falls(tasks: int, seeds: int) -> tuple[float, float]:
    """Return how much an end falls, and the width grows, when one failure becomes a success.

    Both in points, the most of all drawn benchmarks. The width is that of results above 50 %, which
    come nearer to 100 %.
    """
    rng = np.random.default_rng(2)
    names = [task for task in range(tasks) for _ in range(seeds)]
    fall = growth = 0.0
    for number in range(IMPROVED):
        rate = float(rng.uniform(0.05, 0.99))
        solved = draw_tasks(rng, rate, tasks) if number % 2 else np.full(tasks, rate)
        scores = draw_scores(rng, solved, seeds)
        before = statistics.mean_interval(scores, names)
        for place in [place for place, score in enumerate(scores) if not score][:4]:
            better = [*scores[:place], 1.0, *scores[place + 1 :]]
            after = statistics.mean_interval(better, names)
            fall = max(fall, before.low - after.low, before.high - after.high)
            if after.value > 0.5:
                growth = max(growth, (after.high - after.low) - (before.high - before.low))
    return 100 * fall, 100 * growth


def percent(shares: Sequence[float]) -> list[str]:
    return [f"{100 * share:.1f}" for share in shares]


def main() -> None:
    settings = [(tasks, seeds) for tasks in TASKS for seeds in SEEDS]
    heads = [f"{tasks} x {seeds}" for tasks, seeds in settings]
    print(machine())
    print(f"\nPercent of {BENCHMARKS:,} simulated benchmarks whose 95 % interval holds the truth;")
    print("a column is tasks x seeds.\n")
    rows = [
        ["success", f"{100 * rate:g} %", *percent([mean_coverage(rate, *one) for one in settings])]
        for rate in RATES
    ]
    for rate in CLEAN_RATES:
        for kept in SHARES_KEPT:
            pairs = [pair_coverage(rate, kept, *one) for one in settings]
            name = f"{100 * rate:g} % clean, {100 * kept:g} % of it kept"
            rows.append(["difference", name, *percent([pair[0] for pair in pairs])])
            rows.append(["retention", name, *percent([pair[1] for pair in pairs])])
    print(table(("interval of", "truth", *heads), rows))
    ends = [falls(*one) for one in settings]
    print(
        "\nOne more success, in points: how much the most an end of the interval of a mean falls,"
    )
    print("and how much the most its width grows (above 50 %).\n")
    rows = [
        ["an end falls by", *[f"{fall:.2f}" for fall, _ in ends]],
        ["the width grows by", *[f"{growth:.2f}" for _, growth in ends]],
    ]
    print(table(("tasks x seeds", *heads), rows))


if __name__ == "__main__":
    main()
