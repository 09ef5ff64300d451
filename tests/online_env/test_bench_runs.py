"""What a run keeps and how it is read: records, damaged lines, rows, the report."""

import json
import re
import subprocess
import sys

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("gymnasium", reason="needs the extra [online]")

from online_env.bench import runner
from online_env.bench.config import load_bench, override
from online_env.bench.episodes import lost_record
from online_env.bench.jobs import Job, jobs
from online_env.errors import CostLimitError
from online_env.results import costs, reading, records, scores
from online_env.results.records import RunError

CONFIG = {
    "agents": ["oracle", "b"],
    "corruptions": ["clean", {"marks": {"as": "few", "number": 5}}],
    "recovery": "none",
}


def make_record(
    task="t", corruption="clean", status="ok", score=1.0, agent="oracle", seed=0, **more
):
    """A record with what the report reads."""
    score = score if status == "ok" else None
    return {
        "id": f"{task}-{corruption}",
        "agent": agent,
        "task": task,
        "task_seed": seed,
        "corruption": corruption,
        "seed": seed,
        "status": status,
        "score": score,
        "reason": "",
        "problem": "because",
        "steps": 3,
        "seconds": 1.5,
        "attempt": 0,
        **more,
    }


@pytest.fixture
def folder(tmp_path):
    records.create(tmp_path / "run", CONFIG)
    return tmp_path / "run"


def hijack(*words):
    argv = [sys.executable, "-m", "hijack_data.cli", *map(str, words)]
    return subprocess.run(argv, capture_output=True, text=True, timeout=120, check=False)


# The folder


def test_a_run_begins_in_a_new_folder_and_never_over_another(tmp_path):
    path = tmp_path / "deep" / "run"
    records.create(path, CONFIG)
    head = json.loads((path / "run.json").read_text())
    assert (head["format"], head["version"], head["config"]) == ("agenthijack-run", 3, CONFIG)
    assert {"agenthijack", "python", "numpy"} <= head["versions"].keys()
    assert head["created"] > 1.7e9
    records.append(path, make_record())
    before = (path / "records.jsonl").read_bytes()
    with pytest.raises(RunError, match="holds a run already"):
        records.create(path, CONFIG)
    assert (path / "records.jsonl").read_bytes() == before
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.tex").touch()
    with pytest.raises(RunError, match=r"is not empty \(thesis.tex"):
        records.create(tmp_path / "full", CONFIG)
    (tmp_path / "file").touch()
    with pytest.raises(RunError, match="cannot be read"):
        records.create(tmp_path / "file", CONFIG)


def test_records_come_back_as_they_were_appended(folder):
    new_records = [
        make_record(),
        make_record(corruption="few", status="invalid"),
        make_record("Ω\n", score=0.25),
    ]
    for record in new_records:
        records.append(folder, record)
    run = records.read(folder)
    assert (run.records, run.damaged, run.config) == (new_records, [], CONFIG)
    assert (folder / "records.jsonl").read_bytes().count(b"\n") == 3


def test_damaged_lines_are_named_and_skipped(folder):
    records.append(folder, make_record())
    with open(folder / "records.jsonl", "ab") as handle:
        for line in (
            b'{"agent": "or',
            b"[]",
            b"\xff\xfe",
            b"",
            json.dumps(make_record(score=7)).encode(),
            json.dumps({**make_record(), "seed": "0"}).encode(),
            json.dumps(make_record(status="fine")).encode(),
            b"[" * 100_000,
            b"1" * 5000,
        ):
            handle.write(line + b"\n")
    records.append(folder, make_record("u"))
    run = records.read(folder)
    assert [r["task"] for r in run.records] == ["t", "u"]
    assert [d.line for d in run.damaged] == [2, 3, 4, 6, 7, 8, 9, 10]
    output = [d.problem for d in run.damaged]
    assert "cut off" in output[0]
    assert output[3] == "score 7 is not a number in 0..1"
    assert output[4] == "field 'seed' is missing or of the wrong type"
    assert "status 'fine'" in output[5]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "is not the folder of a run"),
        ("{", "is not JSON"),
        ("[]", r"not the head of a run \(field 'format' must be 'agenthijack-run'\)"),
        ('{"format": "agenthijack-run", "version": 4}', "newer"),
        (
            '{"format": "agenthijack-run", "version": 1, "config": 3}',
            "config: must be an object, got 3",
        ),
    ],
)
def test_what_is_no_run_is_refused(content, words, tmp_path):
    if content is not None:
        (tmp_path / "run.json").write_text(content)
    with pytest.raises(RunError, match=words):
        records.read(tmp_path)


