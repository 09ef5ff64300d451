import json
import os
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from hijack_data.types import ACTION_TYPES, Action
from pipelines.readers import fields, safe_files
from pipelines.readers.fields import ACTION_FIELDS, REQUIRED, FieldError
from pipelines.readers.plain_fields import FIELDS, SCHEMA

from support.recordings import read_source

ROOT = Path(__file__).resolve().parents[2]

read = partial(read_source, name="jsonl")


def test_a_recording_is_read_as_it_is(recording: Any) -> None:
    folder = recording(trajectories=2, steps=3)
    trajectories, rejected = read(folder)
    assert not rejected
    assert [(t.id, len(t.steps)) for t in trajectories] == [("t0", 3), ("t1", 3)]
    first = trajectories[1].steps[2]
    assert (first.index, first.action, first.action_code) == (
        2,
        Action("click", x=102, y=50),
        "pyautogui.click(102, 50)",
    )
    assert (first.target_box, first.elements) == (
        (90, 40, 130, 60),
        ((90, 40, 130, 60), (10, 10, 60, 30)),
    )
    assert (trajectories[1].instruction, trajectories[1].domain, trajectories[1].source) == (
        "do t1",
        "tests",
        "jsonl",
    )
    assert Path(first.image) == folder / "images" / "t1-2.png"
    assert read(folder / "trajectories.jsonl")[0] == trajectories


def test_lines_may_stand_in_any_order(recording: Any) -> None:
    folder = recording(trajectories=3, steps=3)
    expected = read(folder)[0]
    file = folder / "trajectories.jsonl"
    lines = file.read_text().splitlines()
    file.write_text("\n\n".join([lines[0], *reversed(lines[1:])]))
    trajectories, rejected = read(folder)
    assert not rejected
    assert sorted(trajectories, key=lambda t: t.id) == expected
    assert [t.id for t in trajectories] == ["t0", "t2", "t1"]


def test_all_fields_of_an_action(recording: Any, add_line: Any, good_line: Any) -> None:
    folder = recording()
    action = {
        "type": "drag",
        "x": 1.5,
        "y": 2,
        "x2": 319,
        "y2": 199,
        "keys": ["ctrl", "a"],
        "amount": -3,
    }
    add_line(
        folder,
        good_line("t0", 7, image="images/t0-0.png", action=action, apps=None, domain="tests"),
    )
    step = read(folder)[0][0].steps[-1]
    assert step.action == Action("drag", 2, 2, 319, 199, None, ("ctrl", "a"), -3.0)


def test_a_byte_order_mark_and_windows_line_ends(recording: Any) -> None:
    folder = recording()
    file = folder / "trajectories.jsonl"
    file.write_bytes(b"\xef\xbb\xbf" + file.read_bytes().replace(b"\n", b"\r\n"))
    trajectories, rejected = read(folder)
    assert (len(trajectories), rejected) == (2, [])


