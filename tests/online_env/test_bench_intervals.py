"""Intervals and tests of a benchmark, against values that are computed another way."""

import itertools
import math

import numpy as np
import pytest

pytest.importorskip("scipy", reason="needs the extra [online]")

from scipy import special, stats

from hijack_data.errors import ParameterError
from online_env.results import scores
from online_env.results import statistics as s
from online_env.results.exact_bounds import exact_lower_end

from support.reported import scored

LEVELS = [0.5, 0.9, 0.95, 0.99]


def wilson(successes, trials, level=0.95):
    """Wilson's interval, by scipy."""
    result = stats.binomtest(successes, trials).proportion_ci(level, method="wilson")
    return pytest.approx((result.low, result.high))


def ends(interval):
    return interval.low, interval.high


def wider(successes, trials, level=0.95):
    """The wider of Wilson's ends and the exact one-sided ones, by scipy."""
    ends = stats.binomtest(successes, trials).proportion_ci(level, method="wilson")
    above, below = (
        stats.binomtest(successes, trials, alternative=side).proportion_ci(level, "exact")
        for side in ("greater", "less")
    )
    return pytest.approx((min(ends.low, above.low), max(ends.high, below.high)))


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("solved", [0, 1, 12, 23, 24])
def test_one_method_from_no_success_to_all(solved, level):
    """At 0 and 100 % it is Wilson's, or wider near them; seeds that end alike add nothing."""
    outcomes = [1.0] * solved + [0.0] * (24 - solved)
    tasks = list(range(24))
    once = s.mean_interval(outcomes, tasks, level=level)
    assert ends(once) == wider(solved, 24, level)
    assert ends(s.mean_interval(outcomes * 3, tasks * 3, level=level)) == wider(solved, 24, level)
    grand = s.grand_mean_interval([(outcomes, tasks)] * 4, level=level)
    assert ends(grand) == wider(solved, 24, level)
    if solved in (0, 24) and level > 0.5:
        assert ends(once) == wilson(solved, 24, level)


@pytest.mark.parametrize("tasks", [12, 24, 122])
def test_every_rate_near_0_and_1_is_held_as_often_as_promised(tasks):
    """Exact coverage, not simulated; Wilson's is 84 % at its worst."""
    intervals = [
        s.mean_interval([1.0] * solved + [0.0] * (tasks - solved), range(tasks))
        for solved in range(tasks + 1)
    ]
    for rate in np.linspace(0.001, 0.999, 999):
        holds = [interval.low <= rate <= interval.high for interval in intervals]
        coverage = stats.binom.pmf(np.arange(tasks + 1), tasks, rate) @ holds
        assert coverage >= (0.95 if min(rate, 1 - rate) * tasks < 0.35 else 0.915), rate


def test_the_exact_bound_is_scipys():
    rng = np.random.default_rng(0)
    for _ in range(500):
        tasks, successes = rng.uniform(5, 500), np.exp(rng.uniform(-3, np.log(30)))
        failures = max(0.0, tasks - successes)
        exact = special.betaincinv(successes, failures + 1, 0.05)
        low = min(0.999, exact * rng.uniform(0.9, 1.5))
        expected = pytest.approx(min(low, exact), rel=1e-8, abs=1e-12)
        assert exact_lower_end(successes, failures, 0.95, low) == expected


def test_a_better_result_has_no_lower_interval():
    """Also next to 100 %, where the seeds of one task differ and those of all others agree."""
    tasks = [number for number in range(24) for _ in range(3)]
    values = [s.mean_interval([1.0] * n + [0.0] * (72 - n), tasks) for n in range(73)]
    for worse, better in itertools.pairwise(values):
        assert worse.low <= better.low + 0.002
        assert worse.high <= better.high + 0.002
    assert values[71].high - values[71].low == pytest.approx(0.138, abs=0.01)
    assert values[72].high - values[72].low == pytest.approx(0.138, abs=0.001)


def test_seeds_that_end_independently_narrow_an_interval_but_not_to_that_of_as_many_tasks():
    rng = np.random.default_rng(2)
    outcomes = (rng.random((24, 8)) < 0.5).astype(float).ravel().tolist()
    tasks = [number for number in range(24) for _ in range(8)]
    result = s.mean_interval(outcomes, tasks)
    least, highest = (
        s.mean_interval(outcomes, list(range(192))),
        s.mean_interval([1, 0] * 12, range(24)),
    )
    width = result.high - result.low
    assert least.high - least.low < width < (highest.high - highest.low) / 1.5


