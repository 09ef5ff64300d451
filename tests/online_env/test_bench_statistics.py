"""Statistics of the benchmark, against cases worked out by hand and the paper's own numbers."""

import math

import numpy as np
import pytest
from scipy.special import nctdtr, stdtr, stdtrit
from scipy.stats import binomtest, permutation_test

from hijack_data.errors import ParameterError
from online_env.results import statistics as s
from online_env.results.student_t import noncentral_cdf, quantile

# Paper, main table: Clean, then the nine corruptions, then the printed "Average"; in percent.
PAPER = {
    "GPT-4o": ((5.38, 1.44, 4.82, 2.56, 3.66, 3.68, 3.12, 4.82, 4.24, 3.25), 3.69),
    "Claude-3.7-Sonnet": ((4.23, 1.41, 2.54, 2.82, 2.54, 1.97, 2.54, 2.25, 1.69, 2.54), 2.45),
    "UI-TARS-7B-DPO": (
        (16.20, 13.09, 10.03, 13.41, 15.59, 13.85, 13.97, 13.61, 13.33, 8.31),
        13.14,
    ),
    "UI-TARS-1.5-7B": (
        (24.21, 10.28, 11.69, 23.31, 22.75, 19.25, 22.54, 20.84, 22.02, 10.48),
        18.74,
    ),
}


@pytest.mark.parametrize("agent", PAPER)
def test_the_papers_average_includes_clean(agent):
    columns, printed = PAPER[agent]
    result = s.paper_average({str(i): value for i, value in enumerate(columns)})
    # GPT-4o's mean is 3.697, which the paper prints as 3.69: cut off, not rounded.
    assert abs(result - printed) < (0.01 if agent == "GPT-4o" else 0.006)


def test_claudes_rates_are_whole_episodes_of_355():
    columns, _ = PAPER["Claude-3.7-Sonnet"]
    for value in columns:
        solved = round(value * 3.55)
        assert round(100 * solved / 355, 2) == value


def test_a_mean_over_episodes_of_different_tasks():
    result = s.mean_interval([1, 1, 0, 0, 1, 0], ["a", "a", "b", "b", "c", "c"])
    assert result.value == 0.5
    assert 0 <= result.low < 0.5 < result.high <= 1


def test_seeds_of_one_task_do_not_narrow_the_interval():
    few = s.mean_interval([1, 0, 1, 0], ["a", "b", "c", "d"])
    many = s.mean_interval([1, 0, 1, 0] * 50, ["a", "b", "c", "d"] * 50)
    assert (few.low, few.high) == (many.low, many.high)
    independent = s.mean_interval([1, 0, 1, 0] * 50, [str(i) for i in range(200)])
    assert independent.high - independent.low < (many.high - many.low) / 3


def test_the_interval_of_many_tasks_is_that_of_the_normal_approximation():
    scores = [1.0] * 120 + [0.0] * 280
    result = s.mean_interval(scores, list(range(400)))
    half = 1.96 * math.sqrt(0.3 * 0.7 / 400)
    assert result.value == pytest.approx(0.3)
    assert result.low == pytest.approx(0.3 - half, abs=0.006)
    assert result.high == pytest.approx(0.3 + half, abs=0.006)


@pytest.mark.parametrize(("score", "low", "high"), [(0.0, 0.0, 0.2775), (1.0, 0.7225, 1.0)])
def test_ten_of_ten_is_not_certainty(score, low, high):
    """Wilson's interval of 0 of 10 is 0 to 0.2775."""
    result = s.mean_interval([score] * 10, list(range(10)))
    assert (result.value, result.low, result.high) == (
        score,
        pytest.approx(low, abs=1e-4),
        pytest.approx(high, abs=1e-4),
    )


def test_a_paired_difference_cancels_what_the_conditions_share():
    """Two tasks of three are lost; easy and hard tasks alike."""
    clean, corrupted = [1, 1, 0, 1, 1, 0] * 10, [0, 1, 0, 0, 1, 0] * 10
    result = s.difference_interval(clean, corrupted, list(range(60)))
    assert result.value == pytest.approx(-1 / 3)
    assert -0.46 < result.low < result.value < result.high < -0.19


def test_no_difference_at_all_is_still_uncertain():
    result = s.difference_interval([1] * 20, [1] * 20, list(range(20)))
    assert result.value == 0
    assert result.low == -result.high < -0.1


def test_retention():
    result = s.retention_interval([1, 1, 1, 0], [1, 0, 1, 0], list("abcd"))
    assert result is not None
    assert result.value == pytest.approx(2 / 3)
    assert result.low <= result.value <= result.high
    assert s.retention_interval([0, 0], [1, 0], ["a", "b"]) is None


def test_equal_scores_are_equal_in_spite_of_rounding():
    """0.1 - 0.2, 0.3 - 0.4 and 0.9 - 1.0 differ in the last digit, and as tasks do not at all."""
    clean, corrupted, tasks = [0.2, 0.4, 1.0], [0.1, 0.3, 0.9], list("abc")
    assert len({after - before for before, after in zip(clean, corrupted, strict=True)}) > 1
    result = s.difference_interval(clean, corrupted, tasks)
    assert result.value == pytest.approx(-0.1)
    assert s.detectable_difference(clean, corrupted, tasks) is None