NAN, INF = float("nan"), float("inf")
CLICK = {"type": "click", "x": 5, "y": 5}
BAD = {
    "no trajectory": ({"trajectory_id": None}, "trajectory_id", "missing"),
    "empty trajectory": ({"trajectory_id": "  "}, "trajectory_id", "empty"),
    "number as trajectory": ({"trajectory_id": 7}, "trajectory_id", "string"),
    "half a character": ({"trajectory_id": "a\ud800"}, "trajectory_id", "surrogate"),
    "no step": ({"step": None}, "step", "missing"),
    "negative step": ({"step": -1}, "step", "integer"),
    "step as text": ({"step": "1"}, "step", "integer"),
    "true step": ({"step": True}, "step", "integer"),
    "giant step": ({"step": 10**30}, "step", "integer"),
    "step again": ({"step": 0}, "step", "was there before"),
    "no instruction": ({"instruction": None}, "instruction", "missing"),
    "other instruction": ({"instruction": "something else"}, "instruction", "differs"),
    "other domain": ({"domain": "elsewhere"}, "domain", "differs"),
    "bad apps": ({"apps": "vlc"}, "apps", "list of strings"),
    "no image": ({"image": None}, "image", "missing"),
    "image not there": ({"image": "images/none.png"}, "image", "not in the source folder"),
    "image is a folder": ({"image": "images"}, "image", "not a file"),
    "image outside": ({"image": "../secret.png"}, "image", "leaves the source"),
    "image outside and not there": (
        {"image": "images/../../none.png"},
        "image",
        "leaves the source",
    ),
    "absolute image": ({"image": "/etc/passwd"}, "image", "absolute"),
    "link outside": ({"image": "images/link.png"}, "image", "leaves the source"),
    "link to itself": ({"image": "images/loop.png"}, "image", "cannot be opened"),
    "zero byte in the path": ({"image": "images/\0.png"}, "image", "not a path"),
    "endless path": ({"image": "x" * 5000}, "image", "cannot be opened"),
    "image is text": ({"image": "trajectories.jsonl"}, "image", "not a readable"),
    "no action": ({"action": None}, "action", "missing"),
    "action as text": ({"action": "click"}, "action", "object"),
    "no type": ({"action": {"x": 1, "y": 1}}, "action.type", "missing"),
    "wrong type": ({"action": {"type": "clck"}}, "action.type", "did you mean 'click'"),
    "wrong field": ({"action": {**CLICK, "buton": 1}}, "action.buton", "not a field"),
    "x is NaN": ({"action": {**CLICK, "x": NAN}}, "action.x", "finite"),
    "y is infinite": ({"action": {**CLICK, "y": INF}}, "action.y", "finite"),
    "x is giant": ({"action": {**CLICK, "x": 10**400}}, "action.x", "finite"),
    "x is text": ({"action": {**CLICK, "x": "5"}}, "action.x", "number"),
    "x is true": ({"action": {**CLICK, "x": True}}, "action.x", "number"),
    "x is past the edge": ({"action": {**CLICK, "x": 320}}, "action.x", "outside the screenshot"),
    "y is past the edge": ({"action": {**CLICK, "y": 199.5}}, "action.y", "outside the screenshot"),
    "x is negative": ({"action": {**CLICK, "x": -1}}, "action.x", "outside the screenshot"),
    "end of drag outside": (
        {"action": {**CLICK, "x2": 3, "y2": 200}},
        "action.y2",
        "outside the screenshot",
    ),
    "only x": ({"action": {"type": "click", "x": 5}}, "action.y", "missing"),
    "keys as text": (
        {"action": {"type": "hotkey", "keys": "ctrl"}},
        "action.keys",
        "list of strings",
    ),
    "amount is NaN": ({"action": {"type": "scroll", "amount": NAN}}, "action.amount", "finite"),
    "code is a list": ({"action_code": ["a"]}, "action_code", "string"),
    "target is NaN": ({"target_box": [NAN, 0, 1, 1]}, "target_box", "number"),
    "target is swapped": ({"target_box": [50, 50, 10, 10]}, "target_box", "ends before"),
    "target has three": ({"target_box": [1, 2, 3]}, "target_box", "4 numbers"),
    "target outside": ({"target_box": [400, 0, 500, 50]}, "target_box", "outside"),
    "target is empty": ({"target_box": [5, 5, 5, 9]}, "target_box", "empty"),
    "elements are text": ({"elements": "all"}, "elements", "list"),
    "element is bad": ({"elements": [[0, 0, 1, 1], [0, 0, "a", 1]]}, "elements", "labels[1]"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_line_is_rejected_and_the_rest_goes_on(
    case: str, recording: Any, add_line: Any, good_line: Any
) -> None:
    changes, field, reason = BAD[case]
    folder = recording()
    (folder.parent / "secret.png").write_bytes((folder / "images" / "t0-0.png").read_bytes())
    (folder / "images" / "link.png").symlink_to(folder.parent / "secret.png")
    (folder / "images" / "loop.png").symlink_to("loop.png")
    add_line(folder, {**good_line("t0", 9, image="images/t0-0.png"), **changes})
    add_line(folder, good_line("t1", 9, image="images/t1-0.png"))
    trajectories, rejected = read(folder)
    assert [(r.file, r.where, r.field) for r in rejected] == [
        ("trajectories.jsonl", "line 7", field)
    ]
    assert reason in rejected[0].reason
    assert [len(t.steps) for t in trajectories] == [3, 4]


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b'{"trajectory_id": "\xff\xfe"}', "UTF-8"),
        (b"{'trajectory_id': 1}", "not JSON"),
        (b"[" * 100_000, "nested too deeply"),
        (b"[1, 2]", "object"),
        (b'{"step": 1' + b"0" * 5000 + b"}", "digits"),
        (b'"' + b"x" * 3000 + b'"', "longer than"),
    ],
)
def test_a_line_that_is_no_record(
    data: bytes,
    reason: str,
    recording: Any,
    add_line: Any,
    good_line: Any,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    folder = recording()
    add_line(folder, data)
    if reason == "longer than":
        monkeypatch.setattr(safe_files, "MAX_RECORD_BYTES", 2000)
    add_line(folder, good_line("t0", 8, image="images/t0-0.png"))
    trajectories, rejected = read(folder)
    assert [r.where for r in rejected] == ["line 7"]
    assert reason in rejected[0].reason
    assert [len(t.steps) for t in trajectories] == [4, 3]


def test_a_line_of_more_than_50_mib_is_not_taken_into_memory(recording: Any, add_line: Any) -> None:
    folder = recording()
    add_line(folder, b'{"x": "' + b"x" * (50 * 2**20) + b'"}')
    trajectories, rejected = read(folder)
    assert (len(trajectories), [r.reason for r in rejected]) == (2, ["longer than 50 MiB"])


def test_an_id_that_is_used_twice(recording: Any, add_line: Any, good_line: Any) -> None:
    folder = recording()
    add_line(folder, good_line("t0", 8, image="images/t0-0.png", id="a"))
    add_line(folder, good_line("t0", 9, image="images/t0-0.png", id="a"))
    trajectories, rejected = read(folder)
    assert [(r.where, r.field) for r in rejected] == [("line 8", "id")]
    assert trajectories[0].steps[-1].id == "a"


def test_a_key_twice_is_refused_where_it_stands(
    recording: Any, add_line: Any, good_line: Any
) -> None:
    folder = recording()
    text = json.dumps(good_line("t0", 8, image="images/t0-0.png"))
    add_line(folder, text.replace('"y": 50', '"y": 50, "y": 60').encode())
    add_line(folder, text.replace('"step": 8', '"step": 8, "step": 9').encode())
    trajectories, rejected = read(folder)
    assert [(r.where, r.field) for r in rejected] == [("line 7", "y"), ("line 8", "step")]
    assert rejected[0].reason == "the key 'y' stands twice in one object; keep one"
    assert len(trajectories[0].steps) == 3


def test_a_line_that_states_another_size_than_its_picture_is_refused(
    recording: Any, add_line: Any, good_line: Any
) -> None:
    """Such as the viewport of a browser whose screenshots have two pixels for each of its own."""
    folder = recording(trajectories=1, steps=1)
    for step, size in ((7, (320, 200.0)), (8, (160, 100)), (9, (160, None))):
        line = good_line("t0", step, image="images/t0-0.png", width=size[0], height=size[1])
        add_line(folder, line)
    (trajectory,), (rejected,) = read(folder)
    assert [step.index for step in trajectory.steps] == [0, 7, 9]
    assert rejected.field == "width"
    assert "state 160x100, but the picture is 320x200" in rejected.reason


@pytest.fixture
def read_with(recording: Any, add_line: Any, good_line: Any) -> Any:
    """Return what reads a recording with one more step, of an action and its code."""

    def read_it(action: Any, code: str) -> Any:
        folder = recording()
        picture = "images/t0-0.png"
        add_line(folder, good_line("t0", 8, image=picture, action=action, action_code=code))
        return read(folder)

    return read_it


@pytest.mark.parametrize(
    ("action", "code", "reason"),
    [
        (
            {"type": "click", "x": 100, "y": 50},
            "pyautogui.click(102, 50)",
            "says click at (102, 50), but action is click at (100, 50)",
        ),
        (
            {"type": "click", "x": 100, "y": 50},
            "pyautogui.doubleClick(100, 50)",
            "says double_click at (100, 50), but action is click at (100, 50)",
        ),
        (
            {"type": "drag", "x": 10, "y": 20, "x2": 30, "y2": 40},
            "pyautogui.moveTo(10, 20); pyautogui.dragTo(30, 60)",
            "says drag at (10, 20) to (30, 60)",
        ),
        (
            {"type": "scroll", "x": 100, "y": 50, "amount": -5},
            "pyautogui.scroll(3, 100, 50)",
            "says scroll at (100, 50) by 3, but action is scroll at (100, 50) by -5",
        ),
        ({"type": "type", "text": "a"}, "DONE", "says done, but action is type"),
        ({"type": "other"}, "pyautogui.click(0.5, 0.25)", "counts in fractions of the picture"),
        ({"type": "other"}, "computer.tripleClick(0.5, 0.2)", "counts in fractions of the picture"),
        (
            {"type": "click", "x": 100, "y": 50},
            "computer.triple_click(100, 50)",
            "says triple_click at (100, 50), but action is click at (100, 50)",
        ),
    ],
)
def test_code_that_contradicts_its_action_is_refused(
    action: Any, code: str, reason: str, read_with: Any
) -> None:
    _, rejected = read_with(action, code)
    assert [(r.where, r.field) for r in rejected] == [("line 7", "action_code")]
    assert reason in rejected[0].reason


@pytest.mark.parametrize(
    ("action", "code"),
    [
        ({"type": "click", "x": 100, "y": 50}, "pyautogui.click(101, 49)"),
        ({"type": "click", "x": 100.5, "y": 50}, "pyautogui.click(100.5, 50)"),
        ({"type": "click", "x": 100, "y": 50}, "pyautogui.click()"),
        ({"type": "click", "x": 100, "y": 50}, "pyautogui.click(*found())"),
        ({"type": "click", "x": 100, "y": 50}, "pyautogui.click(9, 9); pyautogui.write('a')"),
        ({"type": "drag", "x": 1, "y": 2, "x2": 30, "y2": 40}, "pyautogui.dragTo(30, 40)"),
        ({"type": "hotkey", "keys": ["enter"]}, "pyautogui.write('\\n')"),
        ({"type": "other"}, "pyautogui.click(9, 9)"),
        ({"type": "scroll", "amount": -5}, "pyautogui.scroll(-300, 9, 9)"),
        ({"type": "click", "x": 100, "y": 50}, "click(start_box='(9,9)')"),
    ],
)
def test_code_that_may_be_the_same_action_is_kept(action: Any, code: str, read_with: Any) -> None:
    trajectories, rejected = read_with(action, code)
    assert not rejected
    assert trajectories[0].steps[-1].action_code == code


def test_links_inside_the_source_are_followed(
    recording: Any, add_line: Any, good_line: Any
) -> None:
    folder = recording()
    (folder / "images" / "link.png").symlink_to("t0-0.png")
    add_line(folder, good_line("t0", 9, image="images/../images/link.png"))
    assert not read(folder)[1]


def test_records_that_are_a_link_to_another_folder_are_not_read(
    recording: Any, tmp_path: Path
) -> None:
    second = recording("other")
    folder = tmp_path / "linked"
    folder.mkdir()
    (folder / "trajectories.jsonl").symlink_to(second / "trajectories.jsonl")
    trajectories, rejected = read(folder)
    assert not trajectories
    assert "leaves the source" in rejected[0].reason


def test_a_pipe_in_place_of_an_image_does_not_block(
    recording: Any, add_line: Any, good_line: Any
) -> None:
    folder = recording()
    os.mkfifo(folder / "images" / "pipe.png")
    add_line(folder, good_line("t0", 9, image="images/pipe.png"))
    assert "not a file" in read(folder)[1][0].reason


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bare")
    Image.new("RGB", (320, 200)).save(folder / "a.png")
    return folder


GOOD = {
    "trajectory_id": "good",
    "step": 0,
    "instruction": "i",
    "image": "a.png",
    "action": {"type": "wait"},
}
JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=5)
    | st.sampled_from(ACTION_TYPES),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.sampled_from([*"xy", "x2", "keys", "type"]), inner)
    ),
    max_leaves=8,
)


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=60))
def test_no_bytes_stop_the_reader(bare: Path, data: bytes) -> None:
    (bare / "trajectories.jsonl").write_bytes(data + b"\n" + json.dumps(GOOD).encode())
    assert [t.id for t in read(bare)[0]] == ["good"]


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.dictionaries(
        st.sampled_from(["step", "image", "action", "target_box", "elements", "apps", "id"]), JSON
    )
)
def test_no_values_stop_the_reader_and_what_passes_is_inside(
    bare: Path, changes: dict[str, Any]
) -> None:
    record = {**GOOD, "trajectory_id": "odd", **changes}
    (bare / "trajectories.jsonl").write_text(json.dumps(record) + "\n" + json.dumps(GOOD))
    trajectories, rejected = read(bare)
    assert len(trajectories) + len(rejected) == 2
    for step in (s for t in trajectories for s in t.steps):
        point = step.action.point
        assert point is None or (0 <= point[0] < 320 and 0 <= point[1] < 200)


