"""Measures beside success, equivalence, severity curves and the size of a sample."""

import numpy as np
import pytest

pytest.importorskip("scipy", reason="needs the extra [online]")
pytest.importorskip("gymnasium", reason="needs the extra [online]")

from scipy import stats

from hijack_data.corruption import find_corruption
from online_env.bench.config import load_bench
from online_env.bench.estimates import read_history
from online_env.bench.sample_size import loss_variance, sample_size_lines, tasks_needed
from online_env.report.build import build_report
from online_env.report.document import ReportDocument
from online_env.report.model import from_data
from online_env.report.tables import as_markdown
from online_env.results import statistics

from support.reported import made, read_run, run_of, scored


def spent(label, steps, seed=0, score=1.0):
    usage = {"requests": 1, "input_tokens": 100, "output_tokens": 20, "usd": 0.1}
    return [
        made("a", f"t{number}", label, score, seed, steps=int(count), usage=usage)
        for number, count in enumerate(steps)
    ]


def test_steps_and_tokens_have_scipys_paired_interval_and_holm_by_measure(tmp_path):
    rng = np.random.default_rng(0)
    clean, marks, pop_ups = rng.integers(2, 20, (3, 24))
    items = [*spent("clean", clean), *spent("marks", marks), *spent("pop_ups", pop_ups)]
    items += [*spent("clean", clean, 1), *spent("marks", marks + 2, 1)]
    report = build_report(read_run(tmp_path / "run", items, seeds=[0, 1]))
    rows = {(row.corruption, row.measure): row for row in report.measures}
    assert set(rows) == {
        (label, name)
        for label in ("marks", "pop_ups")
        for name in ("steps", "seconds", "tokens", "usd")
    }
    tests = [stats.ttest_rel(marks + 1, clean), stats.ttest_rel(pop_ups, clean)]
    interval = tests[0].confidence_interval()
    row = rows["marks", "steps"]
    assert (row.tasks, row.mean_clean) == (24, pytest.approx(clean.mean()))
    assert (row.change_low, row.change_high) == pytest.approx((interval.low, interval.high))
    adjusted = statistics.holm({"marks": tests[0].pvalue, "pop_ups": tests[1].pvalue})
    assert row.p == pytest.approx(adjusted["marks"])
    assert rows["pop_ups", "steps"].p == pytest.approx(adjusted["pop_ups"])
    assert rows["marks", "tokens"].mean_clean == 120
    assert rows["marks", "usd"].change_low is None  # all tasks differ by nothing
    assert from_data(report.to_data(), "here") == report
    assert "| a | marks | steps | 24 |" in as_markdown(ReportDocument(report=report))


@pytest.mark.parametrize("lost", [0, 1, 4])
def test_equivalence_is_scipys_binomial_test_where_tasks_are_only_lost(tmp_path, lost):
    scores = [0.0] * lost + [1.0] * (100 - lost)
    items = [*scored("a", "clean", [1.0] * 100), *scored("a", "marks", scores)]
    report = build_report(read_run(tmp_path / "run", items), margin=0.1)
    (row,) = report.equivalences
    expected = stats.binomtest(100 - lost, 100, 0.9, alternative="greater").pvalue
    assert (row.margin, row.loss, row.p) == pytest.approx((0.1, lost / 100, expected))


def test_a_curve_has_the_area_over_five_severities(tmp_path):
    marks = find_corruption("marks")
    levels = {f"marks_{level}": marks.at(level).params() for level in range(1, 6)}
    corruptions = ["clean", *({"marks": {"as": name, **value}} for name, value in levels.items())]
    items = []
    for agent, least in (("a", 5), ("b", 3)):
        items += scored(agent, "clean", [1.0] * 20)
        for level, name in enumerate(levels, 1):
            items += scored(
                agent, name, [float(number >= least * level // 2) for number in range(20)]
            )
    run = read_run(tmp_path / "run", items, corruptions=corruptions)
    first, second = build_report(run, reference="b").curves
    success = [1 - 5 * level // 2 / 20 for level in range(1, 6)]
    assert (first.agent, first.corruption, first.levels) == ("a", "marks", (1, 2, 3, 4, 5))
    assert first.success == pytest.approx(success)
    assert (first.area, first.delta) == pytest.approx((np.mean(success), np.mean(success) - 1))
    assert first.area_low < first.area < first.area_high
    errors = [sum(least * level // 2 for level in range(1, 6)) for least in (5, 3)]
    assert (first.ce, second.ce) == pytest.approx((errors[0] / errors[1], 1))
    # The mCE of Hendrycks and Dietterich adds up the severities of a corruption first.
    assert build_report(run, reference="b").summaries[0].mce == pytest.approx(first.ce)
    part = read_run(
        tmp_path / "part",
        [record for record in items if record["corruption"] != "marks_2"],
        corruptions=corruptions,
    )
    (curve, _) = build_report(part).curves
    assert (curve.levels, curve.area) == ((1, 3, 4, 5), None)


def test_the_number_of_tasks_has_the_power_by_scipys_distribution():
    level, spread, loss = 1 - 0.05 / 9, 0.4, 0.05
    tasks = tasks_needed(loss, spread, level)
    power = []
    for count in (tasks - 1, tasks):
        limit = stats.t.ppf((1 + level) / 2, count - 1)
        shift = loss / spread * count**0.5
        power.append(
            stats.nct.sf(limit, count - 1, shift) + stats.nct.cdf(-limit, count - 1, shift)
        )
    assert power[0] < 0.8 <= power[1]


def test_a_plan_tells_tasks_from_seeds_by_earlier_runs(tmp_path):
    rng = np.random.default_rng(3)
    hard = rng.random(300) < 0.3  # tasks that the corruption always breaks, beside chance by seed
    items = []
    for seed in range(3):
        items += scored("oracle", "clean", [1.0] * 300, seed)
        lost = hard | (rng.random(300) < 0.2)
        items += scored("oracle", "marks", (~lost).astype(float).tolist(), seed)
    run_of(tmp_path / "earlier", items, seeds=[0, 1, 2])
    history = read_history([tmp_path / "earlier"])
    variance = loss_variance(history, "oracle", ["marks"])
    assert variance.within == pytest.approx(0.7 * 0.2 * 0.8, rel=0.15)
    assert variance.between == pytest.approx(0.3 * 0.7 * 0.8**2, rel=0.2)
    lines = list(sample_size_lines(load_bench("embedded_small"), 5, history, 2))
    assert "of tasks differ as in earlier runs under marks" in lines[1]
    tasks = [int(line.split()[0].replace(",", "")) for line in lines[2:6]]
    assert tasks == sorted(tasks, reverse=True)
    assert "episodes, about" in lines[2]
    (_, unknown, *_) = sample_size_lines(load_bench("embedded_small"), 5, read_history([]), 2)
    assert "no earlier run here, so success of 50 % is assumed" in unknown