# Rows


def test_rows_hold_the_contract_and_pair_with_clean():
    listed = [
        make_record("t", score=1.0),
        make_record("u", score=1.0),
        make_record("v", score=0.0),
        make_record("t", "few", score=0.0),
        make_record("u", "few", score=0.5),
        make_record("v", "few", status="invalid"),
        make_record("t", "few", agent="b", status="error"),
        make_record("t", agent="b", score=0.0),
    ]
    rows = scores.rows(listed, ["b", "oracle"], ["clean", "few"])
    assert [(r["agent"], r["corruption"]) for r in rows] == [
        ("b", "clean"),
        ("b", "few"),
        ("oracle", "clean"),
        ("oracle", "few"),
    ]
    assert all(tuple(row) == scores.COLUMNS for row in rows)
    by = {(r["agent"], r["corruption"]): r for r in rows}
    clean, few = by["oracle", "clean"], by["oracle", "few"]
    assert (clean["n"], clean["success"], clean["delta"], clean["retention"]) == (
        3,
        pytest.approx(2 / 3),
        None,
        None,
    )
    # v is invalid under `few`, so only t and u are compared: 0.5 of 2 instead of 2 of 2.
    assert (few["n"], few["success"], few["delta"], few["retention"]) == (2, 0.25, -0.75, 0.25)
    assert (few["invalid"], few["errors"]) == (1, 0)
    failed = by["b", "few"]
    assert (failed["n"], failed["success"], failed["errors"], failed["delta"]) == (1, 0.0, 1, 0.0)
    assert failed["retention"] is None  # nothing was done clean, either


def test_only_the_last_attempt_counts():
    listed = [
        make_record(status="invalid"),
        make_record(score=1.0, attempt=1),
        make_record(status="invalid", seed=1),
    ]
    (row,) = scores.rows(listed)
    assert (row["n"], row["success"], row["invalid"]) == (1, 1.0, 1)


def test_nothing_but_invalid_episodes_has_no_success():
    (row,) = scores.rows([make_record(status="invalid")])
    assert (row["n"], row["success"], row["delta"], row["invalid"]) == (0, None, None, 1)


CASES = st.tuples(
    st.sampled_from("tuv"),
    st.sampled_from(["clean", "few", "x"]),
    st.sampled_from(["oracle", "b"]),
    st.sampled_from(reading.STATUSES),
    st.integers(0, 4),
    st.integers(0, 2),
)


@settings(max_examples=60, deadline=None)
@given(st.lists(CASES, max_size=40))
def test_rows_count_every_case_once(drawn):
    listed = [
        make_record(t, c, status, quarter / 4, a, seed) for t, c, a, status, quarter, seed in drawn
    ]
    rows = scores.rows(listed)
    assert sum(row["n"] + row["invalid"] for row in rows) == len(scores.latest(listed))
    assert len({(row["agent"], row["corruption"]) for row in rows}) == len(rows)
    for row in rows:
        assert row["success"] is None or 0 <= row["success"] <= 1
        assert row["delta"] is None or -1 <= row["delta"] <= 1
        assert row["errors"] <= row["n"]


# The command