@pytest.mark.parametrize(("lost", "won"), [(0, 0), (5, 0), (8, 1), (3, 3), (40, 22)])
def test_by_task_is_mcnemars_test_where_each_task_has_one_case(lost, won):
    clean = [1] * lost + [0] * won + [1, 1, 0]
    corrupted = [0] * lost + [1] * won + [1, 1, 0]
    result = s.mcnemar_by_task(clean, corrupted, range(len(clean)))
    assert result == pytest.approx(binomtest(lost, lost + won).pvalue if lost else 1.0)


@pytest.mark.parametrize("seeds", [1, 2, 5])
def test_by_task_seeds_that_end_alike_prove_no_more_than_one(seeds):
    clean, corrupted, tasks = [1] * 6 + [0, 1], [0] * 6 + [1, 1], list("abcdefgh")
    result = s.mcnemar_by_task(clean * seeds, corrupted * seeds, tasks * seeds)
    assert result == pytest.approx(2 * (1 + 7) / 2**7)  # six lost, one won


def test_by_task_is_the_permutation_test_of_scipy():
    rng = np.random.default_rng(3)
    tasks = [f"t{number % 9}" for number in range(31)]  # three or four seeds of each
    for _ in range(20):
        clean, corrupted = rng.random((2, 31)) < [[0.7], [0.5]]
        sums = np.zeros(9)
        np.add.at(sums, np.arange(31) % 9, corrupted.astype(int) - clean.astype(int))
        expected = permutation_test(
            (sums,), np.sum, permutation_type="samples", n_resamples=np.inf
        ).pvalue
        result = s.mcnemar_by_task(clean.astype(float), corrupted.astype(float), tasks)
        assert result == pytest.approx(expected)


def test_a_partial_score_is_not_a_success():
    assert s.mcnemar_by_task([1] * 6, [0.5] * 6, range(6)) == 2 / 2**6


def test_holm_multiplies_the_smallest_by_their_number_and_never_decreases():
    result = s.holm({"marks": 0.01, "subtitle": 0.04, "pop_ups": 0.03})
    assert result == pytest.approx({"marks": 0.03, "subtitle": 0.06, "pop_ups": 0.06})
    assert s.holm({}) == {}


def test_more_tasks_show_smaller_differences():
    few = s.detectable_difference([1, 1, 1, 1] * 5, [0, 1, 1, 1] * 5, list(range(20)))
    many = s.detectable_difference([1, 1, 1, 1] * 50, [0, 1, 1, 1] * 50, list(range(200)))
    assert few is not None
    assert many is not None
    assert 0 < many < few / 2 < 0.5
    # a paired t test with 200 tasks shows 2.8 standard errors with a power of 80 %
    assert many == pytest.approx(2.8 * math.sqrt(0.25 * 0.75 / 200), rel=0.02)


@pytest.mark.parametrize("freedom", [1, 2, 7, 48, 368, 5000])
def test_student_t_is_scipys(freedom):
    assert quantile(0.975, freedom) == pytest.approx(float(stdtrit(freedom, 0.975)), rel=1e-10)
    for shift in (0.5, 2.8):
        for value in (-2.1, 1.97, 4.3):
            expected = float(nctdtr(freedom, shift, value))
            assert noncentral_cdf(value, freedom, shift) == pytest.approx(expected, abs=1e-10)
    fraction = freedom + 0.37
    assert noncentral_cdf(-4.0, fraction, 0.0) == pytest.approx(float(stdtr(fraction, -4.0)))


def test_no_power_without_spread():
    assert s.detectable_difference([1, 1, 1], [0, 0, 0], list("abc")) is None
    assert s.detectable_difference([1, 0], [0, 0], list("ab")) is None


def test_pass_hat_is_that_of_every_k():
    scores, tasks = [1, 1, 0, 1, 0, 0, 1, 1], ["a", "a", "a", "b", "b", "c", "c", "c"]
    solved = {"a": [True, True, False], "b": [True, False], "c": [False, True, True]}
    assert s.pass_hat(scores, tasks) == (s.pass_hat_k(solved, 1), s.pass_hat_k(solved, 2))


def test_pass_hat_k():
    outcomes = {"a": [True, True, False], "b": [True, True, True], "c": [True]}
    assert s.pass_hat_k(outcomes, 1) == pytest.approx((2 / 3 + 1 + 1) / 3)
    assert s.pass_hat_k(outcomes, 2) == pytest.approx((1 / 3 + 1) / 2)
    assert s.pass_hat_k(outcomes, 4) is None
    with pytest.raises(ParameterError, match="at least 1"):
        s.pass_hat_k(outcomes, 0)


def test_mean_corruption_error():
    result = s.mean_corruption_error({"marks": 0.5, "lock": 0.9}, {"marks": 1.0, "lock": 0.6})
    assert result == pytest.approx((0.5 + 1.5) / 2)
    assert s.mean_corruption_error({"marks": 0.5}, {"marks": 0.0}) is None
    with pytest.raises(ParameterError, match="same corruptions"):
        s.mean_corruption_error({"marks": 0.5}, {"lock": 0.5})


@pytest.mark.parametrize(
    "call",
    [
        lambda: s.mean_interval([], []),
        lambda: s.mean_interval([1], ["a", "b"]),
        lambda: s.difference_interval([1], [1, 0], ["a", "b"]),
        lambda: s.mcnemar_by_task([1], [], ["a"]),
        lambda: s.paper_average({}),
    ],
)
def test_what_cannot_be_summarised(call):
    with pytest.raises(ParameterError):
        call()
