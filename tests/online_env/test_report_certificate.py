"""A certificate of a run: its bound, its fields, and a run that ends once it is reached."""

import itertools
import json
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip("scipy", reason="needs the extra [online]")
pytest.importorskip("gymnasium", reason="needs the extra [online]")

from scipy import stats

from hijack_data.cli import main
from hijack_data.errors import HijackError, ParameterError
from hijack_data.runs.run_log import draw_task_order
from online_env.bench import runner
from online_env.bench.config import Bench, all_planners, end_at_retention
from online_env.bench.jobs import jobs
from online_env.report.certificate import CertificateError, certificate_problems, certify
from online_env.report.notes import early_end_note
from online_env.results import mean_bounds as bounds
from online_env.results import reading, records
from online_env.results.outcomes import collect_run
from online_env.results.record_score import first_id
from online_env.results.stop_rule import SequentialTest, StopRule, settle_bets
from pipelines.proof.rebuild import rebuild

from support.recorded import AGENT, PLANNERS, Episodes, Silent, Straw, config, no_machine
from support.reported import made, read_run, scored


def certificate_of(folder, found, **config):
    return certify(read_run(folder, found, **config))


def two_conditions(clean, marks, **more):
    return [*scored("a", "clean", clean, **more), *scored("a", "marks", marks, **more)]


# The bounds


@pytest.mark.parametrize(("kept", "trials"), [(1, 1), (12, 12), (11, 12), (3, 24), (340, 369)])
def test_with_one_outcome_a_task_gaffke_is_clopper_and_pearson_as_scipy_has_it(kept, trials):
    low = stats.binomtest(kept, trials, alternative="greater").proportion_ci(0.95, "exact").low
    assert bounds.clopper_pearson_lower(kept, trials) == pytest.approx(low)
    outcomes = np.repeat([1.0, 0.0], [kept, trials - kept])
    found_again = bounds.gaffke_retention_bound(np.ones(trials), outcomes)
    assert found_again == pytest.approx(low, abs=2e-7)
    p = bounds.mean_p_value(outcomes - 0.8, -0.8)
    assert p == pytest.approx(stats.binomtest(kept, trials, 0.8, alternative="greater").pvalue)


def test_gaffkes_p_value_is_that_of_drawn_weights():
    rng = np.random.default_rng(0)
    values = rng.uniform(-0.3, 0.4, 24)
    draws = rng.standard_exponential((400_000, 25)) @ np.append(values, -0.5)
    assert bounds.mean_p_value(values, -0.5) == pytest.approx(np.mean(draws <= 0), abs=0.003)


def test_the_bets_are_walds_likelihood_ratios():
    """With outcomes 0 and 1 a bet is the ratio of two binomial likelihoods (Wald 1945)."""
    kept, trials, ratio = 20, 24, 0.6
    outcomes = np.repeat([1.0, 0.0], [kept, trials - kept])
    bets = bounds.BettingSequence(clean=np.ones(trials), corrupted=outcomes)
    likely = stats.binom.pmf(kept, trials, ratio + bounds.BETS * (1 - ratio))
    expected = np.mean(likely / stats.binom.pmf(kept, trials, ratio))
    assert bets.fortunes(ratio)[-1] == pytest.approx(expected)
    fortune_without_loss = np.mean([(1 + b * 0.25) ** 30 for b in bounds.BETS])
    assert bounds.BettingSequence(clean=np.ones(30), corrupted=np.ones(30)).fortunes(0.8)[
        -1
    ] == pytest.approx(fortune_without_loss)


def test_looking_after_every_task_errs_no_more_often_than_promised():
    rng = np.random.default_rng(1)
    wrong = 0
    for _ in range(400):
        clean = (rng.random(122) < 0.7).astype(float)
        corrupted = clean * (rng.random(122) < 0.8)
        bets = bounds.BettingSequence(clean=clean, corrupted=corrupted)
        wrong += bets.stop(0.8) is not None
    assert 0 < wrong <= 0.05 * 400  # 0.05 is the promise; without a bet it would be 0


# The file


