"""What a run keeps from one session to the next, what it will take, and what CI is told of it."""

import hashlib
import json
import os
from pathlib import Path

import pytest
from lxml import etree

pytest.importorskip("gymnasium", reason="needs the extra [online]")

from hijack_data.cli import main
from hijack_data.errors import HijackError
from online_env.bench.config import Bench
from online_env.bench.estimates import (
    EPISODE_SECONDS,
    MAX_RUNS,
    STEP_SECONDS,
    History,
    estimate,
    expected,
    format_duration,
    history_near,
    read_history,
)
from online_env.bench.jobs import Job
from online_env.report import junit
from online_env.results import costs, origin, records
from online_env.results.reading import Run, RunError, read, with_first_seeds
from online_env.tasks import task_sets

from support.reported import made, run_of, scored

CONFIG = {"agents": ["a"], "corruptions": ["clean"]}
TASK = "write_note"
MANY = [f"task-{number:03}" for number in range(60)]
FIVE = ", ".join(f'"{name}"' for name in MANY[:5])
BENCH = Bench(tasks=(TASK,), corruptions={"clean": None}, max_steps=60)


# Going on


@pytest.mark.parametrize(
    ("was", "now", "said"),
    [
        ({}, {}, ""),
        ({"a": 1}, {"a": 1.0}, ""),
        ({"a": 1}, {"a": 2}, "a was 1, and is 2 now"),
        ({"a": {"b": [1, 2]}}, {"a": {"b": [1, 3]}}, "a.b[1] was 2, and is 3 now"),
        ({"a": [1]}, {"a": [1, 2]}, "a was [1], and is [1, 2] now"),
        ({"a": 1}, {}, "a was 1, and is null now"),
        ({}, {"b": "x"}, 'b was null, and is "x" now'),
        ({"a": [1]}, {"a": {"b": 1}}, 'a was [1], and is {"b": 1} now'),
        ({"a": 1, "b": 2}, {"b": 3, "a": 4}, "a was 1, and is 4 now"),
        ({"a": "x" * 500}, {"a": ""}, f'a was "{"x" * 199}, and is "" now'),
        (
            {"a": MANY},
            {"a": ["new", *MANY[2:]]},
            'a has lost "task-000", "task-001" and has gained "new"',
        ),
        ({"a": MANY[40:]}, {"a": MANY}, f"a has gained {FIVE} and 35 more"),
        (
            {"a": MANY},
            {"a": MANY * 2},
            f"a was {json.dumps(MANY):.200}, and is {json.dumps(MANY):.200} now",
        ),
    ],
)
def test_the_first_difference_of_two_configurations_has_its_place(was, now, said):
    assert records.difference(was, now) == said


@pytest.fixture
def run(tmp_path):
    folder = tmp_path / "run"
    with records.create(folder, CONFIG, ["t-0__clean__s0__a", "u-0__clean__s0__a"]):
        pass
    return folder


def test_each_line_names_the_line_before_it_and_the_record_in_its_folder(run):
    """However many are written at once, and whatever is in them."""
    first = made("a", "t", reason="\u2028 and \ud800")
    episode_path = run / "episodes" / first["id"] / "episode.json"
    episode_path.parent.mkdir(parents=True)
    episode_path.write_text("{}")
    records.append_all(run, [first, made("a", "u")])
    records.append_all(run, [])
    records.append(run, made("a", "v"))
    lines = (run / "records.jsonl").read_bytes().splitlines()
    before = [(run / "run.json").read_bytes(), *lines[:-1]]
    values = [json.loads(line) for line in lines]
    assert [item["previous"] for item in values] == [
        hashlib.sha256(content).hexdigest() for content in before
    ]
    digest = hashlib.sha256(b"{}").hexdigest()
    assert [item["episode_sha256"] for item in values] == [digest, None, None]
    assert read(run).records[0]["reason"] == first["reason"]


def ended(folder, task, attempt, **more):
    """Leave the folder of an episode that ended before its line was written."""
    record = {**made("a", task, **more), "attempt": attempt}
    record["id"] += f"__a{attempt}" if attempt else ""
    path = folder / "episodes" / record["id"] / "episode.json"
    path.parent.mkdir(parents=True)
    path.write_text(json.dumps(record))
    return record["id"]


