"""Arrow folders of `save_to_disk`, and tables whose rows are steps."""

import json
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import hijack_data as hj
from hijack_data.types import Action
from pipelines import build, open_dataset, verify
from pipelines.readers import detect_format
from pipelines.readers.recorded_pictures import read_picture
from pipelines.readers.recording_facts import episode_id

from support.formats import chat_code, png, write_table
from support.recordings import read_source

datasets = pytest.importorskip("datasets")
TASK = "Task(description='Press it', task_id=None, metadata={'a': [1]}, computer=None)"

read = partial(read_source, name="parquet")


def trace(folder: Path, events: list[tuple[str, dict[str, Any], list[int]]]) -> Path:
    """Save events as cua-bench does: name, data, and the numbers of the pictures."""
    features = datasets.Features(
        {
            "event_name": datasets.Value("string"),
            "data_json": datasets.Value("string"),
            "data_images": datasets.Sequence(datasets.Image()),
            "trajectory_id": datasets.Value("string"),
            "timestamp": datasets.Value("string"),
        }
    )
    rows = [
        {
            "event_name": name,
            "data_json": json.dumps(data),
            "data_images": [{"bytes": png(number), "path": None} for number in pictures],
            "trajectory_id": "run-1",
            "timestamp": "",
        }
        for name, data, pictures in events
    ]
    datasets.Dataset.from_list(rows, features=features).save_to_disk(folder)
    return folder


RESET = ("reset", {"task": TASK, "setup_config": {"os_type": "win11"}}, [0])


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ("ClickAction(x=100, y=50)", Action("click", 100, 50)),
        (
            "DragAction(from_x=1, from_y=2, to_x=3, to_y=4, duration=1.0)",
            Action("drag", 1, 2, 3, 4),
        ),
        ('TypeAction(text="it\'s")', Action("type", text="it's")),
        ("HotkeyAction(keys=['ctrl', 'c'])", Action("hotkey", keys=("ctrl", "c"))),
        ("ScrollAction(direction='up', amount=100)", Action("other")),
        ("DoneAction()", Action("done")),
    ],
)
def test_steps_of_cua_bench(said: str, expected: Action, tmp_path: Path) -> None:
    trace(
        tmp_path / "t",
        [
            RESET,
            ("step:before", {"action": said}, [1]),
            ("step:after", {"action": said}, [2]),
            ("evaluate", {"result": 1.0}, []),
        ],
    )
    assert detect_format(tmp_path) == "parquet"
    (trajectory,), rejected = read(tmp_path)
    assert not rejected
    assert (trajectory.id, trajectory.instruction, trajectory.platform) == (
        "run-1",
        "Press it",
        "windows",
    )
    (step,) = trajectory.steps
    assert step.action == expected
    assert read_picture(step.image, "") == png(1)
    assert step.action_code


def test_steps_of_an_agent_of_cua_bench(tmp_path: Path) -> None:
    look = {"type": "computer_call", "action": {"type": "screenshot"}}
    click = {
        "type": "computer_call",
        "action": {"type": "click", "x": 100, "y": 50, "button": "left"},
    }
    call = {"type": "function_call", "name": "computer"}
    trace(
        tmp_path / "t",
        [
            RESET,
            ("agent_step", {"output": [{"type": "reasoning"}, look, click]}, [1]),
            ("network", {"url": "x"}, []),
            ("agent_step", {"output": [call]}, [2]),
            ("agent_step", {"output": [click]}, [3]),
        ],
    )
    (trajectory,), (rejected,) = read(tmp_path)
    assert [read_picture(step.image, "") for step in trajectory] == [png(0), png(2)]
    assert {step.action for step in trajectory} == {Action("click", 100, 50)}
    assert "does not say what its coordinates count" in rejected.reason
    out = tmp_path / "out"
    build(tmp_path / "t", out, corruptions={"half": hj.Resolution(scale=0.5)})
    halves = [row for row in open_dataset(out) if row["corruption"] == "half"]
    assert [(row["action"]["x"], row["action"]["y"]) for row in halves] == [(50, 25)] * 2
    assert verify(out).ok


@pytest.mark.parametrize(
    "said",
    [
        "__import__('os').system('x')",
        "ClickAction(x=__import__('os'), y=1)",
        "click",
        "",
        None,
        "(" * 9999,
    ],
)
def test_actions_are_never_run(said: Any, tmp_path: Path) -> None:
    trace(tmp_path / "t", [RESET, ("step:before", {"action": said}, [1])])
    value, (rejected,) = read(tmp_path)
    assert not value
    assert rejected.field == "data_json.action"