def test_intervals_and_p_rest_on_tasks_and_p_is_adjusted_for_all_corruptions():
    items = []
    for number in range(8):
        for seed in (0, 1):
            name = f"t{number}-{seed}"
            items.append(make_record(name, seed=seed))
            items.append(make_record(name, "few", score=0.0, seed=seed))
            items.append(make_record(name, "some", score=float(number % 2), seed=seed))
    clean, few, some_row = scores.rows(items)
    assert (clean["success"], clean["delta"], clean["p"]) == (1.0, None, None)
    assert clean["ci_low"] == pytest.approx(1 - 0.3244, abs=1e-3)  # Wilson's for 0 of 8 tasks
    assert few["p"] == pytest.approx(2 * 2 / 2**8)
    assert some_row["p"] == pytest.approx(2 / 2**4)
    assert (some_row["delta"], some_row["retention"]) == (-0.5, 0.5)
    assert -1 < some_row["delta_low"] < -0.5 < some_row["delta_high"] < 0
    assert list(clean) == list(scores.COLUMNS)


def test_the_summary_of_an_agent():
    table = scores.rows(
        [make_record(), make_record(corruption="few", score=0.0), make_record(corruption="some")]
    )
    assert scores.summaries(table) == [
        {
            "agent": "oracle",
            "clean": 1.0,
            "corrupted": 0.5,
            "worst": "few",
            "worst_success": 0.0,
            "paper_average": pytest.approx(2 / 3),
        }
    ]
    (alone,) = scores.summaries(scores.rows([make_record()]))
    assert (alone["corrupted"], alone["worst"], alone["paper_average"]) == (None, None, 1.0)


def test_report_as_json_and_as_a_table(folder):
    for record in (
        make_record(),
        make_record(corruption="few", score=0.0),
        make_record("u"),
        make_record("u", "few", score=1.0),
    ):
        records.append(folder, record)
    result = hijack("report", folder, "--json")
    assert result.returncode == 0, result.stderr
    rows = json.loads(result.stdout)
    assert rows == scores.rows(records.read(folder).records)
    assert [row["corruption"] for row in rows] == ["clean", "few"]
    table = hijack("report", folder)
    assert table.returncode == 0
    assert "Recovery policy none: no agent asked" in table.stdout
    few = table.stdout.split("\n  few")[1].split()
    assert few[:4] == ["2", "50.0", "[2.5,", "97.5]"]  # the exact ends, wider than Wilson's
    assert few[4:9] == ["-50.0", "[-97.5,", "+41.0]", "1.000", "50.0"]
    assert "oracle: worst under few, loses 50 points" in table.stdout


def test_report_tells_infeasible_tasks_apart(folder):
    records.append(folder, make_record(infeasible=False))
    records.append(folder, make_record("u", score=0.0, infeasible=True))
    text = hijack("report", folder, "--full").stdout
    assert "feasible tasks" in text
    assert text.split("infeasible tasks")[1].split("clean")[1].split()[:2] == ["1", "0.0"]
    assert json.loads(hijack("report", folder, "--json").stdout)[0]["n"] == 2


def test_report_names_what_is_invalid_failed_or_damaged(folder):
    records.append(folder, make_record())
    records.append(folder, make_record(corruption="few", status="invalid"))
    result = hijack("report", folder)
    assert result.returncode == 1
    assert "invalid: t-few: because" in result.stdout
    (folder / "records.jsonl").write_text(json.dumps(make_record()) + '\n{"cut')
    result = hijack("report", folder, "--json")
    assert result.returncode == 1
    assert f"{folder}/records.jsonl:2: skipped" in result.stderr
    assert json.loads(result.stdout)[0]["n"] == 1


def test_report_refuses_what_is_no_run(tmp_path):
    result = hijack("report", tmp_path)
    assert result.returncode == 2
    assert "is not the folder of a run" in result.stderr
    assert "Traceback" not in result.stderr
    result = hijack("report", tmp_path / "none")
    assert (result.returncode, "Traceback" in result.stderr) == (2, False)