def test_tasks_with_more_episodes_count_for_less_than_as_many_tasks():
    even = s.mean_interval([1, 0] * 6, range(12))
    uneven = s.mean_interval([1, 0] * 6 + [1] * 24, [*range(12), *[0] * 24])
    assert uneven.value == pytest.approx(30 / 36)
    assert uneven.high - uneven.low > even.high - even.low


def test_a_loss_of_nothing_is_as_uncertain_as_the_clean_success():
    tasks = range(20)
    unseen = 1 - s.mean_interval([1] * 20, tasks).low
    assert ends(s.difference_interval([1] * 20, [1] * 20, tasks)) == pytest.approx(
        (-unseen, unseen)
    )
    retention = s.retention_interval([1] * 20, [1] * 20, tasks)
    assert retention.low == pytest.approx(1 - unseen)
    assert 1 < retention.high < 1 + 1.3 * unseen


def test_a_pair_of_conditions_that_go_together_is_compared_more_closely():
    """Newcombe's interval for paired rates, by its correlation."""
    tasks = range(40)
    clean = [1.0] * 20 + [0.0] * 20
    together = [1.0] * 15 + [0.0] * 25
    apart = [0.0] * 20 + [1.0] * 15 + [0.0] * 5
    near, far = (s.difference_interval(clean, after, tasks) for after in (together, apart))
    assert near.value == far.value == -0.125
    assert near.high - near.low < 0.6 * (far.high - far.low)
    retention, second = (s.retention_interval(clean, after, tasks) for after in (together, apart))
    assert retention.value == second.value == 0.75
    assert retention.high - retention.low < 0.6 * (second.high - second.low)


@pytest.mark.parametrize("seeds", [1, 3])
@pytest.mark.parametrize("rate", [0.05, 0.5, 0.95])
def test_intervals_hold_the_truth_as_often_as_they_say(rate, seeds):
    """Of 300 benchmarks of 24 tasks."""
    rng = np.random.default_rng(0)
    tasks = [number for number in range(24) for _ in range(seeds)]
    result = 0
    for _ in range(300):
        easy = rng.beta(rate, 1 - rate, 24) if seeds > 1 else np.full(24, rate)
        scores = (rng.random((24, seeds)) < easy[:, None]).astype(float).ravel().tolist()
        value = s.mean_interval(scores, tasks)
        result += value.low <= rate <= value.high
    assert result >= 0.92 * 300


@pytest.mark.parametrize(("power", "level"), [(0.5, 0.95), (0.8, 0.9), (0.95, 0.99)])
def test_the_detectable_difference_has_the_power_and_the_level_that_are_asked_for(power, level):
    corrupted = [1.0, 0.0, 1.0, 1.0, 1.0] * 10
    result = s.detectable_difference(
        [1.0] * 50, corrupted, list(range(50)), power=power, level=level
    )
    shift = result / stats.tstd(corrupted) * 50**0.5
    limit = stats.t.ppf((1 + level) / 2, 49)
    calls = stats.nct.sf(limit, 49, shift) + stats.nct.cdf(-limit, 49, shift)
    assert calls == pytest.approx(power, abs=1e-3)


def test_the_detectable_difference_counts_tasks_and_not_their_seeds():
    clean = [1.0, 1.0, 1.0, 1.0, 0.0] * 4
    corrupted = [0.0, 1.0, 0.0, 1.0, 0.0] * 4
    tasks = list(range(20))
    once = s.detectable_difference(clean, corrupted, tasks)
    assert s.detectable_difference(clean * 5, corrupted * 5, tasks * 5) == pytest.approx(once)


def test_no_difference_between_rates_is_greater_than_one():
    result = s.detectable_difference([1, 0, 1], [0, 1, 1], list("abc"))
    assert result == 1.0


