"""Rows of input faults: a lost action in any recording, other faults in runs that were played under
them."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")
pytest.importorskip("pyarrow", reason="needs the extra [hf]")

import hijack_data as hj
from hijack_data.actions.input_faults import moves_from_pointer
from hijack_data.actions.pyautogui_functions import LIVE_FUNCTIONS
from hijack_data.actions.pyautogui_grammar import read_calls
from hijack_data.actions.python_source import ParsedSource
from hijack_data.actions.recorded_actions import holds_several
from hijack_data.errors import HijackError
from hijack_data.types import Action
from online_env.environment import CorruptedEnv
from online_env.scoring.cases import Selection, open_feed, select_cases
from pipelines import build, open_dataset, verify
from pipelines.edits.input_faults import DONE_AGAIN, NO_PICTURE, NOT_REPAIRED, OTHER_FAULT
from pipelines.exports import export
from pipelines.readers import Rejected, get_reader

from support.live import AT_ONCE, FakeStage
from support.tampering import renew

CLICK, BACK, TYPE = "pyautogui.click(20, 30)", "pyautogui.press('esc')", "pyautogui.write('a')"
LOST = "The last action did not arrive: nothing was pressed."


def rows_of(dataset: Path, label: str) -> list[dict[str, Any]]:
    return [row for row in open_dataset(dataset) if row["corruption"] == label]


def names(rows: list[dict[str, Any]], trajectory: str) -> list[str]:
    start = f"{trajectory}/"
    return [row["id"].removeprefix(start) for row in rows if row["id"].startswith(start)]


def table(folder: Path, name: str) -> list[dict[str, Any]]:
    return [
        row for file in (folder / name).glob("*.parquet") for row in pq.read_table(file).to_pylist()
    ]


def test_a_lost_action_is_done_again_on_the_screen_that_was_before_it(recording, tmp_path):
    source = recording(trajectories=2, steps=4)
    out = tmp_path / "set"
    report = build(source, out, corruptions={"lost": hj.make_corruption("missed_input", step=1)})
    lost_rows, clean = rows_of(out, "lost"), rows_of(out, "clean")
    assert names(lost_rows, "t0") == ["0001/lost", "0001/lost+drop", "0002/lost"]
    first, again, after = lost_rows[:3]
    assert [row["event"] for row in lost_rows[:3]] == [None, LOST, None]
    assert [row["fidelity"] for row in lost_rows[:3]] == ["exact", "recorded", "exact"]
    assert again["inserted"]
    assert again["reminder"] is None
    for row, step in ((first, 1), (again, 1), (after, 2)):
        assert np.array_equal(row["screenshot"], clean[step]["screenshot"])
        for name in ("action", "action_code", "target_box", "step"):
            assert row[name] == clean[step][name]
        assert [fault.fault for fault in hj.Plan.from_json(row["plan"]).inputs] == ["drop"]
    assert report.rows["lost"] == 6
    assert "The pictures of events" not in (out / "README.md").read_text()
    assert verify(out).ok
    assert verify(out, source=source).ok


def test_exports_of_a_lost_action_have_the_action_before(recording, tmp_path):
    build(recording(trajectories=1, steps=4), tmp_path / "set", corruptions="missed_input:step=1")
    for form in ("chat", "verl", "webdataset", "atif", "onlooker"):
        assert export(tmp_path / "set", tmp_path / form, to=form).exit_code == 0
    chats = map(json.loads, (tmp_path / "chat/train.jsonl").read_text().splitlines())
    chats_by_id = {chat["id"]: chat for chat in chats}
    click = "pyautogui.click(101, 50)"
    for name, answer in (
        ("1/missed_input+drop", click),
        ("2/missed_input", "pyautogui.click(102, 50)"),
    ):
        chat = chats_by_id[f"t0/000{name}"]
        question, reply = chat["messages"]
        assert question["content"].count("<image>") == len(chat["images"]) == 2
        assert f"Your last action: {click}\n" in question["content"]
        assert reply["content"] == answer
        assert all((tmp_path / "chat" / image).is_file() for image in chat["images"])
    assert len(chats_by_id["t0/0001/missed_input"]["images"]) == 1
    verl = {row["extra_info"]["id"]: len(row["images"]) for row in table(tmp_path / "verl", "data")}
    assert verl["t0/0001/missed_input+drop"] == 2

    documents = [json.loads(path.read_text()) for path in tmp_path.glob("atif/*/*/trajectory.json")]
    (episode,) = (d for d in documents if d["trajectory_id"].endswith("/missed_input"))
    steps = [step for step in episode["steps"] if step["source"] == "agent"]
    assert [step["message"] for step in steps] == [click, click, "pyautogui.click(102, 50)"]
    assert steps[0]["observation"]["results"][0]["content"]

    summaries = {row["before_id"]: row for row in table(tmp_path / "onlooker", "summaries")}
    lost_summary = summaries["t0/0001/missed_input"]
    assert (
        lost_summary["summary"] == f"The agent clicked at (101, 50). Not the agent's doing: {LOST}"
    )
    assert lost_summary["before"]["bytes"] == lost_summary["after"]["bytes"]
    arrived = summaries["t0/0001/missed_input+drop"]
    assert arrived["id"] == "t0/0002/missed_input"
    assert arrived["changed"] > 0.5
    # One picture does not show it, so there is neither a reminder pair nor a recovery step.
    assert not (tmp_path / "onlooker/reminders").exists()
    assert not (tmp_path / "onlooker/recovery").exists()

    # an agent that is scored on one picture cannot know what happened
    cases = select_cases(open_feed(tmp_path / "set", "steps"), "steps", Selection())
    assert (cases.labels, cases.unchanged) == (("clean",), 3)


@pytest.mark.parametrize(
    ("code", "is_other"),
    [
        ("dragTo(9, 9)", True),  # the pointer has moved to its end, so it would drag nothing
        ("moveTo(1, 1)\npyautogui.dragTo(9, 9)", False),
        ("click()\npyautogui.moveTo(9, 9)", True),
        ("moveTo(9, 9)\npyautogui.click()", False),
        ("mouseDown()\npyautogui.moveTo((9, 9))\npyautogui.mouseUp()", True),
        ("mouseDown((1, 1))\npyautogui.moveTo(9, 9)\npyautogui.mouseUp()", False),
        ("scroll(-3)\npyautogui.click(9, 9)", True),
        ("moveRel(1, 1)", True),
        ("click()", False),
        ("press('a')\npyautogui.click(9, 9)", False),
    ],
)
def test_an_action_that_begins_at_the_pointer_and_moves_it_cannot_be_done_again(
    code: str, is_other: bool
) -> None:
    calls = read_calls(ParsedSource(f"pyautogui.{code}"), LIVE_FUNCTIONS)
    assert moves_from_pointer(calls) is is_other


@pytest.mark.parametrize(
    ("code", "several"),
    [
        ("Action: click(start_box='(1,2)')\n\ntype(content='a')", True),
        ("Action: click(start_box='(1,2)')\n\nwait()", False),
        ("Action: click(start_box='(1,2)')", False),
        ('[{"type": "click", "x": 1, "y": 2}, {"type": "type", "text": "a"}]', True),
        ('[{"type": "click", "x": 1, "y": 2}, {"type": "wait"}]', False),
        ('[{"action_type": "PlanAction"}, {"action_type": "PlanAction"}]', False),
        ('{"type": "click", "x": 1, "y": 2}', False),
        ("pyautogui.click(1, 2)\npyautogui.write('a')", False),  # the action is all of it
        ("Click [5] and type 'a'", False),
        ("", False),
    ],
)
def test_a_reply_with_several_actions_is_known(code: str, several: bool) -> None:
    assert holds_several(code, Action("click", 1, 2)) is several


def test_verify_finds_another_label_of_a_lost_action(recording, tmp_path):
    out = tmp_path / "set"
    build(recording(trajectories=1), out, corruptions="missed_input:step=1")
    (path,) = out.glob("data/*.parquet")
    stored = pq.read_table(path)
    for change, problem in (
        ({"event": "The last action arrived 2 times."}, "event is"),
        ({"inserted": False}, "inserted is"),
        ({"action_code": "pyautogui.click(1, 1)"}, "action_code is"),
        ({"reminder": "Do it again."}, "reminder is"),
    ):
        rows = stored.to_pylist()
        (row,) = (row for row in rows if row["inserted"])
        row.update(change)
        pq.write_table(type(stored).from_pylist(rows, schema=stored.schema), path)
        assert any(problem in text for text in verify(out).problems)


def forge(dataset: Path, name: str, place: int, change: dict[str, Any]) -> list[str]:
    """Add a copy of the last row of a step with another label; return what `verify` finds."""
    (path,) = dataset.glob("data/*.parquet")
    stored = pq.read_table(path)
    rows = stored.to_pylist()
    rows.insert(place, {**rows[place - 1], **change})
    pq.write_table(type(stored).from_pylist(rows, schema=stored.schema), path)

    def count(manifest: dict[str, Any]) -> None:
        manifest["rows"] += 1
        manifest["counts"]["rows"][name] += 1
        (shard,) = manifest["shards"]
        shard["rows"] += 1
        shard["counts"]["rows"][name] += 1

    renew(dataset, count)
    return verify(dataset).problems


FAULT_COLUMNS = ("corruption", "params", "plan", "plan_digest", "severity", "event", "fidelity")


def test_verify_refutes_a_lost_action_by_the_rows_alone(recording, tmp_path):
    source = recording(trajectories=1)
    build(source, tmp_path / "set", corruptions="missed_input:step=1")
    again = next(row for row in rows_of(tmp_path / "set", "missed_input") if row["inserted"])
    columns = {name: again[name] for name in FAULT_COLUMNS}
    forged = {**columns, "id": "t0/0002/missed_input+drop", "inserted": True}
    (problem,) = forge(tmp_path / "set", "missed_input", 6, forged)
    assert "row t0/0002/missed_input+drop: its step, the seed" in problem

    # Without clean rows nothing says which actions came before, and the report says so.
    path = source / "trajectories.jsonl"
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    lines[2].update(action={"type": "wait"}, action_code="WAIT")
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    for change, expected in (
        ({}, "the fault cannot hit its action"),
        ({"inserted": False, "image_sha256": None}, "has another picture"),
    ):
        out = tmp_path / f"without {expected}"
        build(source, out, corruptions="missed_input:step=1", clean=False)
        assert verify(out).ok
        assert "not checked without --source" in verify(out).lines()[-1]
        (path,) = out.glob("data/*.parquet")
        first = pq.read_table(path).to_pylist()[0]
        picture = {name: first[name] for name in ("screenshot", "image_sha256") if change}
        problems = forge(out, "missed_input", 3, {**forged, **change, **picture})
        assert any(expected in text for text in problems)


def test_verify_names_the_trajectories_that_lack_a_clean_row(recording, tmp_path):
    source = recording(trajectories=2)
    picture = source / "images/t1-0.png"
    picture.write_bytes(picture.read_bytes()[:-100])
    build(source, tmp_path / "set", corruptions="missed_input:step=1")
    report = verify(tmp_path / "set")
    assert report.ok
    (note,) = report.unproved
    assert note.startswith("the rows of missed_input of t1 were not made again")
    assert verify(tmp_path / "set", source=source).lines()[1:] == []


def test_actions_that_cannot_be_done_again_and_mixed_labels_are_refused(recording, tmp_path):
    source = recording(trajectories=1, steps=2)
    lines = [json.loads(line) for line in (source / "trajectories.jsonl").read_text().splitlines()]
    lines[0].update(action_code="pyautogui.moveRel(5, 5)\npyautogui.click(100, 50)")
    lines[1].update(action={"type": "wait"}, action_code="WAIT")
    (source / "trajectories.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    planners = {f"at_{step}": hj.make_corruption("missed_input", step=step) for step in (0, 1, 7)}
    report = build(source, tmp_path / "set", corruptions=planners)
    reasons = {label: " ".join(counts) for label, counts in report.not_applicable.items()}
    assert report.rows == {"clean": 2, "at_0": 0, "at_1": 0, "at_7": 0}
    assert "begins where the pointer is" in reasons["at_0"]
    assert "presses anything" in reasons["at_1"]
    assert "ends before the step" in reasons["at_7"]
    mixed = hj.Sequence([hj.make_corruption("missed_input"), hj.Marks()])
    with pytest.raises(HijackError, match="joins missed_input with other corruptions"):
        build(source, tmp_path / "mixed", corruptions={"both": mixed})
    twice = hj.Sequence([hj.make_corruption("missed_input", step=0)] * 2)
    with pytest.raises(HijackError, match=r"twice: .* plans 'drop' twice at one step"):
        build(source, tmp_path / "twice", corruptions={"twice": twice})


def test_lost_actions_of_real_recordings(shared_data, tmp_path):
    source = shared_data / "trajectories/screenagent"
    report = build(source, tmp_path / "set", corruptions="missed_input", output="lazy", limit=8)
    rows = rows_of(tmp_path / "set", "missed_input")
    clean = {(row["trajectory_id"], row["step"]): row for row in rows_of(tmp_path / "set", "clean")}
    again = [row for row in rows if row["inserted"]]
    assert len(rows) == report.rows["missed_input"] == 3 * len(again) >= 9
    for row in rows:
        recorded = clean[row["trajectory_id"], row["step"]]
        assert row["image_sha256"] == recorded["image_sha256"]
        assert row["action"] == recorded["action"]
    assert {row["action"]["type"] for row in again} <= {"click", "double_click"}
    assert verify(tmp_path / "set", source=source).ok


# --- Runs of the benchmark


@pytest.fixture(autouse=True)
def no_waiting(monkeypatch):
    monkeypatch.setattr("online_env.environment.episode.WAIT_S", 0.0)


def play_episode(
    folder: Path, name: str | None, score: float = 1.0, later: tuple[str, ...] = (BACK, CLICK)
) -> dict[str, Any]:
    """An episode whose action at step 1 is hit, and which then goes on; its record."""
    spec = None if name is None else hj.make_corruption(name, step=1)
    env = CorruptedEnv(FakeStage(score=score), corruption=spec, settle=AT_ONCE, log=folder)
    env.reset(seed=3)
    for action in ("WAIT", CLICK, *later, "DONE"):
        env.step(action)
    assert env.record["status"] == "ok"
    return env.record


EVENTS = {
    "missed_input": LOST,
    "repeated_input": "The last action arrived 2 times.",
    "slipped_pointer": "The pointer slipped: the last action landed beside where it aimed.",
}


@pytest.mark.parametrize("name", EVENTS)
def test_a_run_under_a_fault_proves_what_followed_it(name, tmp_path):
    record = play_episode(tmp_path / "run", name)
    (folder,) = (tmp_path / "run/episodes").iterdir()
    sent_events = json.loads((folder / "steps.jsonl").read_text().splitlines()[1])["input"]["sent"]
    assert sent_events != CLICK
    report = build(tmp_path / "run", tmp_path / "set", corruptions=f"{name}:step=1", seed=3)
    assert report.exit_code == 0
    rows = rows_of(tmp_path / "set", name)
    is_lost = name == "missed_input"  # then any recording proves the picture before the action
    after = f"0001/{name}+drop" if is_lost else f"0002/{name}"
    assert names(rows, record["id"]) == [f"0001/{name}", after]
    assert [row["action_code"] for row in rows] == [CLICK, CLICK if is_lost else BACK]
    assert [row["event"] for row in rows] == [None, EVENTS[name]]
    clean = rows_of(tmp_path / "set", "clean")
    assert [row["action_code"] for row in clean] == ["WAIT", CLICK, BACK, CLICK, "DONE"]
    assert np.array_equal(rows[1]["screenshot"], clean[1 if is_lost else 2]["screenshot"])
    assert json.loads(clean[1]["extra"])["input"]["sent"] == sent_events
    assert verify(tmp_path / "set").ok
    assert verify(tmp_path / "set", source=tmp_path / "run").ok

    export(tmp_path / "set", tmp_path / "onlooker", to="onlooker")
    summaries = {
        row["before_id"]: row["summary"] for row in table(tmp_path / "onlooker", "summaries")
    }
    for label in ("clean", name):
        assert summaries[f"{record['id']}/0001/{label}"].endswith(f"doing: {EVENTS[name]}")

    columns = {column: rows[1][column] for column in FAULT_COLUMNS}
    forged = {**columns, "id": f"{record['id']}/0003/{name}"}
    (problem,) = forge(tmp_path / "set", name, 6, forged)
    assert f"0003/{name}: its step, the seed and the parameters" in problem


def test_what_no_run_shows_is_refused(tmp_path):
    play_episode(tmp_path / "clean", None)
    faults = "repeated_input:step=1,slipped_pointer:step=1"
    report = build(tmp_path / "clean", tmp_path / "set", corruptions=faults)
    reasons = {NO_PICTURE: 1}
    assert report.not_applicable == {"repeated_input": reasons, "slipped_pointer": reasons}
    play_episode(tmp_path / "run", "slipped_pointer")
    corruptions = "slipped_pointer:step=1,distance=4"
    report = build(tmp_path / "run", tmp_path / "other", corruptions=corruptions, seed=3)
    assert report.not_applicable == {"slipped_pointer": {OTHER_FAULT: 1}}


@pytest.mark.parametrize(
    ("name", "later", "reason"),
    [
        ("slipped_pointer", (BACK, BACK, CLICK), None),
        ("slipped_pointer", (BACK, BACK), NOT_REPAIRED),
        ("slipped_pointer", (TYPE, BACK, CLICK, TYPE), DONE_AGAIN),
        ("repeated_input", (BACK, CLICK, BACK), DONE_AGAIN),
        ("repeated_input", (), None),
    ],
)
def test_what_the_agent_did_next_must_have_been_right(name, later, reason, tmp_path):
    play_episode(tmp_path / "run", name, later=later)
    report = build(tmp_path / "run", tmp_path / "set", corruptions=f"{name}:step=1", seed=3)
    assert report.not_applicable == ({name: {reason: 1}} if reason else {})
    assert report.rows[name] == (0 if reason else 2)


def test_of_an_episode_that_was_lost_nothing_after_the_fault_is_read(tmp_path):
    play_episode(tmp_path / "run", "slipped_pointer", score=0.0)
    rejected, recording = get_reader("runs").read(tmp_path / "run")
    assert [step.action_code for step in recording] == ["WAIT", CLICK]
    assert isinstance(rejected, Rejected)
    assert "did not arrive as the agent did it" in rejected.reason
    report = build(tmp_path / "run", tmp_path / "set", corruptions="slipped_pointer:step=1", seed=3)
    assert report.rows == {"clean": 2, "slipped_pointer": 0}
    (reason,) = report.not_applicable["slipped_pointer"]
    assert "was not solved" in reason
