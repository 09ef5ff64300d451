"""cua, GUI-Odyssey, AndroidControl and Multimodal-Mind2Web, in the layouts in which they are
published."""

import json
from pathlib import Path
from typing import Any

import pytest

from hijack_data.types import Action
from pipelines.readers import RecordedTrajectory, detect_format
from pipelines.readers.recorded_pictures import read_picture
from pipelines.readers.recording_facts import stated_screen

from support.formats import Shots, android_control, cua, gui_odyssey, png, write_json, write_table
from support.recordings import read_source

TALL = Shots(
    picture=lambda number: png(number, 1080, 2400), size=(1080, 2400), clicks=((0, 0), (10, 10))
)


def change(file: Path, *keys: Any, value: Any) -> None:
    record = part = json.loads(file.read_text())
    for key in keys[:-1]:
        part = part[key]
    part[keys[-1]] = value
    write_json(file, record)


def test_cua_gives_each_action_the_screen_before_it(tmp_path: Path) -> None:
    cua(tmp_path, Shots(clicks=((10, 10), (20, 20), (30, 30))))
    (trajectory,), rejected = read_source(tmp_path, "cua")
    assert not rejected
    assert [s.action for s in trajectory] == [
        Action("click", 100, 50),
        Action("click", 200, 100),
        Action("click", 300, 150),
        Action("wait"),
    ]
    assert [read_picture(s.image, "") for s in trajectory] == [png(i) for i in range(4)]
    assert trajectory.id == "2025-08-01_a-model_101500_ab12"


def test_cua_without_a_look_has_no_screen_for_the_first_action(tmp_path: Path) -> None:
    cua(tmp_path)
    (first,) = tmp_path.glob("*/turn_000/*_computer_call_result.json")
    first.unlink()
    next(tmp_path.glob("*/turn_000/*_screenshot_after.png")).unlink()
    (trajectory,), (rejected,) = read_source(tmp_path, "cua")
    assert "before this action" in rejected.reason
    assert [read_picture(s.image, "") for s in trajectory] == [png(1)]


@pytest.mark.parametrize(
    ("action", "reason"),
    [
        ({"type": "click", "button": "left", "x": 400, "y": 0}, "outside the 400x200"),
        ({"type": "click", "button": "left", "x": 0.25, "y": 0.25}, "fractions"),
        ({"type": "fly"}, "fly"),
        (None, "dict"),
    ],
)
def test_a_bad_call_of_cua_never_loses_the_rest(action: Any, reason: str, tmp_path: Path) -> None:
    cua(tmp_path)
    (file,) = tmp_path.glob("*/turn_001/*_computer_call_result.json")
    change(file, "item", "action", value=action)
    (trajectory,), (rejected,) = read_source(tmp_path, "cua")
    assert reason in rejected.reason
    assert [s.action.type for s in trajectory] == ["wait"]


def test_a_function_of_cua_does_not_say_its_space(tmp_path: Path) -> None:
    cua(tmp_path)
    (file,) = tmp_path.glob("*/turn_001/*_computer_call_result.json")
    file.rename(file.with_name(file.name.replace("computer_call", "function_call")))
    _, (rejected,) = read_source(tmp_path, "cua")
    assert "does not say what its coordinates count" in rejected.reason


@pytest.mark.parametrize(
    ("name", "maker"), [("gui_odyssey", gui_odyssey), ("android_control", android_control)]
)
@pytest.mark.parametrize("shots", [Shots(), TALL])
def test_phones(name: str, maker: Any, shots: Shots, tmp_path: Path) -> None:
    maker(tmp_path, shots=shots)
    (trajectory,), rejected = read_source(tmp_path, name)
    assert not rejected
    assert [s.action.point for s in trajectory][:-1] == shots.pixels
    assert [read_picture(s.image, "") for s in trajectory] == [
        shots.picture(i) for i in range(len(shots.clicks) + 1)
    ]
    assert isinstance(trajectory, RecordedTrajectory)
    assert (trajectory.screen, trajectory.domain) == ("phone", "android")


@pytest.mark.parametrize(
    ("step", "expected"),
    [
        ({"action": "CLICK", "info": "KEY_HOME"}, Action("other")),
        ({"action": "LONG_PRESS", "info": [[250, 250]]}, Action("other", 100, 50)),
        ({"action": "SCROLL", "info": [[500, 750], [500, 250]]}, Action("drag", 200, 150, 200, 50)),
        ({"action": "TYPE", "info": "hello"}, Action("type", text="hello")),
        ({"action": "IMPOSSIBLE", "info": ""}, Action("fail")),
        ({"action": "CLICK", "info": [[1200, 5]]}, "1200"),
        ({"action": "CLICK", "info": [[0.5, 0.5]]}, "fractions"),
        ({"action": "CLICK", "info": [[5]]}, "1 point"),
        ({"action": "FLY", "info": ""}, "FLY"),
    ],
)
def test_actions_of_gui_odyssey(step: Any, expected: Any, tmp_path: Path) -> None:
    gui_odyssey(tmp_path)
    file = tmp_path / "annotations" / "e1.json"
    change(file, "steps", 0, value={"step": 0, "screenshot": "e1_0.png", **step})
    (trajectory,), rejected = read_source(tmp_path, "gui_odyssey")
    if isinstance(expected, str):
        assert [expected in r.reason for r in rejected] == [True]
        assert [s.action.type for s in trajectory] == ["done"]
    else:
        assert (trajectory.steps[0].action, rejected) == (expected, [])