def test_the_method_follows_from_the_design(tmp_path):
    clean, marks = [1.0] * 20 + [0.0] * 4, [1.0] * 18 + [0.0] * 5 + [1.0]
    once = certificate_of(tmp_path / "once", two_conditions(clean, marks))
    exact = stats.binomtest(18, 20, alternative="greater").proportion_ci(0.95, "exact").low
    assert (once.method, once.tasks, once.episodes) == ("clopper-pearson", 24, 48)
    assert exact - 1e-4 < once.retention_at_least <= exact
    assert once.retention == pytest.approx(19 / 20)  # with the one that only the corrupted solved
    seeds = [*two_conditions(clean, marks), *two_conditions(clean, marks, seed=1)]
    twice = certify(read_run(tmp_path / "twice", seeds, seeds=[0, 1]))
    assert (twice.method, twice.tasks, twice.seeds) == ("gaffke", 24, (0, 1))
    assert exact - 1e-4 < twice.retention_at_least < 0.9  # seeds that end alike add nothing
    partial = certificate_of(tmp_path / "partial", two_conditions(clean, [0.5] * 24))
    assert (partial.method, partial.retention_at_least < 0.6) == ("gaffke", True)


def test_weights_declare_the_distribution(tmp_path):
    items = [
        *two_conditions([1.0] * 30, [1.0] * 30),
        *scored("a", "pop_ups", [0.0] * 30),
        *scored("b", "clean", [1.0] * 30),
    ]
    corruptions = ["clean", {"marks": {"number": 10}}, "pop_ups"]
    run = read_run(tmp_path / "run", items, corruptions=corruptions)
    with pytest.raises(CertificateError, match="--agent a or b"):
        certify(run)
    even = certify(run, agent="a")
    assert [entry.weight for entry in even.distribution] == [0.5, 0.5]
    assert even.retention == pytest.approx(0.5)
    alone = certify(run, agent="a", weights={"marks": 3})
    assert (alone.retention, alone.conditions_left_out) == (1.0, ("pop_ups",))
    assert alone.distribution[0].parameters == {"number": 10}
    with pytest.raises(HijackError, match="no condition 'mark'; did you mean"):
        certify(run, agent="a", weights={"mark": 1})
    with pytest.raises(HijackError, match="a share below 1e-9 is none"):
        certify(run, agent="a", weights={"marks": 1, "pop_ups": 1e-12})


def test_what_has_no_score_is_refused_or_lost_as_asked(tmp_path):
    result = two_conditions([1.0] * 20, [1.0] * 20)
    result[-1] |= {"status": "invalid", "score": None, "attempt": 1}
    run = read_run(tmp_path / "run", result)
    with pytest.raises(CertificateError, match=r"1 cases have no score, such as t19 under marks"):
        certify(run)
    lost = certify(run, missing_as_lost=True)
    assert (len(lost.missing), lost.episodes, lost.retention) == (1, 39, 0.95)
    with pytest.raises(CertificateError, match="no task is solved clean"):
        certificate_of(tmp_path / "none", two_conditions([0.0] * 9, [0.0] * 9))
    with records.create(tmp_path / "part", {}, ["x", "y"]):
        records.append_all(tmp_path / "part", [made("a", "t0")])
    with pytest.raises(CertificateError, match="planned episodes are missing"):
        certify(reading.read(tmp_path / "part"))


def command(*words):
    """The exit code of a command, which runs in this process."""
    with pytest.raises(SystemExit) as ended:
        main(list(map(str, words)))
    return ended.value.code


def test_the_statement_says_what_helped_the_agent_and_what_was_left_out(tmp_path):
    """A guarded agent was certified under the name that it has without a guard."""
    items = two_conditions([1.0] * 14, [1.0] * 14)
    alone = certificate_of(tmp_path / "alone", items).statement
    assert alone.startswith("a keeps at least 80.73 % ")
    assert alone.endswith("over marks (14 tasks)")
    for record in items:
        record["given"] = ["plan"]
    run = read_run(tmp_path / "run", items, guard="rules", unplayable={"t": {}, "u": {}})
    statement = certify(run).statement
    assert statement.startswith("a (given the task's plan in words, watched by the guard rules) ke")
    assert statement.endswith("over marks (14 tasks, without 2 that could not be played)")


