import json
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import hijack_data as hj
from hijack_data.plugin import InputFault
from hijack_data.types import Action
from pipelines import build, open_dataset
from pipelines.dataset.columns import ACTION
from pipelines.exports import Example, export
from pipelines.exports.atif import AtifWriter
from pipelines.exports.example import ABOUT
from pipelines.readers import detect_format
from pipelines.readers.recorded_pictures import read_picture

from support.formats import atif, png, write_json
from support.recordings import read_source

RECORDS = "trial-1/agent/trajectory.json"

read = partial(read_source, name="atif")


def change(folder: Path, **arguments: Any) -> None:
    """Give the first agent step another call."""
    record = json.loads((folder / RECORDS).read_text())
    record["steps"][1]["tool_calls"][0].update(arguments)
    write_json(folder / RECORDS, record)


@pytest.mark.parametrize(
    ("name", "arguments", "expected"),
    [
        ("computer", {"type": "double_click", "x": 30, "y": 20}, Action("double_click", 30, 20)),
        # Every field is there, as Harbor writes them.
        (
            "computer_action",
            {"type": "drag", "x": 30, "y": 20, "end_x": 40, "end_y": 25, "text": None},
            Action("drag", 30, 20, 40, 25),
        ),
        (
            "computer_action",
            {"type": "click", "x": 30, "y": 20, "button": "right"},
            Action("right_click", 30, 20),
        ),
        ("computer_action", {"type": "scroll", "x": 3, "y": 2}, Action("other", 3, 2)),
        (
            "computer_action",
            {"type": "keypress", "keys": ["ctrl", "S"]},
            Action("hotkey", keys=("ctrl", "S")),
        ),
        ("mark_task_complete", {"result": "ok"}, Action("done")),
        (
            "desktop_action",
            {"type": "key_down", "keys": ["shift"]},
            Action("key_down", keys=("shift",)),
        ),
    ],
)
def test_tools_whose_coordinates_are_known(
    name: str, arguments: dict[str, Any], expected: Action, tmp_path: Path
) -> None:
    atif(tmp_path)
    change(tmp_path, function_name=name, arguments=arguments)
    (trajectory,), rejected = read(tmp_path)
    assert not rejected
    assert trajectory.steps[0].action == expected


@pytest.mark.parametrize(
    ("call", "reason"),
    [
        ({"function_name": "tap"}, "does not say what its coordinates count"),
        ({"arguments": {"action": "left_click", "coordinate": [400, 3]}}, "outside the 400x200"),
        (
            {"function_name": "computer_action", "arguments": {"type": "jump"}},
            "is not an action of computer_action",
        ),
    ],
)
def test_other_calls_are_rejected(call: dict[str, Any], reason: str, tmp_path: Path) -> None:
    atif(tmp_path)
    change(tmp_path, **call)
    (trajectory,), (rejected,) = read(tmp_path)
    assert reason in rejected.reason
    assert (rejected.file, rejected.where) == (RECORDS, "step 2")
    assert len(trajectory.steps) == 1


def test_a_screen_is_that_of_the_step_before(tmp_path: Path) -> None:
    atif(tmp_path)
    record = json.loads((tmp_path / RECORDS).read_text())
    record["steps"][0]["message"] = "do it"  # as Harbor's agent, which shows none with the task
    write_json(tmp_path / RECORDS, record)
    (trajectory,), (rejected,) = read(tmp_path)
    assert rejected.reason == "no screenshot came before this action"
    (step,) = trajectory.steps
    assert read_picture(step.image, "") == png(1)


def test_an_agent_without_a_screen_is_one_rejection(tmp_path: Path) -> None:
    call = {"tool_call_id": "c", "function_name": "bash", "arguments": {"command": "ls"}}
    step = {"step_id": 1, "source": "agent", "message": "", "tool_calls": [call]}
    record = {"schema_version": "ATIF-v1.4", "session_id": "s", "steps": [step, step]}
    write_json(tmp_path / "trajectory.json", record)
    trajectories, (rejected,) = read(tmp_path)
    assert not trajectories
    assert "show no screenshot" in rejected.reason


@pytest.fixture
def exported(recording: Any, add_line: Any, good_line: Any, tmp_path: Path) -> Path:
    """The export of a recording with every kind of action, and a step missing in it."""
    source = recording(trajectories=1, steps=1)
    remaining = [
        {"type": "drag", "x": 1, "y": 2, "x2": 3, "y2": 4},
        {"type": "scroll", "x": 1, "y": 2, "amount": -3.0},
        {"type": "type", "text": "a <b> ü"},
        {"type": "hotkey", "keys": ["ctrl", "s"]},
        {"type": "wait"},
        {"type": "done"},
    ]
    for number, action in enumerate(remaining, 3):  # steps 1 and 2 are missing
        (source / f"images/t0-{number}.png").write_bytes(png(number, 320, 200))
        add_line(source, good_line("t0", number, action=action, target_box=None))
    build(source, tmp_path / "set", corruptions={"half": hj.Resolution(scale=0.5)})
    report = export(tmp_path / "set", tmp_path / "atif", to="atif")
    assert report.total == 14
    assert report.notes == ["2 times steps are missing within an episode; a system step says so"]
    return tmp_path