def test_bench_dry_run_and_refusals(tmp_path):
    result = hijack(
        "bench",
        "embedded_small",
        "--agent",
        "oracle",
        "--corruptions",
        "clean,marks",
        "--seeds",
        2,
        "--dry-run",
    )
    assert result.returncode == 0, result.stderr
    lines = result.stdout.splitlines()
    assert len(lines) == 2 * 2 * 10 + 1
    assert lines[0].startswith("oracle  ")
    assert lines[0].endswith("  seed 0  clean")
    assert re.match(r"40 episodes on \d+ desktops?, (about|at most) ", lines[-1])
    assert hijack("bench", "embedded_small").returncode == 2
    records.create(tmp_path / "run", CONFIG)
    result = hijack("bench", "embedded_small", "--out", tmp_path / "run")
    assert (result.returncode, "holds a run already" in result.stderr) == (2, True)
    result = hijack("bench", "embedded_smal", "--dry-run")
    assert (result.returncode, "did you mean 'embedded_small'" in result.stderr) == (2, True)


@pytest.mark.parametrize(
    ("suite", "options", "refusal"),
    [
        ("embedded_small", ("--corruptions", "network_error+slow_network"), "cannot be combined"),
        ("miniwob_small", ("--layer", "dom"), "resolution resizes the picture"),
    ],
)
def test_a_dry_run_refuses_what_no_desktop_can_do(suite, options, refusal):
    result = hijack("bench", suite, *options, "--dry-run")
    assert (result.returncode, refusal in result.stderr) == (2, True), result.stderr


def test_a_dry_run_names_the_tasks_that_an_agent_has_no_plan_for():
    tasks = ("--tasks", "write_note,crop_picture", "--corruptions", "clean", "--dry-run")
    result = hijack("bench", "embedded_small", "--agent", "oracle,pixel", *tasks)
    assert result.returncode == 0, result.stderr
    assert (
        "pixel can only follow plans in words, and there is none for 1 task of 2" in result.stderr
    )
    assert hijack("bench", "embedded_small", "--agent", "oracle", *tasks).stderr == ""


def test_a_dry_run_names_an_agent_that_would_ask_for_a_reinitialisation_in_vain():
    agents = "agenthijack-agent,agenthijack-agent-no-check,ui-tars-1.5-7b"
    words = ("embedded_small", "--agent", agents, "--tasks", "write_note", "--dry-run")
    told = hijack("bench", *words)
    assert told.returncode == 0, told.stderr
    assert "hijack: agenthijack-agent may ask for re-initialisation, which changes" in told.stderr
    assert hijack("bench", *words, "--recovery", "reset").stderr == ""


def test_a_dry_run_says_what_is_left_in_its_folder(tmp_path):
    """And refuses what the run itself would refuse; it changes nothing."""
    words = ["embedded_small", "--agent", "oracle", "--corruptions", "clean,marks"]
    config = override(load_bench("embedded_small"), agent="oracle", corruption="clean,marks")
    listed = jobs(config)
    run = tmp_path / "run"
    records.create(run, config.to_data(), [job.id for job in listed]).release()
    first = listed[0]
    agent, task, label, seed = first.key
    entries = {"id": first.id, "agent": agent, "task": task, "task_seed": seed, "seed": seed}
    ended = {"corruption": label, "attempt": 0, "status": "ok", "score": 1.0}
    records.append(run, {**entries, **ended})
    before = sorted((path, path.read_bytes()) for path in run.rglob("*") if path.is_file())
    value = hijack("bench", *words, "--out", run, "--dry-run")
    assert (value.returncode, "holds a run already" in value.stderr) == (2, True)
    value = hijack("bench", *words, "--out", run, "--dry-run", "--resume")
    assert value.returncode == 0, value.stderr
    assert value.stdout.splitlines()[-1].startswith("19 episodes on ")
    value = hijack("bench", *words, "--seeds", 2, "--out", run, "--dry-run", "--resume")
    assert (value.returncode, "is another run: seeds" in value.stderr) == (2, True)
    value = hijack("bench", *words, "--out", tmp_path / "new", "--dry-run", "--resume")
    assert value.stdout.splitlines()[-1].startswith("20 episodes on ")
    assert not (tmp_path / "new").exists()
    assert sorted((path, path.read_bytes()) for path in run.rglob("*") if path.is_file()) == before