def test_holms_method_is_that_of_its_definition():
    scores = np.random.default_rng(5).random(12) ** 3
    tests = {f"c{number}": float(value) for number, value in enumerate(scores)}
    expected = {}
    least = 0.0
    for rank, name in enumerate(sorted(tests, key=tests.get)):
        least = max(least, min(1.0, (12 - rank) * tests[name]))
        expected[name] = least
    outcome = s.holm(tests)
    assert outcome == pytest.approx(expected)
    assert list(outcome) == list(tests)
    assert max(outcome.values()) <= 1


@pytest.mark.parametrize("tasks", [3, 12, 122])
def test_holm_and_power_are_those_of_statsmodels(tasks):
    power = pytest.importorskip("statsmodels.stats.power")
    multitest = pytest.importorskip("statsmodels.stats.multitest")
    tests = {f"c{n}": float(p) for n, p in enumerate(np.random.default_rng(1).random(9) ** 4)}
    adjusted = multitest.multipletests(list(tests.values()), method="holm")[1]
    assert list(s.holm(tests).values()) == pytest.approx(list(adjusted))
    differences = [float(number % 3 == 0) for number in range(tasks)]
    result = s.detectable_difference([1.0] * tasks, differences, list(range(tasks)))
    effect = power.TTestPower().solve_power(nobs=tasks, alpha=0.05, power=0.8)
    spread = np.std(differences, ddof=1)
    assert result == pytest.approx(min(1.0, effect * spread), rel=1e-6)


def test_p_values_are_adjusted_for_the_corruptions_of_one_agent_and_not_of_all():
    """Who plays beside an agent does not change what is found about it."""
    items = [*scored("a", "clean", [1.0] * 6), *scored("a", "marks", [0.0] * 6)]
    alone = {row["corruption"]: row["p"] for row in scores.rows(items)}
    remaining = [
        record
        for agent in ("b", "c")
        for label, outcome in (("clean", 1.0), ("marks", 0.0), ("lock", 0.0))
        for record in scored(agent, label, [outcome] * 6)
    ]
    beside = scores.rows([*items, *remaining])
    assert {row["corruption"]: row["p"] for row in beside if row["agent"] == "a"} == alone
    assert alone["marks"] == pytest.approx(2 / 2**6)
    (clean, *corrupted) = [row["p"] for row in beside if row["agent"] == "b"]
    assert (clean, corrupted) == (None, pytest.approx([4 / 2**6] * 2))


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: s.mean_interval([], []), "there are no episodes to summarise"),
        (lambda: s.mean_interval([1], ["a", "b"]), "1 scores for 2 tasks: give one for each"),
        (
            lambda: s.retention_interval([1], [1, 0], ["a"]),
            "scores must come in pairs, got 1 clean and 2 corrupted scores",
        ),
        (lambda: s.retention_interval([], [], []), "there are no episodes to summarise"),
        (
            lambda: s.mean_interval([float("nan"), 1], ["a", "b"]),
            "the score of task 'a' is nan; scores are numbers from 0 to 1",
        ),
        (
            lambda: s.retention_interval([1, 0], [1, 1.5], ["a", "b"]),
            "the score of task 'b' is 1.5; scores are numbers from 0 to 1",
        ),
        (
            lambda: s.mcnemar_by_task([1, -1], [1, 1], ["a", "b"]),
            "the score of task 'b' is -1; scores are numbers from 0 to 1",
        ),
        (
            lambda: s.detectable_difference([1, math.inf], [1, 1], ["a", "b"]),
            "the score of task 'b' is inf; scores are numbers from 0 to 1",
        ),
        (lambda: s.grand_mean_interval([]), "there are no cells to average"),
        (lambda: s.grand_mean_interval([([], [])]), "there are no episodes to summarise"),
        (
            lambda: s.detectable_difference([1, 0], [1, 0], ["a"]),
            "2 scores for 1 tasks: give one for each",
        ),
        (
            lambda: s.mean_corruption_error({}, {}),
            "mCE compares the same corruptions of two agents, got [] and []",
        ),
        (lambda: s.pass_hat_k({}, 0), "k must be at least 1, got 0"),
        (lambda: s.paper_average({}), "there is no success rate to average"),
    ],
)
def test_what_cannot_be_summarised_says_why(call, said):
    with pytest.raises(ParameterError) as error:
        call()
    assert str(error.value) == said
