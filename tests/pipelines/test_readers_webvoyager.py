import json
from pathlib import Path
from typing import Any

import pytest

import hijack_data as hj
from hijack_data.types import Action, Trajectory
from pipelines import build
from pipelines.exports import export
from pipelines.readers import Rejected, detect_format, get_reader

from support.formats import png, webvoyager, write_json

RECORDS = "taskX--1/interact_messages.json"


def read(path: Path) -> tuple[list[Trajectory], list[Rejected]]:
    items = list(get_reader("webvoyager").read(path))
    return [i for i in items if isinstance(i, Trajectory)], [
        i for i in items if isinstance(i, Rejected)
    ]


def change(folder: Path, number: int, message: Any) -> None:
    messages = json.loads((folder / RECORDS).read_text())
    messages[number] = message
    write_json(folder / RECORDS, messages)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Click [5]", Action("other")),
        # A click on the mark, select all, the text, Enter: no one action says that without a place.
        ("Type [12]; green; tea", Action("other", text="green; tea\n")),
        # Two thirds of the window of 200 pixels.
        ("Scroll [WINDOW]; down", Action("scroll", amount=-1)),
        ("Scroll [WINDOW]; up", Action("scroll", amount=1)),
        ("Scroll [3]; up", Action("other")),
        ("Wait", Action("wait", amount=5)),
        ("GoBack", Action("other")),
        ("Google", Action("other")),
        ("ANSWER; it is 5\nor 6", Action("done", text="it is 5\nor 6")),
    ],
)
def test_actions(text: str, expected: Action, tmp_path: Path) -> None:
    change(
        webvoyager(tmp_path),
        2,
        {"role": "assistant", "content": f"Thought: Action: x\nAction: {text}"},
    )
    (trajectory,), rejected = read(tmp_path)
    assert not rejected
    assert trajectory.steps[0].action == expected
    assert trajectory.steps[0].action_code == text
    assert trajectory.steps[0].action.point is None


def test_replies_go_with_the_screenshots_of_their_number(tmp_path: Path) -> None:
    webvoyager(tmp_path)
    (trajectory,), rejected = read(tmp_path)
    assert not rejected
    assert (trajectory.id, trajectory.instruction) == ("taskX--1", "Find it.")
    assert [s.index for s in trajectory] == [1, 2]
    assert [Path(s.image).read_bytes() for s in trajectory] == [png(0), png(1)]


@pytest.mark.parametrize(
    ("message", "field", "reason"),
    [
        ({"role": "assistant", "content": "no idea"}, "content", "names no action"),
        ({"role": "assistant", "content": "Action: Dance [3]"}, "content", "Dance"),
        ({"role": "assistant", "content": 5}, "content", "must be text"),
        ({"content": "x"}, "role", "missing"),
        ("hello", "", "object"),
    ],
)
def test_a_bad_message_is_counted(message: Any, field: str, reason: str, tmp_path: Path) -> None:
    change(webvoyager(tmp_path), 2, message)
    (trajectory,), (rejected,) = read(tmp_path)
    assert (rejected.file, rejected.where, rejected.field) == (RECORDS, "message 2", field)
    assert reason in rejected.reason
    assert len(trajectory.steps) == 1


def test_a_reply_without_a_screenshot(tmp_path: Path) -> None:
    webvoyager(tmp_path)
    (tmp_path / "taskX--1" / "screenshot1.png").unlink()
    (trajectory,), (rejected,) = read(tmp_path)
    assert [s.index for s in trajectory] == [2]
    assert (rejected.where, rejected.field) == ("message 2", "screenshot")


@pytest.mark.parametrize(
    ("messages", "field"), [([], ""), ([{"role": "user", "content": "a"}], ""), ({}, "")]
)
def test_a_task_without_steps(messages: Any, field: str, tmp_path: Path) -> None:
    write_json(webvoyager(tmp_path) / "b" / "interact_messages.json", messages)
    trajectories, (rejected,) = read(tmp_path)
    assert len(trajectories) == 1
    assert (rejected.file, rejected.field) == ("b/interact_messages.json", field)


def test_the_real_tasks(shared_data: Path) -> None:
    folder = shared_data / "trajectories" / "webvoyager"
    assert detect_format(folder) == "webvoyager"
    (recipes, amazon), rejected = read(folder)
    assert not rejected
    assert [s.action.type for s in recipes] == [
        "other",
        "other",
        "scroll",
        "other",
        "scroll",
        "done",
    ]
    assert recipes.steps[1].action == Action("other", text="Baked Salmon\n")
    assert [s.action.amount for s in recipes if s.action.type == "scroll"] == [-5, -5]
    assert recipes.instruction.startswith("Find a recipe for Baked Salmon")
    assert recipes.instruction.endswith("user reviews.")
    assert [s.action_code for s in amazon][:2] == [
        "Type [2]; green Xbox Wireless controller 4 stars",
        "Click [33]",
    ]
    assert [Path(s.image).name for s in amazon] == [f"screenshot{i}.png" for i in (1, 2, 3)]
    assert read(folder / "taskAmazon--0")[0][0].steps[1].action_code == "Click [33]"


def test_typing_is_not_exported_as_if_it_were_text_alone(tmp_path: Path) -> None:
    webvoyager(tmp_path / "source")
    build(tmp_path / "source", tmp_path / "set", corruptions={"half": hj.Resolution(scale=0.5)})
    report = export(tmp_path / "set", tmp_path / "chat", to="chat")
    assert report.total == 2  # the answer, on both pictures
    assert [count for reason, count in report.unsaid.items() if "other" in reason] == [2]