def test_episodes_without_a_line_get_theirs_in_the_order_of_their_attempts(run):
    """The folder of a second attempt may come first; one without a number is the first."""
    second = ended(run, "t", 1)
    first = ended(run, "t", 0, status="invalid", score=None)
    unnumbered = ended(run, "u", None)
    ended(run, "another", 0)  # not of this run
    episodes = ["t-0__clean__s0__a", "u-0__clean__s0__a"]
    records.resume(run, CONFIG, episodes).release()
    assert [record["id"] for record in read(run).records] == [first, unnumbered, second]
    records.resume(run, CONFIG, episodes).release()
    assert len(read(run).records) == 3


def test_records_of_a_run_whose_head_is_gone_are_not_taken_for_those_of_a_new_one(tmp_path):
    """They may be of another dataset or agent, and each would count as played already."""
    folder = run_of(tmp_path / "run", [made("a", "t", score=1.0)])
    (folder / "run.json").unlink()
    journal_bytes = (folder / "records.jsonl").read_bytes()
    for begin in (records.create, records.resume):
        with pytest.raises(RunError) as error:
            begin(folder, CONFIG, ["t-0__clean__s0__a"])
        output = f"{folder}: is not empty (records.jsonl ...); give --out a new folder"
        assert str(error.value) == output
    assert (folder / "records.jsonl").read_bytes() == journal_bytes
    (folder / "records.jsonl").write_bytes(b"")
    records.resume(folder, CONFIG, ["t-0__clean__s0__a"]).release()
    assert read(folder).missing == 1


@pytest.mark.parametrize("git", ["a text", ["x"], {"agenthijack": "a text"}, None])
def test_a_head_that_names_no_commit_lets_a_run_go_on_and_says_so(git, run):
    path = run / "run.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"git": git}))
    message = []
    episodes = ["t-0__clean__s0__a", "u-0__clean__s0__a"]
    records.begin(run, CONFIG, episodes, goes_on=True, notice=message.append).release()
    here = origin.describe(CONFIG)["git"]["agenthijack"]  # `None` outside a checkout
    commit = here and here["commit"]
    output = f"{run}: was begun with commit None of agenthijack, this is {commit}"
    assert message == ([output] if commit else [])


def test_a_run_that_goes_on_with_the_same_code_says_nothing(tmp_path):
    message = []
    for goes_on in (False, True):
        result = records.begin(
            tmp_path / "run", CONFIG, ["x"], goes_on=goes_on, notice=message.append, desktops=2
        )
        result.release()
    assert message == []
    assert json.loads((tmp_path / "run" / "run.json").read_text())["desktops"] == 2
    assert [session["desktops"] for session in origin.sessions(tmp_path / "run")] == [2]


# How many episodes there are to be


@pytest.mark.parametrize(
    ("config", "planned", "missing"),
    [
        ({"agents": ["a", "b"], "tasks": ["t", "u"], "seeds": [0], "corruptions": ["x"]}, 4, 2),
        ({"agents": ["a"], "tasks": ["t"], "seeds": [0], "corruptions": ["x"]}, 1, 0),
        ({"agents": ["a"], "tasks": "all", "seeds": [0], "corruptions": ["x"]}, 0, 0),
        ({}, 0, 0),
    ],
)
def test_a_run_of_an_older_version_counts_its_episodes_by_its_configuration(
    config, planned, missing
):
    again = {**made("a", "t", "x"), "attempt": 1}
    items = [made("a", "t", "x"), again, made("a", "u", "x")]
    run = Run(folder=None, config=config, records=items)
    assert (run.planned, run.missing) == (planned, missing)


def test_a_second_attempt_stands_for_its_episode(tmp_path):
    record = {**made("a", "t"), "id": "t-0__clean__s0__a__a1", "attempt": 1}
    run = Run(folder=tmp_path, records=[record], episodes=("t-0__clean__s0__a", "other"))
    assert (run.unplayed, run.missing, run.planned) == (("other",), 1, 2)


