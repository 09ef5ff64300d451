import json
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from hijack_data.types import Action
from pipelines.readers import detect_format
from pipelines.readers.recorded_pictures import read_picture

from support.formats import anthropic, png, text_of, write_json, write_lines
from support.recordings import read_source

read = partial(read_source, name="anthropic")


def messages(folder: Path) -> list[Any]:
    return json.loads((anthropic(folder) / "run.json").read_text())["messages"]


def image(number: int) -> dict[str, Any]:
    return {
        "type": "image",
        "source": {"type": "base64", "media_type": "image/png", "data": text_of(number)},
    }


def result(name: str, *content: Any) -> dict[str, Any]:
    return {
        "role": "user",
        "content": [{"type": "tool_result", "tool_use_id": name, "content": list(content)}],
    }


def use(name: str, given: Any, **more: Any) -> dict[str, Any]:
    return {"type": "tool_use", "id": name, "name": "computer", "input": given, **more}


NO_PICTURE = {"type": "base64", "data": "aGk="}


@pytest.mark.parametrize("shape", ["lines", "list", "body"])
def test_the_shapes_of_a_log(shape: str, tmp_path: Path) -> None:
    options = messages(tmp_path)
    (tmp_path / "run.json").unlink()
    if shape == "lines":
        write_lines(tmp_path / "a.jsonl", options)
    else:
        write_json(
            tmp_path / "a.json",
            options if shape == "list" else {"system": "x", "messages": options},
        )
    (trajectory,), rejected = read(tmp_path)
    assert not rejected
    assert [s.action for s in trajectory] == [
        Action("click", 100, 50),
        Action("hotkey", keys=("ctrl", "s")),
    ]
    assert [read_picture(s.image, "") for s in trajectory] == [png(0), png(1)]
    assert trajectory.steps[1].action_code == '{"action": "key", "text": "ctrl+s"}'


def test_bodies_that_repeat_the_conversation_so_far_are_read_once(tmp_path: Path) -> None:
    options = messages(tmp_path)
    (tmp_path / "run.json").unlink()
    first = next(i for i, message in enumerate(options) if message["role"] == "assistant")
    answer = {**options[first], "id": "msg_1", "stop_reason": "tool_use"}
    whole = [{"messages": options[:first]}, answer, {"messages": options}]
    parts = [{"messages": options[:first]}, answer, {"messages": options[first + 1 :]}]
    for bodies in (whole, parts):
        write_lines(tmp_path / "a.jsonl", bodies)
        (trajectory,), rejected = read(tmp_path)
        assert not rejected
        assert [s.action.type for s in trajectory] == ["click", "hotkey"]


def test_two_conversations_in_a_file_are_refused(tmp_path: Path) -> None:
    options = messages(tmp_path)
    (tmp_path / "run.json").unlink()
    other = [{"role": "user", "content": "another task"}, *options[1:]]
    changed = [*options[:1], {"role": "assistant", "content": "no"}]
    for later, reason in ((other, "another conversation"), (changed, "with changes")):
        write_lines(tmp_path / "a.jsonl", [{"messages": options}, {"messages": later}])
        trajectories, (rejected,) = read(tmp_path)
        assert not trajectories
        assert (rejected.file, rejected.field) == ("a.jsonl", "line 2, messages")
        assert reason in rejected.reason
        assert "write a file for each run" in rejected.reason


@pytest.mark.parametrize("unit", ["", "_px"])
def test_a_display_of_another_size_than_the_screenshot_is_refused(
    unit: str, tmp_path: Path
) -> None:
    options = messages(tmp_path)
    (tmp_path / "run.json").unlink()
    for width, steps in ((400, ["click", "hotkey"]), (800, ["hotkey"])):
        tool = {"name": "computer", f"display_width{unit}": width, f"display_height{unit}": 200}
        write_json(tmp_path / "a.json", {"tools": [tool], "messages": options})
        (trajectory,), rejected = read(tmp_path)
        assert [s.action.type for s in trajectory] == steps
        assert [r.field for r in rejected] == ["tools"] * (2 - len(steps))
    assert "a display of 800x200, but the screenshot is 400x200" in rejected[0].reason