def test_our_own_recordings_are_sound() -> None:
    folder = ROOT / "examples" / "recordings"
    if not (folder / "trajectories.jsonl").is_file():
        pytest.skip("examples/recordings has not been recorded")
    trajectories, rejected = read(folder)
    assert not rejected
    assert len(trajectories) >= 1
    for step in (s for t in trajectories for s in t.steps):
        if step.target_box and step.action.point:
            (x, y), (x1, y1, x2, y2) = step.action.point, step.target_box
            assert x1 <= x < x2
            assert y1 <= y < y2


def test_everything_that_is_wrong_with_a_line_is_said_at_once(
    recording: Any, add_line: Any
) -> None:
    folder = recording()
    action = {"type": "clik", "x": "5", "y": 5000, "buton": 1}
    add_line(
        folder,
        {
            "step": "3",
            "image": "images/t0-0.png",
            "action": action,
            "elements": "all",
            "elemnts": [],
        },
    )
    add_line(
        folder,
        {"trajectory_id": "t9", "step": 0, "instruction": "i", "image": "none.png", "action": None},
    )
    value, two = read(folder)[1]
    assert (value.where, value.field) == ("line 7", "trajectory_id")
    output = (
        "is missing",
        "step: must be",
        "instruction: is missing",
        "action.buton: is not",
        "action.type: 'clik'",
        "action.x: must be a number",
        "action.y: 5000 is outside",
        "elements: ",
    )
    assert [part for part in output if part not in str(value)] == []
    assert "elemnts" not in str(value)  # the field that it might be meant for is there
    assert str(two).endswith("image: 'none.png' is not in the source folder; action: is missing")


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("elemnts", "elements"),
        ("bbox", "target_box"),
        ("Instructions", "instruction"),
        ("screenshot", "image"),
    ],
)
def test_a_name_that_is_near_a_field_is_not_lost(
    name: str, meant: str, recording: Any, add_line: Any, good_line: Any
) -> None:
    folder = recording()
    record = {**good_line("t0", 8, image="images/t0-0.png"), meant: None, name: [1, 2, 3, 4]}
    add_line(folder, record)
    (rejected,) = read(folder)[1]
    assert f"{name}: is not a field; did you mean {meant!r}?" in str(rejected)


