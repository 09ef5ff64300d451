import json
import tracemalloc
from functools import partial
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hijack_data as hj
from hijack_data.types import Action, Trajectory
from pipelines import build
from pipelines.readers import detect_format, get_reader
from pipelines.readers.box_forms import box_in
from pipelines.readers.fields import FieldError
from pipelines.readers.recorded_pictures import read_picture

from support.formats import png, write_table
from support.recordings import read_source

CLICK = "pyautogui.click(100, 50)"

read = partial(read_source, name="parquet")


def picture(number: int) -> dict[str, Any]:
    return {"bytes": png(number), "path": None}


def trajectory(
    name: str, numbers: list[int], actions: list[str] | None = None, **more: Any
) -> dict[str, Any]:
    actions = [CLICK] * len(numbers) if actions is None else actions
    shots = [picture(number) for number in numbers]
    return {"task_id": name, "instruction": "go", "actions": actions, "screenshots": shots, **more}


def test_rows_of_several_files_and_groups(tmp_path: Path) -> None:
    write_table(
        tmp_path / "data" / "b.parquet",
        [trajectory(f"b{i}", [i, i + 1]) for i in range(5)],
        group=2,
    )
    write_table(tmp_path / "a.parquet", [trajectory("a", [9])])
    assert detect_format(tmp_path) == "parquet"
    trajectories, rejected = read(tmp_path)
    assert not rejected
    assert [t.id for t in trajectories] == ["a", "b0", "b1", "b2", "b3", "b4"]
    shots = [[read_picture(s.image, "") for s in t] for t in trajectories]
    assert shots == [[png(9)], *([png(i), png(i + 1)] for i in range(5))]
    backwards = [
        read_picture(s.image, "") for t in reversed(trajectories) for s in reversed(t.steps)
    ]
    assert backwards == [data for pair in reversed(shots) for data in reversed(pair)]


def test_actions_are_code_or_computer_13(tmp_path: Path) -> None:
    actions = [CLICK, '{"action_type": "CLICK", "x": 3, "y": 4}', "WAIT"]
    write_table(tmp_path / "a.parquet", [trajectory("a", [0, 1, 2], actions, domain="os")])
    (recorded,), rejected = read(tmp_path)
    assert not rejected
    assert [s.action for s in recorded] == [
        Action("click", 100, 50),
        Action("click", 3, 4),
        Action("wait"),
    ]
    assert [s.action_code for s in recorded] == actions
    assert recorded.domain == "os"


@pytest.mark.parametrize(
    ("change", "field", "reason"),
    [
        ({"task_id": None}, "task_id", "missing"),
        ({"task_id": "good"}, "id", "is the id of an earlier row of this file"),
        ({"instruction": " "}, "instruction", "empty"),
        ({"actions": [CLICK, CLICK]}, "screenshots", "1, but there are 2"),
        ({"actions": [], "screenshots": []}, "actions", "empty"),
        ({"actions": None}, "actions", "missing"),
        ({"actions": ["pyautogui.click(400, 5)"]}, "actions[0]", "outside the 400x200"),
        ({"actions": [None]}, "actions[0]", "missing"),
        ({"actions": ['{"action_type": ']}, "actions[0]", "not JSON"),
        ({"screenshots": [{"bytes": b"hello", "path": None}]}, "screenshots[0]", "not a readable"),
        (
            {"screenshots": [{"bytes": b"\x80\x04K\x01.", "path": None}]},
            "screenshots[0]",
            "not a readable",
        ),
        ({"screenshots": [{"bytes": None, "path": None}]}, "screenshots[0]", "no bytes"),
        ({"screenshots": [None]}, "screenshots[0]", "no bytes"),
        ({"screenshots": [{"bytes": None, "path": "../x.png"}]}, "screenshots[0]", "leaves"),
    ],
)
def test_a_bad_row_is_counted(
    change: dict[str, Any], field: str, reason: str, tmp_path: Path
) -> None:
    rows = [trajectory("good", [0]), {**trajectory("bad", [1]), **change}, trajectory("last", [2])]
    write_table(tmp_path / "source" / "a.parquet", rows)
    (tmp_path / "x.png").write_bytes(png(0))
    trajectories, (rejected,) = read(tmp_path / "source")
    assert [t.id for t in trajectories] == ["good", "last"]
    assert (rejected.file, rejected.where) == ("a.parquet", "row 1")
    assert field in rejected.field or field in rejected.reason
    assert reason in rejected.reason
    assert read_picture(trajectories[1].steps[0].image, "") == png(2)