def test_the_member_tools_of_the_toolset(tmp_path: Path) -> None:
    click = {**use("b", {"coordinate": [7, 8]}, toolset_name="computer"), "name": "right_click"}
    look = {**use("a", {}, toolset_name="computer"), "name": "screenshot"}
    entries = {"type": "tool_use", "id": "c", "name": "bash", "input": {"command": "ls"}}
    options = [
        {"role": "user", "content": [{"type": "text", "text": "go"}]},
        {"role": "assistant", "content": [{"type": "thinking", "thinking": "..."}, look]},
        result("a", image(0)),
        {"role": "assistant", "content": [entries, click]},
    ]
    write_json(tmp_path / "a.json", options)
    assert detect_format(tmp_path) == "anthropic"
    (trajectory,), rejected = read(tmp_path)
    assert not rejected
    assert [s.action for s in trajectory] == [Action("right_click", 7, 8)]
    assert json.loads(trajectory.steps[0].action_code) == {
        "action": "right_click",
        "coordinate": [7, 8],
    }


def test_what_zoom_returns_is_not_a_screen(tmp_path: Path) -> None:
    options = [
        {"role": "user", "content": [{"type": "text", "text": "go"}, image(0)]},
        {"role": "assistant", "content": [use("z", {"action": "zoom", "region": [0, 0, 40, 20]})]},
        result("z", image(9)),
        {
            "role": "assistant",
            "content": [use("b", {"action": "left_click", "coordinate": [1, 2]})],
        },
    ]
    write_json(tmp_path / "a.json", options)
    (trajectory,), rejected = read(tmp_path)
    assert not rejected
    assert [read_picture(s.image, "") for s in trajectory] == [png(0)]


def test_a_turn_with_several_actions(tmp_path: Path) -> None:
    several = [
        use("1", {"action": "left_click", "coordinate": [1, 2]}),
        use("2", {"action": "type", "text": "a"}),
    ]
    options = [{"role": "user", "content": [{"type": "text", "text": "go"}, image(0)]}]
    write_json(tmp_path / "a.json", [*options, {"role": "assistant", "content": several}])
    (trajectory,), (rejected,) = read(tmp_path)
    assert [s.action.type for s in trajectory] == ["click"]
    assert (rejected.where, rejected.field) == ("entry 1", "screenshot")


@pytest.mark.parametrize(
    ("number", "message", "fields", "reason"),
    [
        (3, {"action": "left_click", "coordinate": [400, 0]}, ["input"], "outside the 400x200"),
        (3, {"action": "left_click", "coordinate": [1]}, ["input"], "[x, y]"),
        (3, {"action": "dance"}, ["input"], "dance"),
        (3, None, ["input"], "object"),
        (
            4,
            result("b", {"type": "image", "source": {"type": "url"}}),
            ["source.type", "screenshot"],
            "url",
        ),
        (4, result("b", {"type": "image", "source": None}), ["source", "screenshot"], "object"),
        (
            4,
            result("b", {"type": "image", "source": NO_PICTURE}),
            ["image", "screenshot"],
            "readable",
        ),
        (4, result("b", 5), ["content[0]", "screenshot"], "object"),
        (4, {"role": "user", "content": [5]}, ["content[0]", "screenshot"], "object"),
    ],
)
def test_what_is_broken_is_counted(
    number: int, message: Any, fields: list[str], reason: str, tmp_path: Path
) -> None:
    options = messages(tmp_path)
    options[number] = (
        message if number == 4 else {"role": "assistant", "content": [use("b", message)]}
    )
    write_json(tmp_path / "run.json", {"messages": options})
    (trajectory,), rejected = read(tmp_path)
    assert [(r.file, r.field) for r in rejected] == [("run.json", field) for field in fields]
    assert rejected[0].where == f"messages {number}"
    assert reason in rejected[0].reason
    assert len(trajectory.steps) == 1