def test_other_fields_are_kept(recording: Any, add_line: Any, good_line: Any) -> None:
    folder = recording()
    more = {
        "thought": "ä",
        "reward": 0.5,
        "bbox": [1, 2, 3, 4],
        "steps": 12,
        "nested": {"a": [None]},
    }
    add_line(folder, good_line("t0", 8, image="images/t0-0.png", **more))
    trajectories, rejected = read(folder)
    assert rejected == []
    assert json.loads(trajectories[0].steps[-1].extra) == more
    assert trajectories[0].steps[0].extra == ""


@pytest.mark.parametrize("value", [NAN, "\ud800", "x" * 2**20])
def test_other_fields_that_a_dataset_cannot_hold(
    value: Any, recording: Any, add_line: Any, good_line: Any
) -> None:
    folder = recording()
    add_line(folder, good_line("t0", 8, image="images/t0-0.png", thought=value))
    (rejected,) = read(folder)[1]
    assert rejected.field == "thought"


def test_the_schema_names_the_fields_that_are_read() -> None:
    schema = json.loads(SCHEMA.read_text())
    assert set(schema["properties"]) == set(FIELDS)
    action = schema["$defs"]["action"]["properties"]
    assert set(action) == set(ACTION_FIELDS)
    assert tuple(action["type"]["enum"]) == ACTION_TYPES