def test_our_export_is_valid(exported: Path) -> None:
    atif_models = pytest.importorskip("atif", reason="the PyPI package atif validates the export")
    documents = sorted((exported / "atif").rglob("trajectory.json"))
    assert len(documents) == 2
    for document in documents:
        parsed = atif_models.Trajectory.model_validate_json(document.read_bytes())
        assert parsed.has_multimodal_content()
        assert [step.source for step in parsed.steps[:4]] == ["user", "agent", "system", "agent"]
        for step in parsed.steps:
            result = step.observation.results[0].content if step.observation else []
            for part in [*result, *(step.message if isinstance(step.message, list) else [])]:
                assert part.type == "text" or (document.parent / part.source.path).is_file()


NOTHING = {**dict.fromkeys(ACTION), "type": "click"}
SEVERAL = {"action_code": "Action: wait()\n\nclick(start_box='(1,2)')\n\ntype(content='a')"}
LOCK = {"event": "The session was locked.", "inserted": False}
MINIMISED = {"event": "All windows were minimised.", "inserted": True}
LOST = {"event": "It got lost.", "inserted": True, "plan": InputFault("drop")}


@pytest.mark.parametrize(
    ("first", "following", "text"),
    [
        (MINIMISED, 2, None),  # its action leads back to the recorded step
        (MINIMISED, 3, "Steps 2 to 2 of the recording are not exported."),
        (LOST, 3, None),  # its action is the recorded one
        (SEVERAL, 3, "What followed was not recorded; this is the screen of step 3."),
        (LOCK, 3, "What followed was not recorded; this is the screen of step 3."),
    ],
)
def test_a_screen_is_never_the_result_of_an_action_that_did_not_lead_to_it(
    first: dict[str, Any], following: int, text: str | None, tmp_path: Path
) -> None:
    columns = {**dict.fromkeys(ABOUT, ""), "instruction": "do it", "action": NOTHING}
    clean = {
        **columns,
        "action_code": "",
        "event": None,
        "inserted": False,
        "plan": hj.Plan.clean((9, 9)),
    }
    rows = [{**clean, **first, "step": 2}, {**clean, "step": following}]
    for row in rows:
        if isinstance(row["plan"], InputFault):
            row["plan"] = replace(hj.Plan.clean((9, 9)), inputs=(row["plan"],))
        row["plan"] = row["plan"].to_json()
    writer = AtifWriter(tmp_path)
    examples = (Example(f"0-{k}", row, "", "WAIT", b"") for k, row in enumerate(rows))
    writer.shard(0, examples)
    writer.finish()
    document = json.loads(next(tmp_path.rglob("trajectory.json")).read_text())
    assert [s["message"] for s in document["steps"] if s["source"] == "system"] == [text] * bool(
        text
    )


def test_our_export_comes_back(exported: Path) -> None:
    assert detect_format(exported / "atif") == "atif"
    (trajectory,), rejected = read(exported / "atif")
    clean = [row for row in open_dataset(exported / "set") if row["corruption"] == "clean"]
    assert {r.field for r in rejected} == {"extra.corruption"}
    assert trajectory.id == "t0/clean"
    assert (trajectory.instruction, trajectory.domain) == ("do t0", "tests")
    assert len(trajectory.steps) == len(clean) == 7
    for step, row in zip(trajectory.steps, clean, strict=True):
        output = {name: value for name, value in row["action"].items() if value is not None}
        assert {k: v for k, v in asdict(step.action).items() if v is not None} == {
            **output,
            **({"keys": tuple(output["keys"])} if "keys" in output else {}),
        }
        assert step.index == row["step"]
        assert list(step.target_box or ()) == (row["target_box"] or [])
    build(exported / "atif", exported / "again")
    again = [row for row in open_dataset(exported / "again") if row["corruption"] == "clean"]
    assert [row["image_sha256"] for row in again] == [row["image_sha256"] for row in clean]


def test_the_same_rows_give_the_same_bytes(exported: Path) -> None:
    export(exported / "set", exported / "twice", to="atif")
    for file in sorted(p for p in (exported / "atif").rglob("*") if p.is_file()):
        again = exported / "twice" / file.relative_to(exported / "atif")
        assert again.read_bytes() == file.read_bytes()
