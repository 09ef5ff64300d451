"""Intervals and tests of a benchmark, against exact distributions that are computed another way."""

import gc
import itertools
import math
from statistics import fmean

import numpy as np
import pytest

pytest.importorskip("statsmodels", reason="needs the extra [online]")

from scipy import stats

from hijack_data.errors import ParameterError
from online_env.bench import resampling, scores
from online_env.bench import statistics as s

from support.reported import scored

# Four tasks with one to three episodes each: clean scores, and those under a corruption.
TASKS = ("a", "b", "b", "c", "c", "c", "d")
CLEAN = (1.0, 1.0, 0.0, 0.0, 0.0, 0.5, 1.0)
CORRUPTED = (0.0, 1.0, 0.5, 0.0, 0.25, 0.0, 0.75)
# 9,999 resamples find the quantiles of the exact distribution but for this much.
NOISE = 0.01


def every_resample():
    """All draws of four tasks from four, each equally likely: what the bootstrap samples from."""
    return itertools.product("abcd", repeat=4)


def total(values, drawn):
    """The sum of the values of the episodes that the drawn tasks have."""
    return sum(
        value for task in drawn for name, value in zip(TASKS, values, strict=True) if name == task
    )


def check_quantile(exact, end, share):
    """Check that as large a share of the exact values as it should lies below an end."""
    below = fmean(value < end - 1e-9 for value in exact)
    up_to = fmean(value <= end + 1e-9 for value in exact)
    assert below - NOISE <= share <= up_to + NOISE


@pytest.mark.parametrize("level", [0.5, 0.8, 0.95])
def test_a_mean_over_tasks_of_different_sizes_has_the_quantiles_of_all_resamples(level):
    ones = [1.0] * len(TASKS)
    exact = [total(CLEAN, drawn) / total(ones, drawn) for drawn in every_resample()]
    found = s.mean_interval(CLEAN, TASKS, level=level)
    assert found.value == 0.5
    check_quantile(exact, found.low, (1 - level) / 2)
    check_quantile(exact, found.high, (1 + level) / 2)


@pytest.mark.parametrize("level", [0.5, 0.8, 0.95])
def test_a_difference_has_the_quantiles_of_all_resamples(level):
    ones = [1.0] * len(TASKS)
    changes = [after - before for before, after in zip(CLEAN, CORRUPTED, strict=True)]
    exact = [total(changes, drawn) / total(ones, drawn) for drawn in every_resample()]
    found = s.difference_interval(CLEAN, CORRUPTED, TASKS, level=level)
    assert found.value == pytest.approx(-1 / 7)
    check_quantile(exact, found.low, (1 - level) / 2)
    check_quantile(exact, found.high, (1 + level) / 2)


@pytest.mark.parametrize("level", [0.3, 0.5, 0.95])
def test_a_retention_has_the_quantiles_of_all_resamples_and_may_have_no_upper_end(level):
    """Resamples without clean success are those in which nothing bounds the ratio."""
    before = (0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0)
    exact = [
        total(CORRUPTED, drawn) / total(before, drawn) if total(before, drawn) else math.inf
        for drawn in every_resample()
    ]
    found = s.retention_interval(before, CORRUPTED, TASKS, level=level)
    assert found.value == 1.25
    assert math.isinf(found.high) == (level > 0.4)  # 31.6 % of them lack task b
    check_quantile(exact, found.low, (1 - level) / 2)
    check_quantile(exact, found.high, (1 + level) / 2)


def test_a_mean_over_cells_leaves_a_cell_out_of_the_resamples_that_lack_it():
    """The second cell has episodes of one task alone."""
    ones = [1.0] * len(TASKS)
    exact = []
    for drawn in every_resample():
        means = [total(CLEAN, drawn) / total(ones, drawn)]
        if "b" in drawn:
            means.append(0.25)
        exact.append(fmean(means))
    found = s.grand_mean_interval([(CLEAN, TASKS), ([0.25], ["b"])])
    assert found.value == pytest.approx((0.5 + 0.25) / 2)
    check_quantile(exact, found.low, 0.025)
    check_quantile(exact, found.high, 0.975)


@pytest.mark.parametrize(
    ("tasks", "level"),
    [(40, 0.5), (40, 0.9), (40, 0.99), (520, 0.95)],  # resamples of many tasks are not kept
)
def test_ends_are_those_of_the_binomial_distribution(tasks, level):
    """With an episode a task, the solved ones of a resample are binomially distributed."""
    solved = 3 * tasks // 10
    outcomes = [1.0] * solved + [0.0] * (tasks - solved)
    found = s.mean_interval(outcomes, list(range(tasks)), level=level)
    low, high = stats.binom.interval(level, tasks, 0.3)
    assert tasks * found.low == pytest.approx(low, abs=1 + tasks / 300)
    assert tasks * found.high == pytest.approx(high, abs=1 + tasks / 300)


def test_tasks_that_are_too_many_to_keep_their_resamples_have_the_same_intervals(monkeypatch):
    outcomes = [float(number % 3 == 0) for number in range(60)]
    kept = s.mean_interval(outcomes, list(range(60)))
    monkeypatch.setattr(resampling, "KEPT", 0)
    assert s.mean_interval(outcomes, list(range(60))) == kept


