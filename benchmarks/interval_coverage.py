"""How often the intervals of a report, and the certificate of a run, hold the true value.

Benchmarks are simulated: tasks differ in how often they are solved (a beta distribution), the seeds
of a task are drawn from its own probability, and the corruption lowers it by a share that differs
by task. An interval of 95 % should hold the true value in 95 of 100 benchmarks, and so should the
one-sided bound of a certificate. A second part shows whether a better result has a lower interval.

    python benchmarks/interval_coverage.py
"""

from collections.abc import Sequence

import numpy as np
from common import machine, table

from online_env.results import mean_bounds, statistics

BENCHMARKS = 1000
SETTINGS = ((12, 1), (12, 5), (24, 1), (24, 3), (122, 1), (122, 3), (369, 1), (369, 5))
CONDITIONS = 9  # of a benchmark that is certified over several
KEPT = (0.99, 0.9, 0.5)
STEPS = 12.0  # mean of a task's steps, which are exponential over tasks
RATES = (0.05, 0.3, 0.5, 0.9, 0.95, 0.99)
SHARES_KEPT = (0.95, 0.5, 0.05)
CLEAN_RATES = (0.5, 0.95)
CONCENTRATION = 1.0  # of the beta distribution: low, so most tasks are solved always or never
CERTIFIED = 20  # benchmarks whose bounds are averaged
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
    result = 0
    for _ in range(BENCHMARKS):
        value = statistics.mean_interval(
            draw_scores(rng, draw_tasks(rng, rate, tasks), seeds), names
        )
        result += value.low <= rate <= value.high
    return result / BENCHMARKS


def pair_coverage(rate: float, kept: float, tasks: int, seeds: int) -> tuple[float, float]:
    """Return the shares of benchmarks whose intervals hold the true loss, and the true retention.

    Benchmarks without any clean success have no retention, and are left out of its share.
    """
    rng = np.random.default_rng(1)
    names = [task for task in range(tasks) for _ in range(seeds)]
    result = held_kept = with_retention = 0
    for _ in range(BENCHMARKS):
        solved = draw_tasks(rng, rate, tasks)
        clean = draw_scores(rng, solved, seeds)
        corrupted = draw_scores(rng, solved * draw_tasks(rng, kept, tasks), seeds)
        change = statistics.difference_interval(clean, corrupted, names)
        result += change.low <= rate * (kept - 1) <= change.high
        retention = statistics.retention_interval(clean, corrupted, names)
        if retention is not None:
            with_retention += 1
            held_kept += retention.low <= kept <= retention.high
    return result / BENCHMARKS, held_kept / max(1, with_retention)


def grand_mean_coverage(rate: float, tasks: int, seeds: int) -> float:
    """Return the share of benchmarks whose interval of the mean over conditions holds the rate."""
    rng = np.random.default_rng(3)
    names = [task for task in range(tasks) for _ in range(seeds)]
    result = 0
    for _ in range(BENCHMARKS):
        solved = draw_tasks(rng, rate, tasks)
        cells = [(draw_scores(rng, solved, seeds), names) for _ in range(CONDITIONS)]
        mean = statistics.grand_mean_interval(cells)
        result += mean.low <= rate <= mean.high
    return result / BENCHMARKS


def steps_coverage(tasks: int, seeds: int) -> float:
    """Return the share of benchmarks whose paired t interval holds the true change of steps.

    Tasks take exponential numbers of steps, and a corruption makes them longer by a share that is
    exponential, too: skewed, as steps and tokens are.
    """
    rng = np.random.default_rng(4)
    result = 0
    for _ in range(BENCHMARKS):
        task_steps = rng.exponential(STEPS, tasks)
        slower = 1 + rng.exponential(0.3, tasks)
        noise = rng.gamma(4, 1 / 4, (2, seeds, tasks)).mean(axis=1)
        test = statistics.paired_t((task_steps * (slower * noise[0] - noise[1])).tolist())
        result += test is not None and test.low <= 0.3 * STEPS <= test.high
    return result / BENCHMARKS


