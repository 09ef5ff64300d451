"""What a run will take: from earlier runs, from the suite's figures, or at most."""

import subprocess
import sys

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

from online_env.bench.config import Bench
from online_env.bench.estimates import (
    EPISODE_SECONDS,
    STEP_BYTES,
    STEP_SECONDS,
    History,
    estimate,
    expected,
    history_near,
    makespan,
)
from online_env.bench.jobs import Job, jobs
from online_env.results import records
from online_env.tasks import task_sets

TASK = "write_note"
BENCH = Bench(tasks=(TASK,), corruptions={"clean": None}, max_steps=60)


def make_record(seconds, steps, corruption="clean", agent="oracle", **more):
    return {
        "id": f"{TASK}-0__{corruption}__s0__{agent}",
        "agent": agent,
        "task": f"{TASK}-0",
        "task_seed": 0,
        "corruption": corruption,
        "seed": 0,
        "status": "ok",
        "score": 1.0,
        "seconds": seconds,
        "steps": steps,
        **more,
    }


def write_run(folder, *found):
    records.create(folder, BENCH.to_data()).release()
    records.append_all(folder, found)
    for record in found:
        frames = folder / "episodes" / record["id"] / "frames"
        frames.mkdir(parents=True, exist_ok=True)
        (frames / "0000.png").write_bytes(b"x" * 1000 * (record["steps"] + 1))


@pytest.mark.parametrize(
    ("durations", "machines", "end"),
    [
        ([], 3, 0.0),
        ([5.0, 1.0, 1.0], 1, 7.0),
        ([5.0, 1.0, 1.0], 2, 5.0),
        ([1.0, 1.0, 5.0], 2, 6.0),  # the long one begins last
        ([2.0] * 3690, 100, 74.0),
        ([3.0], 10, 3.0),
    ],
)
def test_jobs_go_in_order_to_the_first_machine_that_is_free(durations, machines, end):
    assert makespan(durations, machines) == pytest.approx(end)


def test_a_task_takes_the_oracle_what_the_suite_says():
    read_measurement = task_sets.read_measurements()[TASK]
    (value,) = expected(BENCH, [Job("oracle", TASK, "marks", 0)], History())
    assert (value.seconds, value.basis) == (pytest.approx(read_measurement.seconds), "suite")
    assert value.bytes == pytest.approx((read_measurement.actions + 2) * STEP_BYTES)
    (nothing,) = expected(BENCH, [Job("fail", TASK, "clean", 0)], History())
    assert read_measurement.setup < nothing.seconds < value.seconds


def test_what_was_never_measured_is_a_limit_and_says_whose_time_is_not_in_it():
    bench = Bench(tasks=("mine",), agents=("a", "b"), corruptions={"clean": None}, max_steps=10)
    listed = [Job("a", "mine", "clean", 0), Job("b", "mine", "clean", 0)]
    result = expected(bench, listed, History())
    assert [item.seconds for item in result] == [EPISODE_SECONDS + 10 * STEP_SECONDS] * 2
    text = estimate(bench, listed * 100)
    assert text.startswith("at most 43 min and ")
    assert "(200 with all 10 steps)" in text
    assert text.endswith("; without the time that a, b takes to answer")
    assert estimate(bench, listed * 1000, desktops=2).startswith("at most 3.6 h")


def test_a_foreign_id_measures_no_folder_of_another_place(tmp_path):
    write_run(tmp_path / "a", make_record(10.0, 4))
    alone = history_near(tmp_path / "new").step_bytes
    write_run(tmp_path / "b", {**make_record(10.0, 4, "marks"), "id": "../../a"})
    (tmp_path / "a" / "frames" / "0000.png").unlink()  # what write_run made at that path
    (tmp_path / "a" / "other").write_bytes(b"x" * 10**6)
    assert history_near(tmp_path / "new").step_bytes == alone


def test_earlier_runs_beside_the_new_one_count_most(tmp_path):
    write_run(tmp_path / "a", make_record(10.0, 4), make_record(30.0, 6, "marks"))
    write_run(tmp_path / "deep" / "b", make_record(20.0, 4), make_record(99.0, 9, status="invalid"))
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "run.json").write_text("{")
    history = history_near(tmp_path / "new")
    listed = [Job("oracle", TASK, label, 0) for label in ("clean", "marks", "subtitle")]
    result = expected(BENCH, listed, history)
    assert [item.seconds for item in result] == pytest.approx([15.0, 30.0, 20.0])
    assert {item.basis for item in result} == {"runs"}
    assert result[1].bytes == pytest.approx(7 * history.step_bytes)
    assert history.step_bytes < STEP_BYTES / 100
    text = estimate(BENCH, listed, 1, history)
    assert text == "about 1 min and 0.0 GB (3 measured in earlier runs)"


def test_models_cost_what_they_did_and_an_unknown_one_says_so(tmp_path):
    from online_env.agents.registry import AGENTS

    AGENTS.find("gpt-4o")
    listed = [Job("gpt-4o", TASK, "clean", 0)] * 3
    assert "money not known: no earlier run of gpt-4o here" in estimate(BENCH, listed)
    write_run(tmp_path / "a", make_record(60.0, 9, agent="gpt-4o", usage={"usd": 0.25}))
    text = estimate(BENCH, listed, 1, history_near(tmp_path / "b"))
    assert text == "about 3 min and 0.0 GB, 0.75 USD (3 measured in earlier runs)"


def test_a_dry_run_says_what_it_rests_on(tmp_path):
    write_run(tmp_path / "a", make_record(600.0, 4))
    argv = [sys.executable, "-m", "hijack_data.cli", "bench", "embedded_small", "--dry-run"]
    options = ["--agent", "oracle", "--tasks", TASK, "--corruptions", "clean,marks"]
    process = subprocess.run(
        [*argv, *options, "--desktops", "1", "--out", str(tmp_path / "b")],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    last = process.stdout.splitlines()[-1]
    assert last.startswith("2 episodes on 1 desktop, about 20 min and 0.0 GB")
    assert last.endswith("(2 measured in earlier runs)")
    assert not (tmp_path / "b").exists()


def test_every_job_of_a_run_is_expected_to_take_something():
    bench = Bench(tasks=task_sets.members("small"), corruptions=None)
    listed = jobs(bench)
    assert all(item.seconds > 0 for item in expected(bench, listed, History()))