@pytest.mark.parametrize("field", FIELDS)
def test_the_schema_requires_what_the_reader_requires(
    field: str, recording: Any, add_line: Any, good_line: Any
) -> None:
    folder = recording()
    add_line(folder, {**good_line("t0", 9, image="images/t0-0.png", domain=None), field: None})
    (folder / "trajectories.jsonl").write_text(
        (folder / "trajectories.jsonl").read_text().splitlines()[-1]
    )
    required = json.loads(SCHEMA.read_text())["required"]
    assert bool(read(folder)[1]) == (field in required)


def test_the_schema_says_yes_and_no_as_the_reader_does(recording: Any, good_line: Any) -> None:
    jsonschema = pytest.importorskip("jsonschema", reason="pip install jsonschema")
    check = jsonschema.Draft202012Validator(json.loads(SCHEMA.read_text()))
    record = good_line("t0", 9, image="images/t0-0.png")
    assert check.is_valid(record)
    form = {
        name: case[0]
        for name, case in BAD.items()
        if case[1] not in ("image", "target_box", "elements")
    }
    outside = ("past the edge", "again", "other", "end of drag", "half", "infinite", "NaN", "giant")
    for name, changes in form.items():
        if not any(part in name for part in outside):
            assert not check.is_valid({**record, **changes}), name