@pytest.mark.parametrize("level", [0.5, 0.9, 0.99])
def test_tasks_that_agree_have_wilsons_width_at_any_level(level):
    square = stats.norm.ppf((1 + level) / 2) ** 2
    width = square / (8 + square)
    found = s.mean_interval([1.0] * 8, list(range(8)), level=level)
    assert (found.low, found.high) == (pytest.approx(1 - width), 1)
    change = s.difference_interval([0.0] * 8, [1.0] * 8, list(range(8)), level=level)
    assert (change.low, change.high) == (pytest.approx(1 - width), 1)
    loss = s.difference_interval([1.0] * 8, [0.0] * 8, list(range(8)), level=level)
    assert (loss.low, loss.high) == (-1, pytest.approx(width - 1))
    grand = s.grand_mean_interval([([1.0] * 8, list(range(8)))] * 2, level=level)
    assert (grand.low, grand.high) == (pytest.approx(1 - width), 1)


def test_another_seed_draws_other_resamples():
    values = np.random.default_rng(3).random(30).tolist()
    found = [s.mean_interval(values, list(range(30)), seed=seed) for seed in (0, 1, 2)]
    assert len({interval.low for interval in found}) == 3
    assert len({interval.value for interval in found}) == 1
    assert max(abs(one.low - found[0].low) for one in found) < 0.03


def test_many_cells_at_once_keep_their_order_and_their_intervals():
    """More than are computed in one go, and among them some that need no resampling."""
    cells = []
    for number in range(130):
        tasks = 8 if number % 10 else 7
        outcomes = [float((number >> bit) & 1) for bit in range(tasks)]
        cells.append((outcomes, list(range(tasks))))
    found = s.mean_intervals(cells)
    assert [each.value for each in found] == [fmean(outcomes) for outcomes, _ in cells]
    for place in (0, 1, 99, 100, 111, 120, 127, 129):
        assert found[place] == s.mean_interval(*cells[place])
    pairs = [([1.0] * len(tasks), outcomes, tasks) for outcomes, tasks in cells]
    # Where all is solved clean, retention is success.
    assert [each.value for each in s.retention_intervals(pairs)] == [each.value for each in found]
    assert s.mean_intervals([]) == []


@pytest.mark.parametrize(("power", "level"), [(0.5, 0.95), (0.8, 0.9), (0.95, 0.99)])
def test_the_detectable_difference_has_the_power_and_the_level_that_are_asked_for(power, level):
    corrupted = [1.0, 0.0, 1.0, 1.0, 1.0] * 10
    found = s.detectable_difference(
        [1.0] * 50, corrupted, list(range(50)), power=power, level=level
    )
    shift = found / stats.tstd(corrupted) * 50**0.5
    limit = stats.t.ppf((1 + level) / 2, 49)
    seen = stats.nct.sf(limit, 49, shift) + stats.nct.cdf(-limit, 49, shift)
    assert seen == pytest.approx(power, abs=1e-3)


def test_the_detectable_difference_counts_tasks_and_not_their_seeds():
    clean = [1.0, 1.0, 1.0, 1.0, 0.0] * 4
    corrupted = [0.0, 1.0, 0.0, 1.0, 0.0] * 4
    tasks = list(range(20))
    once = s.detectable_difference(clean, corrupted, tasks)
    assert s.detectable_difference(clean * 5, corrupted * 5, tasks * 5) == pytest.approx(once)


def test_no_difference_between_rates_is_greater_than_one():
    found = s.detectable_difference([1, 0, 1], [0, 1, 1], list("abc"))
    assert found == 1.0


def test_holms_method_is_that_of_its_definition():
    drawn = np.random.default_rng(5).random(12) ** 3
    tests = {f"c{number}": float(value) for number, value in enumerate(drawn)}
    wanted = {}
    least = 0.0
    for rank, name in enumerate(sorted(tests, key=tests.get)):
        least = max(least, min(1.0, (12 - rank) * tests[name]))
        wanted[name] = least
    found = s.holm(tests)
    assert found == pytest.approx(wanted)
    assert list(found) == list(tests)
    assert max(found.values()) <= 1


def test_memory_can_be_reclaimed_after_holms_method():
    """While statsmodels collects garbage, all that is there is kept out of its way."""
    s.holm({"marks": 0.01, "lock": 0.5})
    assert gc.get_freeze_count() == 0
    with pytest.raises(TypeError):
        s.holm({"marks": None, "lock": 0.5})
    assert gc.get_freeze_count() == 0


def test_p_values_are_adjusted_for_the_corruptions_of_one_agent_and_not_of_all():
    """Who plays beside an agent does not change what is found about it."""
    found = [*scored("a", "clean", [1.0] * 6), *scored("a", "marks", [0.0] * 6)]
    alone = {row["corruption"]: row["p"] for row in scores.rows(found)}
    others = [
        record
        for agent in ("b", "c")
        for label, outcome in (("clean", 1.0), ("marks", 0.0), ("lock", 0.0))
        for record in scored(agent, label, [outcome] * 6)
    ]
    beside = scores.rows([*found, *others])
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
