"""`hijack score`: rows, pairs, the folder of the run, and agents that misbehave."""

import json
import os
import shutil
import signal
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")
pytest.importorskip("pyarrow", reason="needs the extra [hf]")

import hijack_data as hj
from hijack_data.errors import HijackError, ParameterError
from hijack_data.locking import LockedError
from online_env.bench.config import Bench, override
from online_env.errors import AgentSetupError
from online_env.report.build import build_report
from online_env.results import origin, records
from online_env.results.parts import part_rows
from online_env.results.reading import RunError
from online_env.results.scores import rows as score_rows
from online_env.scoring.cases import Selection, choose_question
from online_env.scoring.rules import Distance
from online_env.scoring.run import ScoreRun, ScoreSettings
from pipelines import build
from pipelines.proof.rebuild import rebuild

from support.scoring import dataset, record_steps, write_agents
from support.waiting import until

ROOT = Path(__file__).resolve().parents[2]
CLICKS = [{"instruction": "click 100,50"}, {"instruction": "click 300,190"}]


@pytest.fixture(scope="module")
def clicks(tmp_path_factory):
    return dataset(tmp_path_factory.mktemp("clicks"), CLICKS)


@pytest.fixture(scope="module")
def agents(tmp_path_factory):
    return write_agents(tmp_path_factory.mktemp("agents"))


def settings_for(folder, *agents, **more):
    names = override(Bench(), agent=",".join(agents)).agents
    question = choose_question(folder, more.pop("ask", None))
    return ScoreSettings(dataset=folder, agents=names, question=question, **more)


def play_rows(settings, out, resume=False):
    """Run to the end; returns the notices and the run."""
    run = ScoreRun(settings)
    notices = []
    with run.begin(out, resume):
        run.play(out, run.remaining_cases(out), lambda *_: None, notices.append)
    return notices, records.read(out)


def by_row(run):
    return {record["row"]: record for record in run.records}