def test_chat_rows_are_read_as_their_parquet(tmp_path: Path) -> None:
    chat_code(tmp_path / "parquet")
    (file,) = (tmp_path / "parquet").rglob("*.parquet")
    datasets.Dataset.from_parquet(str(file)).save_to_disk(tmp_path / "arrow")
    (trajectory,), _ = read(tmp_path / "parquet")
    (arrow_trajectory,), rejected = read(tmp_path / "arrow")
    assert not rejected
    assert [s.action for s in trajectory] == [s.action for s in arrow_trajectory]
    assert [read_picture(s.image, "") for s in trajectory] == [
        read_picture(s.image, "") for s in arrow_trajectory
    ]


def test_a_damaged_arrow_file_is_rejected(tmp_path: Path) -> None:
    trace(tmp_path / "t", [RESET, ("step:before", {"action": "DoneAction()"}, [1])])
    (file,) = (tmp_path / "t").glob("*.arrow")
    whole_bytes = file.read_bytes()
    for content in (
        b"",
        b"ARROW1 and no more",
        whole_bytes[: len(whole_bytes) // 2],
        whole_bytes[:600] + b"\xff" * 64 + whole_bytes[664:],
    ):
        file.write_bytes(content)
        value, rejected = read(tmp_path)
        assert rejected or value


def tess_row(episode: str, index: int, **action: Any) -> dict[str, Any]:
    return {
        "id": f"{episode}-{index}",
        "os_type": "ubuntu",
        "episode_id": episode,
        "step_idx": index,
        "image": {"bytes": png(index), "path": None},
        "instruction": f"do {episode}",
        "action_type": 0,
        "mouse_x": 0.25,
        "mouse_y": 0.5,
        "click_type": 1,
        "keyboard_text": "",
        **action,
    }


def test_steps_of_an_episode_are_in_order_and_none_comes_twice(tmp_path: Path) -> None:
    rows = [tess_row("a", 2), tess_row("a", 0), tess_row("a", 0, click_type=3), tess_row("a", 1)]
    write_table(tmp_path / "source" / "train.parquet", rows)
    report = build(tmp_path / "source", tmp_path / "out", corruptions={})
    assert [row["id"] for row in open_dataset(tmp_path / "out")] == [
        f"a/000{number}/clean" for number in (0, 1, 2)
    ]
    (rejected,) = report.examples
    assert rejected.startswith("train.parquet: a, step 0: step: 'a' has a step 0 already")


def test_an_episode_that_ends_in_the_next_file_is_one_episode(tmp_path: Path) -> None:
    write_table(tmp_path / "train-0.parquet", [tess_row("a", 0), tess_row("a", 1)])
    write_table(tmp_path / "train-1.parquet", [tess_row("a", 2), tess_row("b", 0)])
    trajectories, rejected = read(tmp_path)
    assert not rejected
    assert [t.id for t in trajectories] == ["a", "train-1/a", "b"]
    assert [episode_id(t) for t in trajectories] == ["a", "a", "b"]


def test_fractions_are_no_pixels_of_cua_bench(tmp_path: Path) -> None:
    trace(tmp_path / "t", [RESET, ("step:before", {"action": "ClickAction(x=0.4, y=0.3)"}, [1])])
    value, (rejected,) = read(tmp_path)
    assert not value
    assert "are fractions of the picture" in rejected.reason


def test_tess_agentnet(tmp_path: Path) -> None:
    rows = [
        tess_row("a", 0),
        tess_row("a", 1, click_type=3),
        tess_row("a", 2, click_type=9),
        tess_row("a", 3, mouse_x=100.0, mouse_y=50.0),
        tess_row("b", 0, action_type=1, keyboard_text="hello"),
        tess_row("b", 1, action_type=1, keyboard_text="<ENTER>"),
    ]
    write_table(tmp_path / "train.parquet", rows)
    (first, two), rejected = read(tmp_path)
    # A quarter of 400, half of 200.
    assert [s.action for s in first] == [
        Action("click", 100, 100),
        Action("double_click", 100, 100),
    ]
    assert [s.action for s in two] == [Action("type", text="hello"), Action("other")]
    assert [(r.where, r.field) for r in rejected] == [
        ("row 2", "action_type"),
        ("row 3", "action_type"),
    ]
    assert (first.id, first.instruction, first.platform) == ("a", "do a", "linux")