def test_text_that_is_not_utf8_costs_its_row_only(tmp_path: Path) -> None:
    table = pa.Table.from_pylist([trajectory(name, [0]) for name in ("a", "b", "c")])
    broken = pa.array([b"a", b"\xff\xfe", b"c"]).cast(pa.binary()).view(pa.string())
    pq.write_table(
        table.set_column(table.schema.get_field_index("instruction"), "instruction", broken),
        tmp_path / "a.parquet",
    )
    trajectories, (rejected,) = read(tmp_path)
    assert [t.id for t in trajectories] == ["a", "c"]
    assert rejected.where == "row 1"
    assert "utf-8" in rejected.reason


def test_tables_without_the_columns_and_files_that_are_none(tmp_path: Path) -> None:
    write_table(tmp_path / "a.parquet", [{"text": "hello", "label": 1}])
    (tmp_path / "b.parquet").write_bytes(b"PAR1 this is not one PAR1")
    write_table(tmp_path / "c.parquet", [trajectory("c", [0])])
    data = (tmp_path / "c.parquet").read_bytes()
    (tmp_path / "d.parquet").write_bytes(data[: len(data) // 2])
    pq.write_table(pa.Table.from_pylist([trajectory("e", [0])]).slice(0, 0), tmp_path / "e.parquet")
    trajectories, rejected = read(tmp_path)
    assert [t.id for t in trajectories] == ["c"]
    assert [(r.file, r.field) for r in rejected] == [
        ("a.parquet", "columns"),
        ("b.parquet", ""),
        ("d.parquet", ""),
        ("e.parquet", ""),
    ]
    assert "label" in rejected[0].reason
    assert "task_id, instruction, actions, screenshots" in rejected[0].reason


def test_pages_that_are_damaged(tmp_path: Path) -> None:
    write_table(tmp_path / "a.parquet", [trajectory(f"a{i}", [i]) for i in range(4)])
    data = bytearray((tmp_path / "a.parquet").read_bytes())
    data[40:4000] = bytes(3960)
    (tmp_path / "a.parquet").write_bytes(data)
    _, rejected = read(tmp_path)
    assert rejected


def test_memory_does_not_grow_with_the_table(tmp_path: Path) -> None:
    peaks = []
    for rows in (20, 200):
        file = tmp_path / f"{rows}.parquet"
        write_table(file, [trajectory(f"t{i}", [i % 7]) for i in range(rows)], group=50)
        before = pa.total_allocated_bytes()
        tracemalloc.start()
        for item in get_reader("parquet").read(file):
            assert isinstance(item, Trajectory)
            read_picture(item.steps[0].image, "")
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert pa.total_allocated_bytes() - before < 2**22
    assert peaks[1] < 2 * peaks[0] + 2**18


# Chat rows.


def call(name: str, **given: Any) -> dict[str, Any]:
    return {"type": "function", "function": {"name": name, "arguments": given}}


def cua(*calls: dict[str, Any], batch: bool = False) -> list[dict[str, Any]]:
    listed = [{"action": c["function"]["name"], **c["function"]["arguments"]} for c in calls]
    result = [call("computer", actions=listed)] if batch else list(calls)
    return [
        {
            "role": "user",
            "content": [{"type": "image", "index": 0}, {"type": "text", "text": "open it"}],
        },
        {
            "role": "assistant",
            "content": [{"type": "action_description", "text": "now"}],
            "tool_calls": result,
        },
        {"role": "tool", "content": [{"type": "image", "index": 1}]},
        {"role": "assistant", "content": [{"type": "text", "text": "Done."}]},
    ]


def chat(messages: Any, numbers: int = 2, **more: Any) -> dict[str, Any]:
    text = messages if isinstance(messages, str) else json.dumps(messages)
    return {"messages": text, "images": [picture(i) for i in range(numbers)], **more}


@pytest.mark.parametrize(
    ("action", "expected"),
    [
        (call("click", coordinate=[250, 250]), Action("click", 100, 50)),
        (call("click", coordinate=[250, 250], button="right"), Action("right_click", 100, 50)),
        (
            call("click", coordinate=[250, 250], clicks=2, button=None),
            Action("double_click", 100, 50),
        ),
        (call("tap", coordinate=[999, 999]), Action("click", 399, 199)),
        (call("click", coordinate=[1000, 0]), Action("click", 399, 0)),
        (call("mouse_move", coordinate=[500, 500]), Action("move", 200, 100)),
        (
            call("drag", start_coordinate=[0, 0], coordinate=[500, 500]),
            Action("drag", 0, 0, 200, 100),
        ),
        (
            call("scroll", coordinate=[500, 500], direction="down", amount=3),
            Action("scroll", 200, 100, amount=-3),
        ),
        (call("scroll", direction="left", amount=3), Action("other")),
        (call("type", text="a"), Action("type", text="a")),
        (call("key", keys=["ctrl", "c"]), Action("hotkey", keys=("ctrl", "c"))),
        (call("hold_key", keys=["a"], duration=1.5), Action("hotkey", keys=("a",), amount=1.5)),
        (call("key_down", keys=["shift"]), Action("key_down", keys=("shift",))),
        (call("mouse_down"), Action("mouse_down")),
        (call("wait", duration=2), Action("wait", amount=2)),
        (call("terminate", status="failure"), Action("fail")),
    ],
)
@pytest.mark.parametrize("batch", [False, True])
def test_tool_calls_count_in_thousandths(
    action: Any, expected: Action, batch: bool, tmp_path: Path
) -> None:
    messages = cua(call("screenshot"), action, batch=batch)
    write_table(tmp_path / "a.parquet", [chat(messages)])
    (trajectory,), rejected = read(tmp_path)
    assert not rejected
    assert [s.action for s in trajectory] == [expected, Action("done", text="Done.")]
    assert json.loads(trajectory.steps[0].action_code) == messages[1]["tool_calls"]
    assert trajectory.instruction == "open it"
    assert [read_picture(s.image, "") for s in trajectory] == [png(0), png(1)]


def test_messages_may_be_a_list_of_structs(tmp_path: Path) -> None:
    row = {
        "messages": cua(call("click", coordinate=[250, 250])),
        "images": [picture(0), picture(1)],
    }
    row["messages"][0]["content"][0]["index"] = 0.0
    write_table(tmp_path / "a.parquet", [row])
    (trajectory,), rejected = read(tmp_path)
    assert not rejected
    assert [s.action.type for s in trajectory] == ["click", "done"]
    assert trajectory.id == "a/000000"


def test_placeholders_and_blocks_of_code(tmp_path: Path) -> None:
    messages = [
        {"role": "system", "content": "be good"},
        {"role": "user", "content": "<image>\nopen it"},
        {
            "role": "assistant",
            "content": "I click.\n```python\nimport pyautogui\npyautogui.click(100, 50)\n```",
        },
        {"role": "user", "content": "<image>"},
        {"role": "assistant", "content": "Well."},
        {"role": "assistant", "content": "pyautogui.press('enter')"},
        {"role": "assistant", "content": "DONE"},
    ]
    write_table(tmp_path / "a.parquet", [chat(messages, id="mine")])
    (trajectory,), (rejected,) = read(tmp_path)
    assert trajectory.id == "mine"
    assert [s.action for s in trajectory] == [
        Action("click", 100, 50),
        Action("hotkey", keys=("enter",)),
    ]
    assert trajectory.steps[0].action_code == "import pyautogui\npyautogui.click(100, 50)"
    assert trajectory.instruction == "open it"
    assert (rejected.where, rejected.field) == ("row 0", "messages[6].images")
    assert "between this action and the one before" in rejected.reason


@pytest.mark.parametrize(
    ("messages", "field", "reason"),
    [
        ("[", "messages", "not JSON"),
        ("{}", "messages", "list"),
        ("[3]", "messages", "object"),
        ("[" * 100_000, "messages", "nested"),
        (
            [
                {"role": "user", "content": "<image>what is this?"},
                {"role": "assistant", "content": "a dog"},
            ],
            "messages",
            "no action",
        ),
        (cua(call("bash", command="ls"))[:2], "messages[1].tool_calls.bash", "'bash'"),
        (cua(call("click", coordinate=[1200, 5]))[:2], "messages[1].tool_calls.click", "1200"),
        (cua(call("click", coordinate=[5]))[:2], "messages[1].tool_calls.click", "[x, y]"),
        (
            cua(call("scroll", direction="away", amount=1))[:2],
            "messages[1].tool_calls.scroll",
            "direction",
        ),
        (
            [*cua()[:1], {"role": "assistant", "tool_calls": [{}]}],
            "messages[1].tool_calls.function",
            "object",
        ),
        (
            [
                {
                    "role": "user",
                    "content": [{"type": "image", "index": -1}, {"type": "text", "text": "a"}],
                },
                *cua(call("mouse_up"))[1:2],
            ],
            "messages[0].index",
            "integer",
        ),
        (
            [
                {
                    "role": "user",
                    "content": [{"type": "image", "index": 9}, {"type": "text", "text": "a"}],
                },
                *cua(call("mouse_up"))[1:2],
            ],
            "messages[1].images[9]",
            "not there",
        ),
    ],
)
def test_a_bad_chat_is_counted(messages: Any, field: str, reason: str, tmp_path: Path) -> None:
    write_table(
        tmp_path / "a.parquet", [chat(messages), chat(cua(call("click", coordinate=[1, 1])))]
    )
    (trajectory,), rejected = read(tmp_path)
    assert trajectory.id == "a/000001"
    assert {r.where for r in rejected} == {"row 0"}
    assert rejected[0].field == field
    assert reason in rejected[0].reason


# Grounding rows.


def box(bbox: Any, **more: Any) -> dict[str, Any]:
    return {
        "file_name": "a.png",
        "bbox": bbox,
        "instruction": "the button",
        "image": picture(0),
        **more,
    }


WIDE = [100.0, 20.0, 390.0, 40.0]  # no width: 100 + 390 is beyond the picture


@pytest.mark.parametrize("bbox", [[0.25, 0.1, 0.5, 0.2], [100.0, 20.0, 200.0, 40.0]])
def test_boxes_in_fractions_and_in_pixels(bbox: list[float], tmp_path: Path) -> None:
    rows = [box(bbox)] if bbox[0] < 1 else [box(bbox), box(WIDE)]
    write_table(tmp_path / "a.parquet", rows)
    (trajectory, *_), rejected = read(tmp_path)
    assert not rejected
    (step,) = trajectory.steps
    assert step.target_box == (100, 20, 200, 40)
    assert step.action == Action("click", 150, 30)
    assert (trajectory.id, trajectory.instruction) == ("a/000000", "the button")


@pytest.mark.parametrize(
    ("bbox", "reason"),
    [
        ([0.5, 0.5, 0.1, 0.9], "ends before"),
        ([100.0, 20.0, 900.0, 40.0], "leaves the 400x200"),
        ([-0.5, 0.1, 0.5, 0.2], "leaves the 400x200"),
        ([0.1, 0.1, 0.1, 0.2], "empty"),
        ([0.1, 0.1, 0.2], "four numbers"),
        ([0.1, 0.1, 0.2, float("nan")], ""),
        (None, "missing"),
    ],
)
def test_a_bad_box_is_counted(bbox: Any, reason: str, tmp_path: Path) -> None:
    write_table(tmp_path / "a.parquet", [box(bbox), box([0.1, 0.1, 0.2, 0.2])])
    (trajectory,), (rejected,) = read(tmp_path)
    assert trajectory.id == "a/000001"
    assert (rejected.where, rejected.field) == ("row 0", "bbox")
    assert reason in rejected.reason


@given(st.tuples(*[st.floats(0, 1)] * 4))
def test_a_click_is_inside_its_box(numbers: tuple[float, ...]) -> None:
    x1, x2 = sorted(numbers[::2])
    y1, y2 = sorted(numbers[1::2])
    try:
        left, top, right, bottom = box_in(
            ("fractions", "xyxy"), [x1, y1, x2, y2], (200, 400), "bbox"
        )
    except FieldError:
        return
    assert left <= (left + right) // 2 < right
    assert top <= (top + bottom) // 2 < bottom


def test_a_build_keeps_the_click_inside_the_box(tmp_path: Path) -> None:
    write_table(tmp_path / "source" / "a.parquet", [box([0.25, 0.1, 0.5, 0.2])])
    build(tmp_path / "source", tmp_path / "out", corruptions={"half": hj.Resolution(scale=0.5)})
    rows = pq.read_table(tmp_path / "out" / "data").to_pylist()
    assert [row["target_box"] for row in rows] == [[100, 20, 200, 40], [50, 10, 100, 20]]
    assert [(row["action"]["x"], row["action"]["y"]) for row in rows] == [(150, 30), (75, 15)]
    assert [row["action_code"] for row in rows] == ["", ""]