def test_the_statement_counts_the_rows_that_not_every_condition_has(tmp_path):
    """A corruption that a build could not place on half of the rows was certified as if it had."""
    items = [
        made("a", f"t{number}", label, id=f"{number}{label}", task_seed="0003")
        for number in range(20)
        for label in ("clean", "marks")
        if label == "clean" or number < 14
    ]
    certificate = certificate_of(tmp_path / "run", items, kind="score")
    (entry,) = certificate.distribution
    assert (entry.corruption, entry.severity) == (None, None), "its parameters are not known"
    assert certificate.statement.endswith(
        "over marks (14 tasks, without 6 rows that not every condition has)"
    )


def test_results_of_others_are_certified_once_their_conditions_are_declared(tmp_path, capsys):
    lines = ["task,condition,score,seed"]
    lines += [
        f"t{n},{c},{s},{e}"
        for n in range(40)
        for c, s in (("clean", 1), ("noise", int(n > 3)))
        for e in (0, 1)
    ]
    table, path = tmp_path / "results.csv", tmp_path / "certificate.json"
    table.write_text("\n".join(lines))
    with pytest.raises(CertificateError, match="declare it in words with --distribution"):
        certify(collect_run([table]))
    result = certify(collect_run([table]), declaration="noise: ten random lines")
    exact = stats.binomtest(36, 40, alternative="greater").proportion_ci(0.95, "exact").low
    assert (result.method, result.tasks, result.head_sha256) == ("gaffke", 40, "")
    assert result.retention_at_least == pytest.approx(exact, abs=2e-4)
    assert (result.distribution[0].corruption, result.distribution[0].severity) == (None, None)
    table.write_text("\n".join(lines).replace("clean", "none").replace("score", "reward"))
    words = ["--clean", "none", "--columns", "score=reward", "-o", path]
    assert command("certify", table, *words) == 2
    words += ["--distribution", "noise: ten random\nlines"]
    assert command("certify", table, *words) == 0
    assert (
        "over noise (40 tasks): noise: ten random lines; method: gaffke" in capsys.readouterr().out
    )
    assert json.loads(path.read_text())["retention_at_least"] == result.retention_at_least
    command("verify", path, "--run", table)
    assert "is what the records of" in capsys.readouterr().out
    table.write_text(table.read_text().replace("t0,noise,0,0", "t0,noise,1,0"))
    command("verify", path, "--run", table)
    assert "scores_sha256" in capsys.readouterr().out
    odd = path.with_name("odd.json")
    odd.write_text(path.read_text().replace('"columns": {', '"columns": {"task": 1,'))
    assert command("verify", odd, "--run", table) == 2
    assert "read_with must hold reader, columns and clean" in capsys.readouterr().err
    table.write_text(table.read_text().replace("t0,noise", "t,noise"))
    options = {"clean": "none", "columns": {"score": "reward"}}
    with pytest.raises(CertificateError, match="counts every task; leave out --common-tasks"):
        certify(collect_run([table], **options, common_tasks=True), declaration="noise")
    assert command("certify", table, *words) == 2
    assert "a certificate counts every task" in capsys.readouterr().err
    folder = tmp_path / "run"
    read_run(folder, two_conditions([1.0] * 9, [1.0] * 9))
    assert command("certify", folder, "--distribution", "marks") == 2
    assert "run.json says what its conditions are" in capsys.readouterr().err


def hijack(*words):
    argv = [sys.executable, "-m", "hijack_data.cli", *map(str, words)]
    return subprocess.run(argv, capture_output=True, text=True, timeout=120, check=False)