def test_the_first_seeds_of_ten_leave_the_tenth_alone(tmp_path):
    """The seed 1 is not that of an episode whose id has the seed 10."""
    values = [made("a", "t", seed=seed) for seed in (0, 1, 10)]
    folder = run_of(tmp_path / "run", values, seeds=[10, 1, 0])
    run = with_first_seeds(read(folder), 2)
    assert run.episodes == ("t-0__clean__s0__a", "t-1__clean__s1__a")
    assert [record["seed"] for record in run.records] == [0, 1]
    assert (run.config["seeds"], run.left_out) == ([1, 0], (10,))
    with pytest.raises(RunError, match="has no seed below 0; its seeds are 10, 1, 0"):
        with_first_seeds(read(folder), 0)


# What a run will take


@pytest.mark.parametrize(
    ("seconds", "said"),
    [
        (0, "1 min"),
        (89, "1 min"),
        (91, "2 min"),
        (5400, "90 min"),
        (5401, "1.5 h"),
        (360_000, "100.0 h"),
    ],
)
def test_times_are_minutes_up_to_an_hour_and_a_half(seconds, said):
    assert format_duration(seconds) == said


def test_an_estimate_says_what_each_part_of_it_rests_on():
    history = History(
        seconds={("oracle", TASK, "clean"): [60.0]},
        steps={("oracle", TASK, "clean"): [9.0]},
        step_bytes=1e8,
    )
    listed = [
        Job("oracle", TASK, "clean", 0),
        Job("recovering", TASK, "clean", 0),
        Job("oracle", "mine", "clean", 0),
        Job("random", TASK, "clean", 0),
    ]
    read_measurement = task_sets.read_measurements()[TASK]
    unknown = EPISODE_SECONDS + 60 * STEP_SECONDS
    step = (read_measurement.seconds - read_measurement.setup) / (read_measurement.actions + 1)
    result = expected(BENCH, listed, history)
    assert [item.seconds for item in result] == pytest.approx(
        [60.0, read_measurement.seconds, unknown, read_measurement.setup + 60 * step]
    )
    assert [item.basis for item in result] == ["runs", "suite", "limit", "limit"]
    steps = [10, read_measurement.actions + 2, 61, 61]
    assert [item.bytes for item in result] == pytest.approx([1e8 * count for count in steps])
    text = estimate(BENCH, listed, history=history)
    assert text.endswith(
        "(1 measured in earlier runs, 1 as the suite's figures, 2 with all 60 steps)"
    )
    assert text.startswith("at most ")
    assert f"and {sum(steps) / 10:.1f} GB (" in text


def test_no_agent_takes_more_steps_than_a_run_allows():
    short = Bench(tasks=(TASK,), corruptions={"clean": None}, max_steps=3)
    read_measurement = task_sets.read_measurements()[TASK]
    assert read_measurement.actions > 3
    oracle, idle = expected(
        short, [Job("oracle", TASK, "clean", 0), Job("do_nothing", TASK, "clean", 0)], History()
    )
    assert oracle == idle
    assert oracle.seconds < read_measurement.seconds


def test_earlier_runs_are_read_without_what_says_nothing_about_time(tmp_path):
    steps = [made("a", TASK, question="steps")]
    run_of(tmp_path / "offline", steps, kind="score")
    odd = [
        made("a", TASK, seconds=None),
        made("a", TASK, "marks", steps=None),
        made("a", TASK, "lock", usage={"usd": "much"}),
        made("a", TASK, "pop_ups", usage="none"),
        made("a", TASK, "subtitle", score=None, cause="agent", seconds=900.0),
    ]
    folder = run_of(tmp_path / "odd", odd)
    history = read_history([tmp_path / "offline", folder, tmp_path / "gone"])
    assert history.runs == 3
    assert history.seconds["a",] == [2.0, 2.0, 2.0]
    assert history.steps["a", TASK] == [4.0, 4.0, 4.0]
    assert history.usd == {}
    assert history.step_bytes is None


def test_of_many_runs_the_newest_are_read(tmp_path):
    for number in range(MAX_RUNS + 2):
        folder = run_of(tmp_path / f"run{number}", [made("a", TASK, seconds=float(number))])
        os.utime(folder / "run.json", (1e9 - number, 1e9 - number))
    result = history_near(tmp_path / "new")
    assert result.runs == MAX_RUNS
    assert max(result.seconds["a",]) == MAX_RUNS - 1