FULL: dict[str, Any] = {
    "x": 5,
    "y": 6,
    "x2": 7,
    "y2": 8,
    "text": "a",
    "keys": ["ctrl", "Enter", "ä"],
    "amount": 2,
}


@pytest.mark.parametrize("kind", ACTION_TYPES)
def test_an_action_has_what_its_type_needs(kind: str, recording: Any, good_line: Any) -> None:
    """With all of it the reader and the schema take it; without any one of it, neither does. What
    is null or empty is absent."""
    jsonschema = pytest.importorskip("jsonschema", reason="pip install jsonschema")
    check = jsonschema.Draft202012Validator(
        json.loads(SCHEMA.read_text())["$defs"]["action"]
        | {"$defs": json.loads(SCHEMA.read_text())["$defs"]}
    )
    needs = {name: FULL[name] for name in REQUIRED.get(kind, ())}
    assert check.is_valid(lowered({"type": kind, **needs}))
    assert check.is_valid(lowered({**dict.fromkeys(FULL), "type": kind, **needs}))
    assert fields.action({**dict.fromkeys(FULL), "type": kind, **needs}, (9, 9)).type == kind
    for name, value in needs.items():
        for absent in (None, *([type(value)()] if isinstance(value, str | list) else [])):
            for action in (
                {"type": kind, **needs, name: absent},
                {"type": kind, **{key: v for key, v in needs.items() if key != name}},
            ):
                assert not check.is_valid(lowered(action)), action
                with pytest.raises(FieldError) as error:
                    fields.action(action, (9, 9))
                assert error.value.field == f"action.{name}"


POINTING = tuple(kind for kind in ACTION_TYPES if "x" in REQUIRED.get(kind, ()))
PARTS = {
    "x y": (*POINTING, "scroll", "other"),
    "x2 y2": ("drag", "other"),
    "text": ("type", "done", "fail", "other"),
}