@pytest.mark.parametrize(
    ("action", "expected"),
    [
        ({"action_type": "input_text", "text": "hello"}, Action("type", text="hello")),
        ({"action_type": "scroll", "direction": "down"}, Action("other")),
        ({"action_type": "open_app", "app_name": "Clock"}, Action("other")),
        ({"action_type": "long_press", "x": 100, "y": 50}, Action("other", 100, 50)),
        (
            {"action_type": "type", "x": 100, "y": 50, "text": "a"},
            Action("other", 100, 50, text="a"),
        ),
        ({"action_type": "wait"}, Action("wait", amount=5)),
        ({"action_type": "click", "x": 400, "y": 50}, "outside"),
        ({"action_type": "click", "x": 0.25, "y": 0.25}, "fractions"),
        ({"action_type": "click"}, "number"),
        ({"action_type": "scroll", "direction": "away"}, "away"),
    ],
)
def test_actions_of_android_control(action: Any, expected: Any, tmp_path: Path) -> None:
    android_control(tmp_path)
    change(tmp_path / "7.json", "actions", 0, value=action)
    (trajectory,), rejected = read_source(tmp_path, "android_control")
    if isinstance(expected, str):
        assert [expected in r.reason for r in rejected] == [True]
        assert len(trajectory.steps) == 1
    else:
        assert (trajectory.steps[0].action, rejected) == (expected, [])
        assert trajectory.apps == (("Clock",) if "app_name" in action else ())


@pytest.mark.parametrize("name", ["android_control-00000-of-00020", "general.tfrecord"])
def test_tfrecord_is_refused_with_the_way_out(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(b"\x1f\x8b")
    assert detect_format(tmp_path) == detect_format(tmp_path / name) == "android_control"
    value, (rejected,) = read_source(tmp_path, "android_control")
    assert not value
    assert "write a JSON an episode" in rejected.reason


def mind2web_row(
    number: int, op: str, rect: str = "80,40,40,20", value: str = "", **more: Any
) -> dict[str, Any]:
    attributes = json.dumps({"bounding_box_rect": rect, "class": "x"})
    wrong = {
        "attributes": json.dumps({"bounding_box_rect": "0,0,5,5"}),
        "is_original_target": False,
    }
    target = {"tag": "a", "attributes": attributes, "is_original_target": True}
    return {
        "annotation_id": "a1",
        "action_uid": f"u{number}",
        "confirmed_task": "buy it",
        "operation": json.dumps({"op": op, "original_op": op, "value": value}),
        "pos_candidates": [json.dumps(wrong), json.dumps(target)],
        "neg_candidates": [],
        "website": "shop",
        "screenshot": {"bytes": png(number), "path": None},
        **more,
    }


def test_multimodal_mind2web(tmp_path: Path) -> None:
    rows = [
        mind2web_row(0, "CLICK"),
        mind2web_row(1, "TYPE", value="it's"),
        mind2web_row(2, "SELECT", value="red"),
        mind2web_row(3, "HOVER"),
        mind2web_row(4, "CLICK", rect="-1,-1,-1,-1", pos_candidates=[]),
        mind2web_row(5, "CLICK", rect="380,10,40,20"),
        mind2web_row(6, "CLICK", screenshot={"bytes": None, "path": None}),
        mind2web_row(7, "CLICK"),
    ]
    write_table(tmp_path / "a.parquet", rows)
    value, rejected = read_source(tmp_path, "parquet")
    assert [t.id for t in value] == ["a1/u0", "a1/u1", "a1/u2", "a1/u7"]
    assert [t.steps[0].action for t in value][:3] == [
        Action("click", 100, 50),
        Action("other", 100, 50),
        Action("other", 100, 50),
    ]
    assert [t.steps[0].action_code for t in value][:3] == [
        "pyautogui.click(100, 50)",
        'pyautogui.click(100, 50)\npyautogui.write("it\'s")',
        "",
    ]
    assert {t.steps[0].target_box for t in value} == {(80, 40, 120, 60)}
    assert {(t.instruction, stated_screen(t)) for t in value} == {("buy it", "web page")}
    assert [(r.where, r.field) for r in rejected] == [
        ("row 3", "operation.op"),
        ("row 4", "pos_candidates"),
        ("row 5", "pos_candidates"),
        ("row 6", "screenshot"),
    ]