def test_folders_beside_a_run_may_end_meanwhile(tmp_path, monkeypatch):
    run_of(tmp_path / "run", [made("a", TASK)])
    other = tmp_path / "others"
    other.mkdir()
    list_folder = os.scandir

    def list_and_remove(path="."):
        if Path(path) == other and other.exists():
            other.rmdir()
        return list_folder(path)

    monkeypatch.setattr(os, "scandir", list_and_remove)
    assert history_near(tmp_path / "new").runs == 1


def test_a_run_that_goes_on_counts_itself_once(tmp_path):
    folder = run_of(tmp_path / "run", [made("a", TASK)])
    (tmp_path / "linked").symlink_to(folder)
    assert history_near(folder).runs == 1


# What models cost


def record_with_usage(**more):
    return made("a", "t", usage={"requests": 2, "input_tokens": 10, "output_tokens": 3, **more})


@pytest.mark.parametrize(
    ("found", "said"),
    [
        ([], ""),
        ([made("a", "t"), made("a", "t", usage={"turns": 3})], ""),
        (
            [record_with_usage(usd=0.5), record_with_usage(usd=0.254)],
            "4 requests, 20 tokens read, 6 written, 0.75 USD",
        ),
        (
            [record_with_usage(usd=0.5), record_with_usage()],
            "4 requests, 20 tokens read, 6 written, price not known",
        ),
        (
            [record_with_usage(usd=0.5), made("a", "t")],
            "2 requests, 10 tokens read, 3 written, 0.50 USD, without 1 episode of unknown usage",
        ),
        (
            [record_with_usage(usd=0.5), made("oracle", "t")],
            "2 requests, 10 tokens read, 3 written, 0.50 USD",
        ),
        ([record_with_usage(usd=1, requests=True)], ""),
    ],
)
def test_a_line_sums_what_models_were_asked(found, said):
    assert costs.usage_line(found) == (f"models: {said}" if said else "")


@pytest.mark.parametrize("limit", ["nan", "inf"])
def test_a_budget_that_no_sum_ever_reaches_is_refused(limit, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["bench", "embedded_small", "--dry-run", "--max-cost", limit])
    assert ended.value.code == 2
    assert f"'--max-cost': '{limit}' is not a finite number; see" in capsys.readouterr().err


# The JUnit file


def test_a_junit_file_sums_seconds_by_agent_and_over_all(tmp_path):
    items = [
        made("a", "t0", seconds=1.25),
        made("a", "t1", seconds=2.5),
        made("b", "t0", seconds=None),
        made("b", "t1", seconds=0.0625),
    ]
    path = tmp_path / "deep" / "junit.xml"
    junit.write(path, Run(folder=tmp_path, records=items), [])
    root = etree.parse(path).getroot()
    assert [(suite.get("name"), suite.get("time")) for suite in root] == [
        ("a", "3.750"),
        ("b", "0.062"),
    ]
    assert root.get("time") == "3.812"
    junit.write(path, Run(folder=tmp_path, records=items[:1]), [])
    assert etree.parse(path).getroot().get("tests") == "1", "it is written anew"


def test_a_junit_file_has_a_suite_of_gates_with_what_failed(tmp_path):
    cases = [
        junit.GateCase(name="a:worst=0.5", problem=""),
        junit.GateCase(name="a:average=1", problem="average of a is 0.500, below 1"),
    ]
    root = junit.junit_tree(Run(folder=tmp_path, records=scored("a", "clean", [1])), cases)
    passed, failed = root[-1]
    assert (root.get("tests"), root.get("failures"), root.get("errors")) == ("3", "1", "0")
    assert passed.find("failure") is None
    assert failed.find("failure").get("type") == "below"
    assert failed.find("failure").text == "average of a is 0.500, below 1"


def test_a_junit_file_that_cannot_be_written_is_one_error(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(HijackError, match=r"junit\.xml: cannot be written"):
        junit.write(tmp_path / "file" / "junit.xml", Run(folder=tmp_path), [])