@pytest.mark.parametrize("names", PARTS)
@pytest.mark.parametrize("kind", ACTION_TYPES)
def test_an_action_has_no_field_of_another_type(
    kind: str, names: str, recording: Any, add_line: Any, good_line: Any
) -> None:
    """A click with the end of a drag, or a text with the place of a click, would lose a part."""
    jsonschema = pytest.importorskip("jsonschema", reason="pip install jsonschema")
    schema = json.loads(SCHEMA.read_text())
    check = jsonschema.Draft202012Validator(schema["$defs"]["action"] | {"$defs": schema["$defs"]})
    needs = REQUIRED.get(kind, ())
    fits = kind in PARTS[names]
    action = {"type": kind, **{name: FULL[name] for name in (*needs, *names.split())}}
    assert check.is_valid(lowered(action)) == fits
    folder = recording(trajectories=1, steps=1)
    add_line(folder, good_line("t0", 8, image="images/t0-0.png", action=action))
    rejected = read(folder)[1]
    assert [r.field for r in rejected] == ([] if fits else [f"action.{names.split()[0]}"])


def test_an_end_in_fractions_is_said_once(recording: Any, add_line: Any, good_line: Any) -> None:
    folder = recording()
    drag = {"type": "drag", "x": 5, "y": 6, "x2": 0.5, "y2": 0.5}
    add_line(folder, good_line("t0", 8, image="images/t0-0.png", action=drag))
    (rejected,) = read(folder)[1]
    assert (rejected.field, rejected.reason.count("fractions")) == ("action.x2", 1)


def lowered(action: dict[str, Any]) -> dict[str, Any]:
    """The schema knows the names of keys in lower case only."""
    keys = action.get("keys")
    return {**action, "keys": [key.lower() for key in keys]} if keys else action


@pytest.mark.parametrize(
    ("action", "field", "reason"),
    [
        (
            {"type": "click"},
            "x",
            "click needs x and y; if that was not recorded, write type 'other'",
        ),
        ({"type": "drag", "x": 1, "y": 1}, "x2", "drag needs x, y, x2 and y2"),
        ({"type": "wait", "amount": -5}, "amount", "below 0"),
        ({"type": "key_down", "keys": ["nokey"]}, "keys", "'nokey' is not the name of a key"),
        ({"type": "hotkey", "keys": ["Control", "s"]}, "keys", "write 'ctrl'"),
        ({"type": "click", "point": [5, 5]}, "point", "not a field of an action; write x and y"),
        ({"type": "scroll", "clicks": 3}, "clicks", "write amount"),
    ],
)
def test_a_mistake_in_an_action_names_the_fix(
    action: dict[str, Any], field: str, reason: str, recording: Any, add_line: Any, good_line: Any
) -> None:
    folder = recording()
    add_line(folder, good_line("t0", 9, image="images/t0-0.png", action=action))
    (rejected,) = read(folder)[1]
    assert rejected.field == f"action.{field}"
    assert reason in rejected.reason


def test_more_elements_than_a_screen_shows_are_refused_at_once(
    recording: Any, add_line: Any, good_line: Any
) -> None:
    folder = recording()
    many = [[1, 1, 5, 5]] * (fields.MAX_ELEMENTS + 1)
    add_line(folder, good_line("t0", 8, image="images/t0-0.png", elements=many))
    add_line(folder, good_line("t0", 9, image="images/t0-0.png", elements=many[1:]))
    trajectories, (rejected,) = read(folder)
    assert (rejected.where, rejected.field) == ("line 7", "elements")
    assert "has 10001 boxes; the limit is 10000" in rejected.reason
    assert len(trajectories[0].steps[-1].elements) == fields.MAX_ELEMENTS


@pytest.mark.parametrize("indent", [None, 1])
def test_an_array_in_a_file_of_lines_is_one_mistake(indent: int | None, recording: Any) -> None:
    folder = recording()
    file = folder / "trajectories.jsonl"
    file.write_text(
        json.dumps([json.loads(line) for line in file.read_text().splitlines()], indent=indent)
    )
    trajectories, (rejected,) = read(folder)
    assert not trajectories
    assert "an object a line: write one object a line, as jq -c '.[]' trajectories.jsonl" in (
        rejected.reason
    )


def test_a_path_of_windows_names_the_fix(recording: Any, add_line: Any, good_line: Any) -> None:
    folder = recording()
    add_line(folder, good_line("t0", 9, image="images\\t0-0.png"))
    (rejected,) = read(folder)[1]
    assert rejected.reason.endswith("folders are separated by /, so write 'images/t0-0.png'")