def test_verify_computes_it_again_and_names_every_field_that_differs(tmp_path):
    folder, path = tmp_path / "run", tmp_path / "certificate.json"
    result = two_conditions([1.0] * 24, [1.0] * 22 + [0.0] * 2)
    read_run(folder, result)
    made_by_command = hijack("certify", folder, "-o", path, "--retention", "0.9")
    assert made_by_command.returncode == 1, made_by_command.stderr
    assert "0.7601 is below --retention 0.9" in made_by_command.stderr
    verified = hijack("verify", path, "--run", folder)
    assert verified.returncode == 0, verified.stderr
    data = json.loads(path.read_text())
    run = reading.read(folder)
    for key, value in data.items():
        if key in ("format", "version", "run", "agent", "distribution", "confidence"):
            continue
        if key in ("missing_as_lost", "until_retention", "declaration", "read_with"):
            continue
        changed = tmp_path / "changed.json"
        changed.write_text(json.dumps({**data, key: [] if value != [] else ["x"]}))
        (problem,) = certificate_problems(changed, run)
        assert key in problem
    for change in ({"confidence": 0.9}, {"agent": "b"}, {"until_retention": {"retention": 0.8}}):
        changed.write_text(json.dumps({**data, **change}))
        assert certificate_problems(changed, run)
    result[-1]["score"] = 1.0
    second = certificate_problems(path, read_run(tmp_path / "other", result))
    assert {"retention_at_least", "scores_sha256", "records_sha256"} <= {
        problem.split(": ")[1].split(" ")[0] for problem in second
    }


# A run that ends at its bound


BENCH = Bench(
    agents=("oracle",),
    tasks=tuple(f"task_{number}" for number in range(60)),
    corruptions={label: all_planners()[label] for label in ("clean", "marks", "subtitle")},
    seeds=(0,),
)


def play(folder, benchmark, kept, monkeypatch, limit=None, at_once=1):
    """Play what is left of a run, up to a number of episodes; `kept` says which are solved."""
    from online_env.bench import jobs as jobs_module

    class Named:
        def __init__(self, name, seed):
            self.id = f"{name}-{seed}"

    monkeypatch.setattr(jobs_module.tasks, "get", Named)
    listed = jobs(benchmark)
    ids = [job.id for job in listed]
    config = benchmark.to_data()
    before = records.begin(folder, config, ids, goes_on=True)
    try:
        earlier = jobs_module.attempts(listed, records.read(folder).records)
        played = [record for item in earlier.values() for record in item]
        test = SequentialTest(benchmark.until_retention, config, ids, played)
        counter = itertools.count()

        def episode(job, attempt):
            if limit is not None and next(counter) >= limit:
                raise KeyboardInterrupt
            score = float(job.corruption == "clean" or kept(job.task))
            return made(job.agent, job.task, job.corruption, score, job.seed) | {"id": job.id}

        runner.run_jobs(listed, folder, 0, episode, Silent(), earlier, at_once=at_once, test=test)
    except KeyboardInterrupt:
        pass
    finally:
        before.release()
    return reading.read(folder)


@pytest.mark.parametrize("at_once", [1, 4])
def test_a_run_ends_once_the_retention_is_shown_and_its_certificate_says_so(
    tmp_path, monkeypatch, at_once
):
    benchmark = end_at_retention(BENCH, 0.8)
    assert benchmark.tasks == draw_task_order(BENCH.tasks, 0) != BENCH.tasks
    folder = tmp_path / "run"
    half = play(folder, benchmark, lambda task: True, monkeypatch, limit=31, at_once=at_once)
    assert half.missing
    with pytest.raises(CertificateError, match="planned episodes are missing"):
        certify(half)
    assert any("planned episodes" in problem for problem in rebuild(folder).problems)
    run = play(folder, benchmark, lambda task: True, monkeypatch, at_once=at_once)
    assert not any("planned episodes" in problem for problem in rebuild(folder).problems)
    assert run.missing == 0
    extra = len(run.records) - len(run.episodes)
    assert extra == 0 if at_once == 1 else extra < 60  # played on while one thread was slow
    assert run.planned < 90  # of 180
    result = certify(run)
    assert (result.method, result.until_retention["retention"]) == ("betting", 0.8)
    assert 0.8 <= result.retention_at_least < 0.85
    assert result.tasks == run.planned // 3
    path = tmp_path / "certificate.json"
    path.write_text(json.dumps(result.to_data()))
    assert certificate_problems(path, run) == []
    again = play(folder, benchmark, lambda task: True, monkeypatch)
    assert len(again.records) == len(run.records)  # nothing is left to play