def certificate_coverage(kept: float, clean_rate: float, tasks: int, seeds: int) -> list[float]:
    """Return the shares of benchmarks whose certified retention is not above the true one.

    They are those of Clopper-Pearson (one condition, one seed), of Gaffke's bound over nine
    conditions with some seeds, and of a run of these that would end once a bound is above the true
    retention: 1 minus the error of the sequential test.
    """
    rng = np.random.default_rng(5)
    result = np.zeros(3)
    for _ in range(BENCHMARKS):
        solved = draw_tasks(rng, clean_rate, tasks)
        shares = np.stack([draw_tasks(rng, kept, tasks) for _ in range(CONDITIONS)])
        once = rng.random(tasks) < solved
        still = rng.random(tasks) < shares[0]  # of the tasks that were solved clean
        trials = int(once.sum())
        low = mean_bounds.clopper_pearson_lower(int((once & still).sum()), trials) if trials else 0
        clean = (rng.random((seeds, tasks)) < solved).astype(float)
        after = (rng.random((seeds, CONDITIONS, tasks)) < solved * shares).astype(float)
        before, corrupted = clean.mean(axis=0), after.mean(axis=(0, 1))
        bets = mean_bounds.BettingSequence(clean=before, corrupted=corrupted)
        gaffke = is_above = False
        if before.any():
            values = corrupted - kept * before
            gaffke = mean_bounds.mean_p_value(values, -kept) <= 0.05
            is_above = bets.stop(kept) is not None
        result += [low <= kept, not gaffke, not is_above]
    return (result / BENCHMARKS).tolist()


def certified(tasks: int, seeds: int, kept: float) -> list[float]:
    """Return the mean bounds of retention: Gaffke's, and that of betting."""
    rng = np.random.default_rng(6)
    total = np.zeros(2)
    for _ in range(CERTIFIED):
        solved = draw_tasks(rng, 0.95, tasks)
        shares = np.stack([draw_tasks(rng, kept, tasks) for _ in range(CONDITIONS)])
        clean = (rng.random((seeds, tasks)) < solved).mean(axis=0)
        after = (rng.random((seeds, CONDITIONS, tasks)) < solved * shares).mean(axis=(0, 1))
        bets = mean_bounds.BettingSequence(clean=clean, corrupted=after)
        total += [mean_bounds.gaffke_retention_bound(clean, after), bets.bound()]
    return (total / CERTIFIED).tolist()


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
        for index in [index for index, score in enumerate(scores) if not score][:4]:
            better = [*scores[:index], 1.0, *scores[index + 1 :]]
            after = statistics.mean_interval(better, names)
            fall = max(fall, before.low - after.low, before.high - after.high)
            if after.value > 0.5:
                growth = max(growth, (after.high - after.low) - (before.high - before.low))
    return 100 * fall, 100 * growth


def percent(shares: Sequence[float]) -> list[str]:
    return [f"{100 * share:.1f}" for share in shares]


def main() -> None:
    settings = SETTINGS
    heads = [f"{tasks} x {seeds}" for tasks, seeds in settings]
    print(machine())
    print(f"\nPercent of {BENCHMARKS:,} simulated benchmarks whose 95 % interval holds the truth;")
    print("a column is tasks x seeds.\n")
    rows = [
        [
            "success",
            f"{100 * rate:g} %",
            *percent([mean_coverage(rate, *setting) for setting in settings]),
        ]
        for rate in RATES
    ]
    for rate in CLEAN_RATES:
        for share in SHARES_KEPT:
            pairs = [pair_coverage(rate, share, *setting) for setting in settings]
            name = f"{100 * rate:g} % clean, {100 * share:g} % of it kept"
            rows.append(["difference", name, *percent([pair[0] for pair in pairs])])
            rows.append(["retention", name, *percent([pair[1] for pair in pairs])])
    for rate in (0.05, 0.5, 0.95):
        shares = [grand_mean_coverage(rate, *setting) for setting in settings]
        rows.append(["mean over 9", f"{100 * rate:g} %", *percent(shares)])
    steps = [steps_coverage(*setting) for setting in settings]
    rows.append(["steps (paired t)", "skewed, 30 % more", *percent(steps)])
    print(table(("interval of", "truth", *heads), rows))
    print("\nPercent of certificates (95 %, one-sided) whose bound is not above the truth:\n")
    rows = []
    methods = ("Clopper-Pearson, 1 x 1", "Gaffke, 9 conditions", "betting, looked at after each")
    for clean_rate in (0.95, 0.5):
        for share in KEPT:
            columns = [certificate_coverage(share, clean_rate, *setting) for setting in settings]
            for index, method in enumerate(methods):
                name = f"{100 * clean_rate:g} % clean, {100 * share:g} % of it kept"
                rows.append([method, name, *percent([column[index] for column in columns])])
    print(table(("method", "truth", *heads), rows))
    print("\nMean certified retention in percent, 95 % clean:\n")
    rows = []
    for share in KEPT:
        columns = [certified(*setting, share) for setting in settings]
        for index, method in enumerate(methods[1:]):
            rows.append(
                [method, f"{100 * share:g} % kept", *percent([column[index] for column in columns])]
            )
    print(table(("method", "truth", *heads), rows))
    ends = [falls(*setting) for setting in settings]
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