# The runner


class Log:
    """Remembers what a runner tells."""

    def __init__(self):
        self.said = []

    def begins(self, job, number, attempt):
        self.said.append((number, attempt))

    def ended(self, job, number, record):
        self.said.append(record["status"])


def test_invalid_episodes_are_run_again_then_reported(folder):
    job = Job("oracle", "t", "few", 0)
    answers = iter(
        [
            make_record(id="a", status="invalid"),
            make_record(id="b", score=0.5),
            make_record(id="c", status="invalid"),
            make_record(id="d", status="invalid"),
            make_record(id="e", status="error"),
        ]
    )
    log = Log()
    requests = []

    def episode(job, attempt):
        requests.append(attempt)
        return next(answers)

    statuses = runner.run_jobs([job] * 3, folder, 1, episode, log)
    assert dict(statuses) == {"ok": 1, "invalid": 1, "error": 1}
    assert requests == [0, 1, 0, 1, 0]
    assert log.said == [
        (1, 0),
        "invalid",
        (1, 1),
        "ok",
        (2, 0),
        "invalid",
        (2, 1),
        "invalid",
        (3, 0),
        "error",
    ]
    assert len(records.read(folder).records) == 5


def test_what_was_done_is_on_the_disk_before_the_next_begins(folder):
    calls = []

    def episode(job, attempt):
        calls.append(len(records.read(folder).records))
        if len(calls) == 3:
            raise KeyboardInterrupt
        return make_record(id=str(len(calls)))

    with pytest.raises(KeyboardInterrupt):
        runner.run_jobs([Job("oracle", "t", "clean", 0)] * 5, folder, 1, episode, Log())
    assert calls == [0, 1, 2]
    assert len(records.read(folder).records) == 2


def test_a_budget_counts_what_was_spent_before_and_reads_the_journal_no_more(folder, monkeypatch):
    spent = {"requests": 1, "input_tokens": 10, "output_tokens": 2, "usd": 0.4}
    budget = costs.Budget(1.0, [make_record(usage=spent)])
    monkeypatch.setattr(records, "read", lambda _: pytest.fail("the journal was read again"))
    jobs = [Job("oracle", "t", "clean", seed) for seed in range(4)]

    def episode(job, attempt):
        return make_record(id=str(job.seed), usage=spent)

    with pytest.raises(CostLimitError, match=r"has cost 1\.2000 USD, and --max-cost is 1:"):
        runner.run_jobs(jobs, folder, 0, episode, Log(), budget=budget)
    monkeypatch.undo()
    assert len(records.read(folder).records) == 2, "the third would begin at 1.20 of 1 USD"


def test_a_budget_is_not_kept_by_what_costs_nobody_knows_how_much():
    spent = {"requests": 3, "input_tokens": 0, "output_tokens": 0, "usd": None}
    costs.Budget(1.0, [make_record(usage=None), make_record(usage={"turns": 5})]).check()
    for usage in (spent, {"requests": 3}, {**spent, "usd": "0.1"}):  # what agents of users report
        with pytest.raises(CostLimitError, match="what episode t-clean cost is not known"):
            costs.Budget(1.0, [make_record(usage=usage)]).check()


@pytest.mark.parametrize(
    ("changes", "is_known"),
    [
        ({"steps": 2}, False),
        ({"usage": {"problem": "usage cannot be kept"}}, False),
        (lost_record(Job("mine", "write_note", "clean", 0), 0, "killed", start=0.0), False),
        ({"status": "invalid", "steps": 0}, True),
        ({"agent": "oracle"}, True),
    ],
)
def test_an_agent_with_a_model_is_free_only_where_it_asked_nothing(changes, is_known):
    record = {**make_record(agent="mine", usage=None), **changes}
    budget = costs.Budget(1.0, [record], {"mine": "m at http://here"})
    if is_known:
        budget.check()
        return
    with pytest.raises(CostLimitError, match=r"cost \(m at http://here\) is not known, perhaps"):
        budget.check()