def test_an_episode_without_a_score_is_a_lost_bet_solved_clean():
    records_played = [made("a", "t", label, None, status="invalid") for label in ("clean", "marks")]
    settings = {"seeds": [0], "corruptions": ["clean", "marks"]}
    ids = [first_id(record) for record in records_played]
    bets, episodes, missing = settle_bets(settings, ids, records_played)
    assert (bets.clean, bets.corrupted, episodes, len(missing)) == ([1.0], [0.0], 0, 2)


def test_verify_proves_a_run_that_ended_early_and_finds_one_that_did_not_have_to(tmp_path):
    """Episodes of an environment, on a desktop that is none; with so low a bound two tasks do."""
    folder = tmp_path / "run"
    tasks = list(draw_task_order(("do", "redo", "undo", "outdo"), 0))
    rule = StopRule(retention=0.05)
    settings = config(tasks=tasks, seeds=[7, 8], until_retention=rule.to_data())
    listed = [
        Straw(AGENT, task, label, seed) for task in tasks for seed in (7, 8) for label in PLANNERS
    ]
    ids = [job.id for job in listed]
    with no_machine(), records.create(folder, settings, ids):
        test = SequentialTest(rule, settings, ids, [])
        runner.run_jobs(listed, folder, 1, Episodes(folder), Silent(), test=test)
    assert len(reading.read(folder).records) == 2 * 2 * len(PLANNERS)
    report = rebuild(folder)
    assert (report.problems, report.episodes) == ([], 16)
    result = certify(reading.read(folder))
    assert (result.method, result.tasks, result.retention) == ("betting", 2, pytest.approx(2 / 3))
    rule = StopRule(retention=0.5)  # which two tasks do not show
    settings["until_retention"] = rule.to_data()
    with no_machine(), records.create(tmp_path / "short", settings, ids):
        runner.run_jobs(listed[:16], tmp_path / "short", 1, Episodes(tmp_path / "short"), Silent())
    (problem,) = rebuild(tmp_path / "short").problems
    assert "16 of 32 planned episodes are not there" in problem


def test_a_run_that_does_not_keep_so_much_is_played_to_its_end(tmp_path, monkeypatch):
    benchmark = end_at_retention(BENCH, 0.8)
    run = play(tmp_path / "run", benchmark, lambda task: task.endswith("1"), monkeypatch)
    assert (run.missing, len(run.records)) == (0, 180)
    assert certify(run).retention_at_least < 0.8
    (note,) = early_end_note(run)
    assert note.startswith("After 60 of 60 tasks a retention above 0.8 is not shown with 95 %")


def test_a_bound_that_needs_more_tasks_than_there_are_is_said_before_the_run(tmp_path, capsys):
    assert [StopRule(retention=r).tasks_needed for r in (0.7, 0.8, 0.9, 0.95)] == [14, 23, 48, 98]
    words = ["bench", "embedded_small", "--agent", "oracle", "--dry-run", "--until-retention"]
    assert command(*words, "0.8") == 0
    assert "10 tasks: 23 are needed even if nothing is lost" in capsys.readouterr().err


def test_a_rule_that_does_not_fit_the_run_is_refused(tmp_path):
    with pytest.raises(ParameterError, match="has one agent; give --agent"):
        end_at_retention(Bench(agents=("a", "b"), tasks=("t",)), 0.8)
    with pytest.raises(ParameterError, match="above 0 and below 1, got 1"):
        end_at_retention(BENCH, 1.0)
    config = end_at_retention(BENCH, 0.8).to_data()
    records.create(tmp_path / "run", {**config, "tasks": list(BENCH.tasks)}, ["x"]).release()
    with pytest.raises(reading.RunError, match="not in the order that its seed draws"):
        reading.read(tmp_path / "run")