def edit(folder, name, change):
    """Change the values of a column of a dataset in place."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    (file,) = folder.rglob("*.parquet")
    table = pq.read_table(file)
    values = table.column(name).to_pylist()
    change(values)
    index = table.schema.get_field_index(name)
    field = table.schema.field(index)
    pq.write_table(table.set_column(index, field, pa.array(values, field.type)), file)


def hijack(*words, **more):
    argv = [sys.executable, "-m", "hijack_data.cli", *map(str, words)]
    return subprocess.run(argv, capture_output=True, text=True, timeout=300, check=False, **more)


def test_steps_are_scored_and_paired(clicks, agents, tmp_path):
    _, run = play_rows(settings_for(clicks, f"{agents}:ByBrightness"), tmp_path / "run")
    result = by_row(run)
    assert {row: record["score"] for row, record in result.items()} == {
        "t0/0000/clean": 1,
        "t0/0000/resolution": 0,
        "t1/0000/clean": 0,  # it clicks outside the box
        "t1/0000/resolution": 0,
    }
    assert result["t1/0000/clean"]["parts"] == {"type": True, "place": False}
    assert result["t0/0000/resolution"]["reason"] == "fail in the place of click"
    assert result["t0/0000/clean"]["more"] == 1
    clean, resized = score_rows(run.records)
    assert (clean["n"], clean["success"], clean["delta"]) == (2, 0.5, None)
    assert (resized["n"], resized["delta"], resized["retention"]) == (2, -0.5, 0)
    assert run.missing == 0
    assert run.is_scored
    parts = {row["corruption"]: row for row in part_rows(run.records)}
    assert parts["clean"]["type"] == 1
    assert parts["clean"]["place"] == 0.5
    assert parts["resolution"]["type"] == 0


def test_materialised_and_lazy_rows_score_alike(agents, tmp_path):
    items = []
    for output in ("materialised", "lazy"):
        folder = dataset(tmp_path / output, CLICKS, "marks:number=3,resolution", output=output)
        _, run = play_rows(settings_for(folder, "random"), tmp_path / f"run-{output}")
        items.append({row: (r["last_action"], r["score"]) for row, r in by_row(run).items()})
    assert len(items[0]) == 6
    assert items[0] == items[1]


HOSTILE = {
    "raise": ("error", "ValueError: no idea"),
    "leave": ("error", "SystemExit"),
    "hang": ("error", "no answer within 5 s"),
    "die": ("error", "its process died (SIGKILL)"),
    "exit": ("error", "its process died (exit code 0)"),
    "nonsense": ("error", "predict must return"),
    "lazy": ("error", "RuntimeError: not now"),
    "nothing": ("ok", ""),
    "prose": ("ok", ""),
    "fork": ("ok", ""),
    "print": ("ok", ""),
    "change": ("ok", ""),
    "click": ("ok", ""),
}
RIGHT = {"fork", "print", "change", "click"}


def test_an_agent_that_misbehaves_costs_its_row_and_nothing_else(agents, tmp_path):
    steps = [{"trajectory_id": word, "instruction": f"{word} 100,50"} for word in HOSTILE]
    folder = dataset(tmp_path, steps)
    command = ("score", folder, "--agent", f"{agents}:Hostile", "-o", tmp_path / "run")
    result = hijack(*command, "--timeout", "5", "--json")
    assert result.returncode == 1, result.stderr
    rows = json.loads(result.stdout)  # nothing that an agent prints is in it
    assert [(row["corruption"], row["n"]) for row in rows] == [("clean", 13), ("resolution", 13)]
    for record in records.read(tmp_path / "run").records:
        word = record["task"]
        status, problem = HOSTILE[word]
        assert record["status"] == status, word
        assert problem in record["problem"], word
        if status == "error":
            assert record["cause"] == "agent"
            continue
        # On the smaller pictures the agent that changes its observation aims at another place.
        aimed = record["corruption"] == "clean" or word != "change"
        assert record["score"] == (word in RIGHT and aimed), word
        assert record["malformed"] == (word in ("nothing", "prose")), word
    child = int((agents.parent / "child").read_text())
    until(lambda: not Path(f"/proc/{child}").exists(), "the agent's process is ended")


def test_each_row_is_an_episode_of_its_own(clicks, agents, tmp_path):
    for name in ("Remembers", "Resets"):
        settings = settings_for(clicks, f"{agents}:{name}")
        _, run = play_rows(settings, tmp_path / name)
        value = by_row(run)
        assert value["t0/0000/clean"]["score"] == value["t0/0000/resolution"]["score"] == 1
    assert {record["said"] for record in run.records} == {"made 1"}


def test_batches_and_a_batch_that_fails(agents, tmp_path):
    steps = [*CLICKS, {"instruction": "raise 100,50"}, {"instruction": "click 100,50"}]
    folder = dataset(tmp_path, steps)
    settings = settings_for(folder, f"{agents}:Batched", batch=4)
    notices, run = play_rows(settings, tmp_path / "run")
    assert len(run.records) == 8
    assert Counter(record["score"] for record in run.records) == {1: 6, 0: 2}
    output = Counter(record["said"] for record in run.records)
    assert output == {"4": 4, "I know.": 4}
    assert len(notices) == 1
    assert "one of them is bad" in notices[0]


def test_workers_do_not_change_the_records(agents, tmp_path):
    folder = dataset(tmp_path, CLICKS * 10)
    items = []
    for workers in (1, 3):
        settings = settings_for(folder, "random", workers=workers)
        _, run = play_rows(settings, tmp_path / f"run{workers}")
        items.append({row: (r["last_action"], r["score"]) for row, r in by_row(run).items()})
    assert len(items[0]) == 40
    assert items[0] == items[1]


def test_a_killed_run_goes_on_twice_and_no_row_is_scored_twice(agents, tmp_path):
    folder = dataset(tmp_path, CLICKS * 60)
    out = tmp_path / "run"
    argv = [sys.executable, "-m", "hijack_data.cli", "score", folder]
    argv += ["--agent", f"{agents}:Slow", "-o", out, "--resume"]
    calls = 0
    for _ in range(2):
        process = subprocess.Popen(list(map(str, argv)), stdout=subprocess.DEVNULL)
        until(lambda calls=calls: lines(out) > calls, "more records")
        locked(out)
        process.send_signal(signal.SIGKILL)
        process.wait()
        calls = lines(out)
    pids = {int(pid) for pid in (agents.parent / "pids").read_text().split()}
    until(lambda: not any(is_running(pid) for pid in pids), "the workers end with their parent")
    with (out / "records.jsonl").open("ab") as file:
        file.write(b'{"agent": "cut')
    last = hijack(*map(str, argv[3:]))
    assert last.returncode == 0, last.stderr
    run = records.read(out)
    assert Counter(Counter(r["row"] for r in run.records).values()) == {1: 240}
    assert run.missing == 0
    assert not run.damaged


def lines(out):
    path = out / "records.jsonl"
    return path.read_bytes().count(b"\n") if path.exists() else 0


def locked(out):
    with pytest.raises((RunError, LockedError), match="is being written by"):
        records.hold(out)


def is_running(pid):
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


def test_another_run_is_refused(clicks, agents, tmp_path):
    out = tmp_path / "run"
    play_rows(settings_for(clicks, "fail"), out)
    score_run = ScoreRun(settings_for(clicks, "fail", near=Distance(8)))
    with pytest.raises(RunError, match="distance was"):
        score_run.begin(out, resume=True)
    with pytest.raises(RunError, match="holds a run already"):
        ScoreRun(settings_for(clicks, "fail")).begin(out, resume=False)
    moved_folder = shutil.copytree(clicks, tmp_path / "moved")
    ScoreRun(settings_for(moved_folder, "fail")).begin(out, resume=True).release()
    other_dataset = dataset(tmp_path, CLICKS[:1])
    with pytest.raises(RunError, match="is another run: content was"):
        ScoreRun(settings_for(other_dataset, "fail")).begin(out, resume=True)


def test_a_run_keeps_where_it_was_scored_and_what_agents_were_given(clicks, tmp_path):
    out, settings = tmp_path / "run", settings_for(clicks, "fail")
    play_rows(settings, out)
    head = json.loads((out / "run.json").read_text())
    expected = origin.describe(ScoreRun(settings).config(), workers=1)
    assert {key: head[key] for key in expected} == expected
    assert {tuple(record["given"]) for record in records.read(out).records} == {()}
    assert rebuild(out).problems == []

    head["git"]["agenthijack"] = {"commit": "0" * 40, "dirty": False}
    (out / "run.json").write_text(json.dumps(head))
    message = []
    ScoreRun(settings).begin(out, True, message.append).release()
    assert "was begun with commit 0000" in message[0]
    assert [line["workers"] for line in origin.sessions(out)] == [1]


def test_the_parameters_of_a_dataset_are_those_of_its_run(tmp_path):
    """A label alone was verified as an unknown corruption, and certified as the default of one."""
    planners = {"few": hj.Marks(number=3, mark_size=4), "marks": hj.Marks(number=5, mark_size=4)}
    record_steps(tmp_path / "source", CLICKS)
    build(tmp_path / "source", tmp_path / "built", corruptions=planners)
    run = play_rows(settings_for(tmp_path / "built", "fail"), tmp_path / "run")[1]
    report = build_report(run)
    assert report.run.corruptions == {"clean": "clean", "few": "marks", "marks": "marks"}
    assert report.run.changed == ("marks",)
    assert report.run.settings["few"] == {"number": 3, "mark_size": 4}
    assert rebuild(tmp_path / "run").problems == []


def test_what_is_selected(tmp_path):
    steps = [*CLICKS, {"action": {"type": "other"}, "target_box": None}, {"instruction": "c 1,1"}]
    folder = dataset(tmp_path, steps, "marks,resolution", splits={"train": 0.5, "test": 0.5})
    run = ScoreRun(settings_for(folder, "fail"))
    assert len(run.cases.cases) == 9
    assert run.cases.unscored == 3
    marks = ScoreRun(settings_for(folder, "fail", selection=Selection(corruptions=("marks",))))
    assert marks.cases.labels == ("clean", "marks")
    first = ScoreRun(settings_for(folder, "fail", selection=Selection(limit=2)))
    assert {case.corruption for case in first.cases.cases} == {"clean", "marks", "resolution"}
    assert len({case.task for case in first.cases.cases}) + first.cases.unscored // 3 == 2
    sizes = [
        len(ScoreRun(settings_for(folder, "fail", selection=Selection(split=name))).cases.cases)
        for name in ("train", "test")
    ]
    assert sum(sizes) == 9
    assert all(sizes)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--agent", "oracle"), "needs a task and a machine"),
        (("--agent", "rando"), "did you mean 'random'"),
        (("--agent", "fail", "--corruptions", "resolutio"), "did you mean 'resolution'"),
        (("--agent", "fail", "--corruptions", "clean,clean"), "given twice"),
        (("--agent", "fail", "--split", "test"), "no 'test' in the dataset"),
        (("--agent", "fail", "--ask", "reminders"), "has no check"),
        (("--agent", "fail", "--ask", "summaries"), "summaries are in an export"),
        (("--agent", "fail", "--distance", "far"), "must be pixels such as 32"),
        (("--agent", "fail"), "--out RUNS: say where"),
        (("--agent", "scripted"), "AGENTHIJACK_SCRIPT=FILE"),
    ],
)
def test_usage(words, message, clicks, capsys):
    from hijack_data.cli import main

    with pytest.raises(SystemExit) as ended:
        main(["score", str(clicks), *words])
    assert ended.value.code == 2
    assert message in capsys.readouterr().err


def test_an_agent_that_cannot_be_made_ends_the_run(clicks, agents, tmp_path):
    with pytest.raises(AgentSetupError, match="cannot be made: OSError: no such weights"):
        play_rows(settings_for(clicks, f"{agents}:Broken"), tmp_path / "run")


def test_a_folder_that_is_no_dataset(tmp_path):
    with pytest.raises(HijackError, match=r"manifest\.json is missing"):
        ScoreRun(settings_for(tmp_path, "fail"))


def test_a_damaged_row_is_invalid_and_the_others_are_scored(clicks, agents, tmp_path):
    folder = shutil.copytree(clicks, tmp_path / "dataset")

    def cut(pictures):
        pictures[1]["bytes"] = pictures[1]["bytes"][:50]

    edit(folder, "screenshot", cut)
    _, run = play_rows(settings_for(folder, f"{agents}:Knows"), tmp_path / "run")
    result = by_row(run)
    damaged = result.pop("t0/0000/resolution")
    assert (damaged["status"], damaged["cause"]) == ("invalid", "machine")
    assert {record["status"] for record in result.values()} == {"ok"}
    assert "invalid" in json.dumps(score_rows(run.records))


def test_a_click_outside_its_own_target_is_no_step_to_score(clicks, agents, tmp_path):
    folder = shutil.copytree(clicks, tmp_path / "dataset")

    def push(boxes):
        boxes[0] = [101, 40, 130, 60]  # the click is at 100, 50

    edit(folder, "target_box", push)
    _, run = play_rows(settings_for(folder, f"{agents}:Knows"), tmp_path / "run")
    result = by_row(run)
    wrong = result.pop("t0/0000/clean")
    assert (wrong["status"], wrong["cause"], wrong["score"]) == ("invalid", "machine", None)
    assert wrong["problem"] == (
        f"{folder}: row 't0/0000/clean': the recorded click at (100, 50) is outside its own"
        " target_box [101, 40, 130, 60] (x1, y1, x2, y2; the pixel at x2 is outside): correct the"
        " one that is wrong; mend the recording and build the dataset again"
    )
    assert {record["status"] for record in result.values()} == {"ok"}


@pytest.mark.parametrize(
    ("action", "kept"),
    [
        ({"type": "click", "x": 130, "y": 50}, False),
        ({"type": "drag", "x": 89, "y": 50, "x2": 100, "y2": 50}, False),
        ({"type": "drag", "x": 90, "y": 40, "x2": 300, "y2": 190}, True),
        ({"type": "scroll", "x": 10, "y": 10, "amount": 3}, True),
        ({"type": "type", "text": "hello"}, True),
    ],
)
def test_a_build_leaves_out_steps_that_miss_their_own_target(action, kept, tmp_path):
    record_steps(tmp_path / "source", [{}, {"action": action}])
    out = tmp_path / "dataset"
    report = build(tmp_path / "source", out, corruptions="resolution:scale=0.5", seed=7)
    assert (report.rejected, report.exit_code) == ((0, 0) if kept else (1, 1))
    if not kept:
        (line,) = (out / "quarantine.jsonl").read_text().splitlines()
        output = json.loads(line)
        assert output["field"] == "target_box"
        assert "1.png" in line
        assert "t1, step 0" in line
        assert "is outside its own target_box [90, 40, 130, 60]" in output["reason"]


def test_the_command_and_the_report(clicks, agents, tmp_path):
    out = tmp_path / "run"
    foreseen = hijack("score", clicks, "--agent", "fail", "--dry-run", "--json")
    assert json.loads(foreseen.stdout)["rows"] == {"clean": 2, "resolution": 2}
    result = hijack("score", clicks, "--agent", f"{agents}:Knows,fail", "-o", out)
    assert result.returncode == 0, result.stderr
    assert "right, in percent" in result.stdout
    value = hijack("report", out)
    assert value.returncode == 0, value.stderr
    assert value.stdout.splitlines()[0].endswith("Knows and fail on dataset")
    heads = [line.split()[:3] for line in value.stdout.splitlines()]
    assert ["corruption", "n", "success"] in heads
    assert "ecovery policy" not in value.stdout
    rows = json.loads(hijack("report", out, "--json").stdout)
    assert [row["success"] for row in rows] == [0.5, 0.5, 0, 0]
    head = json.loads((out / "run.json").read_text())
    assert head["config"]["kind"] == "score"
    assert head["config"]["code"][f"{agents}:Knows"]["path"] == str(agents)


def test_verify_finds_what_was_edited(clicks, tmp_path):
    out = tmp_path / "run"
    play_rows(settings_for(clicks, "fail"), out)
    report = rebuild(out)
    assert report.ok
    assert any("hijack score makes them again" in text for text in report.unproved)
    answers = len((out / "records.jsonl").read_text().splitlines())
    assert report.lines()[0] == f"{out}: {answers} answers to rows of a dataset: nothing differs"
    path = out / "records.jsonl"
    text_before = path.read_text()
    path.write_text(text_before.replace('"score": 0.0', '"score": 1.0', 1))
    assert any("line 2: does not follow on line 1" in text for text in rebuild(out).problems)
    path.write_text("".join(text_before.splitlines(keepends=True)[:-1]))
    assert any("1 of 4 planned episodes" in text for text in rebuild(out).problems)


def test_no_frame_of_ours_calls_the_agent(clicks, agents, tmp_path):
    _, run = play_rows(settings_for(clicks, f"{agents}:Nosy"), tmp_path / "run")
    for record in run.records:
        callers = [Path(name).name for name in record["said"].split()]
        assert "agent_server.py" in callers
        assert not {"asking.py", "feed.py", "workers.py"} & set(callers)


def test_selection_of_nothing(tmp_path):
    folder = dataset(tmp_path, [{"action": {"type": "other"}, "target_box": None}])
    with pytest.raises(ParameterError, match="2 have no action of a known type"):
        ScoreRun(settings_for(folder, "fail"))


def test_a_script_is_part_of_the_run(clicks, tmp_path, monkeypatch):
    script = tmp_path / "moves.yaml"
    script.write_text("- pyautogui.click(100, 50)\n")
    monkeypatch.setenv("AGENTHIJACK_SCRIPT", str(script))
    out = tmp_path / "run"
    _, run = play_rows(settings_for(clicks, "scripted"), out)
    assert {row: r["score"] for row, r in by_row(run).items()}["t1/0000/clean"] == 1
    script.write_text("- DONE\n")
    with pytest.raises(RunError, match=r"code\.scripted\.settings\.sha256"):
        ScoreRun(settings_for(clicks, "scripted")).begin(out, resume=True)
    assert os.environ["AGENTHIJACK_SCRIPT"]


def test_trajectories_of_any_script_have_records_of_their_own(agents, tmp_path):
    """An id keeps a-z and digits: 任务一 and 任务二 would be one, and a record of it lost."""
    names = ("任务一", "任务二", "a b", "a_b")
    steps = [{"trajectory_id": name, **CLICKS[0]} for name in names]
    folder = dataset(tmp_path, steps)
    _, run = play_rows(settings_for(folder, f"{agents}:Knows"), tmp_path / "run")
    assert not run.damaged
    assert not run.missing
    assert {record["task"] for record in run.records} == set(names)
    assert len(run.records) == 8
    assert rebuild(tmp_path / "run").problems == []


def test_names_that_one_id_stands_for_are_refused(agents, tmp_path):
    folder = dataset(tmp_path, [{"trajectory_id": name, **CLICKS[0]} for name in ("a:b", "a_b")])
    with pytest.raises(RunError, match="ids stand for several episodes, such as 'a_b_0000__clean"):
        play_rows(settings_for(folder, f"{agents}:Knows"), tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_corruption_of_which_no_row_is_left_is_refused(clicks, agents, tmp_path):
    folder = shutil.copytree(clicks, tmp_path / "dataset")

    def rename(labels):
        labels[labels.index("resolution")] = "marks"

    edit(folder, "corruption", rename)
    selection = Selection(corruptions=("marks",), limit=1)
    assert ScoreRun(settings_for(folder, "fail", selection=selection)).cases.labels == (
        "clean",
        "marks",
    )
    selection = Selection(corruptions=("marks", "resolution"), limit=1)
    with pytest.raises(ParameterError, match=r"no row of 'resolution' is left.*the dataset has 1"):
        ScoreRun(settings_for(folder, "fail", selection=selection))
