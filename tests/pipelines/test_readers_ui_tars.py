import json
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from hijack_data.types import Action
from pipelines.errors import SourceError
from pipelines.readers import detect_format

from support.formats import png, ui_tars, ui_tars_15, url, write_json, write_lines
from support.recordings import read_source

read = partial(read_source, name="ui_tars")


def lines(folder: Path) -> list[Any]:
    return [json.loads(line) for line in (folder / "run.jsonl").read_text().splitlines()]


def test_thousandths_and_pixels_of_the_resized_picture_are_the_same_point(tmp_path: Path) -> None:
    (thousand,), _ = read(ui_tars(tmp_path / "a"))
    # 98 * 400 / 392, 49 * 200 / 196
    (pixels,), _ = read(ui_tars_15(tmp_path / "b"), name="ui_tars_1.5")
    assert thousand.steps[0].action == pixels.steps[0].action == Action("click", 100, 50)
    assert thousand.instruction == "do it"
    assert thousand.steps[1].action == Action("done", text="it is")
    assert Path(thousand.steps[1].image).read_bytes() == png(1)


def test_chat_rows_a_line_are_no_log_of_one_run(tmp_path: Path) -> None:
    rows = []
    for task in ("open the menu", "close the window"):
        content = [{"type": "text", "text": task}, {"type": "image_url", "image_url": url(0)}]
        reply = {"role": "assistant", "content": "Action: click(start_box='(10,20)')"}
        rows.append({"messages": [{"role": "user", "content": content}, reply]})
    write_lines(tmp_path / "a.jsonl", rows)
    trajectories, (rejected,) = read(tmp_path)
    assert not trajectories
    assert (rejected.field, "another conversation" in rejected.reason) == ("line 2, messages", True)


def test_a_full_screen_by_hand(tmp_path: Path) -> None:
    # smart_resize gives 1092x1932 for 1080x1920: x = 966 * 1920 / 1932 = 960, y = 546 * 1080 / 1092
    # = 540.
    (tmp_path / "0.png").write_bytes(png(0, 1920, 1080))
    options = [
        {
            "role": "user",
            "content": [
                {"type": "text", "text": "go"},
                {"type": "image_url", "image_url": "0.png"},
            ],
        },
        {"role": "assistant", "content": "Action: click(point='<point>966 546</point>')"},
    ]
    write_json(tmp_path / "a.json", options)
    (trajectory,), rejected = read(tmp_path, name="ui_tars_1.5")
    assert not rejected
    assert trajectory.steps[0].action == Action("click", 960, 540)
    (trajectory,), _ = read(tmp_path)
    # the same numbers as thousandths
    assert trajectory.steps[0].action == Action("click", 1855, 590)


@pytest.mark.parametrize(
    ("model", "expected"),
    [
        ("UI-TARS-1.5-7B", "ui_tars_1.5"),
        ("ByteDance-Seed/ui-tars-1-5", "ui_tars_1.5"),
        ("UI-TARS-72B-DPO", "ui_tars"),
        ("ui-tars-7b", "ui_tars"),
        ("doubao-1-5-ui-tars-250428", "ui_tars"),
    ],
)
def test_the_model_says_which_version_it_is(model: str, expected: str, tmp_path: Path) -> None:
    ui_tars(tmp_path, model)
    assert detect_format(tmp_path) == expected


@pytest.mark.parametrize("model", ["", "my-finetune"])
def test_a_version_that_is_not_said_is_not_guessed(model: str, tmp_path: Path) -> None:
    ui_tars(tmp_path, model)
    with pytest.raises(SourceError, match=r"ui_tars or ui_tars_1\.5; say which: --format ui_tars "):
        detect_format(tmp_path)
    assert read(tmp_path)[0][0].steps[0].action == Action("click", 100, 50)


def test_a_log_of_the_other_version_is_refused_whole(tmp_path: Path) -> None:
    ui_tars_15(tmp_path)
    trajectories, (rejected,) = read(tmp_path)
    assert not trajectories
    assert (rejected.file, rejected.field) == ("run.jsonl", "model")
    assert "ui_tars_1.5" in rejected.reason


def test_a_reply_with_two_actions_is_one_step(tmp_path: Path) -> None:
    ui_tars(tmp_path)
    options = lines(tmp_path)
    options[3]["content"] = "Thought: x\nAction: click(start_box='(500,500)')\n\ntype(content='a')"
    write_lines(tmp_path / "run.jsonl", options)
    (trajectory,), rejected = read(tmp_path)
    assert not rejected
    assert trajectory.steps[0].action == Action("click", 200, 100)
    assert trajectory.steps[0].action_code == options[3]["content"]


def test_an_instruction_of_its_own_and_content_in_parts(tmp_path: Path) -> None:
    entries = {
        "model": "ui-tars-2b",
        "instruction": "my task",
        "messages": [
            {"role": "user", "content": [{"type": "text", "text": "prompt"}]},
            {"role": "user", "content": [{"type": "image_url", "image_url": {"url": url(0)}}]},
            {"role": "assistant", "content": [{"type": "text", "text": "Action: wait()"}]},
        ],
    }
    write_json(tmp_path / "a.json", entries)
    assert detect_format(tmp_path / "a.json") == "ui_tars"
    (trajectory,), rejected = read(tmp_path)
    assert not rejected
    assert trajectory.instruction == "my task"
    assert [s.action for s in trajectory] == [Action("wait", amount=5)]


@pytest.mark.parametrize(
    ("number", "message", "fields", "reason"),
    [
        (3, {"role": "assistant", "content": "no idea"}, ["content"], "no action"),
        (
            3,
            {"role": "assistant", "content": "Action: click(start_box='(1960,5)')"},
            ["content"],
            "1960",
        ),
        (3, {"role": "assistant", "content": "Action: jump()"}, ["content"], "jump"),
        (3, {"role": "assistant", "content": None}, ["content"], "no action"),
        (2, {"role": "user", "content": []}, ["screenshot"], "no screenshot"),
        (
            2,
            {"role": "user", "content": [{"type": "image_url"}]},
            ["image", "screenshot"],
            "data: URL",
        ),
    ],
)
def test_what_is_broken_is_counted(
    number: int, message: Any, fields: list[str], reason: str, tmp_path: Path
) -> None:
    ui_tars(tmp_path)
    options = lines(tmp_path)
    options[number] = message
    write_lines(tmp_path / "run.jsonl", options)
    (trajectory,), rejected = read(tmp_path)
    assert [r.field for r in rejected] == fields
    assert reason in rejected[0].reason
    assert [s.index for s in trajectory] == [2]
