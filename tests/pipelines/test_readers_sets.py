"""AITZ, GUIAct, browser-use and LeRobot: what their layouts have of their own."""

import base64
import json
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from hijack_data.types import Action
from pipelines.readers import detect_format
from pipelines.readers.recorded_pictures import read_picture

from support.formats import aitz, browser_use, guiact, png, write_json, write_table
from support.recordings import read_source


def change(file: Path, *keys: Any, **values: Any) -> None:
    """Change an object in a JSON file."""
    data = json.loads(file.read_text())
    node = data
    for key in keys:
        node = node[key]
    node.update(values)
    write_json(file, data)


@pytest.mark.parametrize(
    ("step", "expected"),
    [
        # y before x, of a picture of 400x200; less than 0.04 apart, the click is where it was lifted
        (
            {"result_touch_yx": "[0.10, 0.50]", "result_lift_yx": "[0.12, 0.52]"},
            Action("click", 208, 24),
        ),
        (
            {"result_touch_yx": "[0.9, 0.5]", "result_lift_yx": "[0.1, 0.25]"},
            Action("drag", 200, 180, 100, 20),
        ),
        ({"result_action_type": 3, "result_action_text": "tea"}, Action("type", text="tea")),
        ({"result_action_type": 6}, Action("other")),
        ({"result_action_type": 11}, Action("fail")),
        # CAGUI's
        (
            {"result_action_type": 0, "result_touch_yx": [0.5, 0.5], "result_lift_yx": [0.5, 0.5]},
            Action("other", 200, 100),
        ),
        ({"result_action_type": 1, "duration": 1500}, Action("wait", amount=1.5)),
    ],
)
def test_actions_of_aitz(step: dict[str, Any], expected: Action, tmp_path: Path) -> None:
    aitz(tmp_path)
    change(tmp_path / "GENERAL-1/GENERAL-1.json", 0, **step)
    (trajectory,), rejected = read_source(tmp_path, "aitz")
    assert not rejected
    assert trajectory.steps[0].action == expected


@pytest.mark.parametrize(
    ("step", "reason"),
    [
        ({"result_action_type": 9}, "is not an action of Android in the Wild"),
        ({"result_lift_yx": "[100, 50]"}, "outside"),
        ({"image_path": "general/GENERAL-1/none.png"}, "is not in the source folder"),
    ],
)
def test_what_aitz_does_not_have(step: dict[str, Any], reason: str, tmp_path: Path) -> None:
    aitz(tmp_path)
    change(tmp_path / "GENERAL-1/GENERAL-1.json", 0, **step)
    (trajectory,), (rejected,) = read_source(tmp_path, "aitz")
    assert reason in rejected.reason
    assert len(trajectory.steps) == 1


@pytest.mark.parametrize(
    ("label", "expected", "box"),
    [
        # the middle of 0.25..0.5 of 400 and 0.1..0.3 of 200
        (
            {"name": "Click", "element": {"related": "<box>0.250, 0.100, 0.500, 0.300</box>"}},
            Action("click", 150, 40),
            (100, 20, 200, 60),
        ),
        (
            {"name": "select", "text": "a", "element": {"related": "<box>0, 0, 0.5, 0.5</box>"}},
            Action("other", 100, 50),
            (0, 0, 200, 100),
        ),
        ({"name": "input", "text": "tea"}, Action("type", text="tea"), None),
        (
            {
                "name": "swipe",
                "dual_point": {
                    "related": {"from": "<point>0.5, 0.9</point>", "to": "<point>0.5, 0.1</point>"}
                },
            },
            Action("drag", 200, 180, 200, 20),
            None,
        ),
        # One and a half pictures of 200 pixels down.
        (
            {"name": "scroll", "scroll": {"related": {"down": "1.5", "right": "0"}}},
            Action("scroll", amount=-3),
            None,
        ),
        ({"name": "copy", "text": "x"}, Action("hotkey", keys=("ctrl", "c")), None),
        ({"name": "answer", "text": "task impossible"}, Action("fail"), None),
    ],
)
def test_actions_of_guiact(label: Any, expected: Action, box: Any, tmp_path: Path) -> None:
    guiact(tmp_path)
    change(tmp_path / "web-multi_test_data.json", 0, actions_label=label)
    (trajectory,), rejected = read_source(tmp_path, "guiact")
    assert not rejected
    assert (trajectory.steps[0].action, trajectory.steps[0].target_box) == (expected, box)


def test_typing_into_an_element_of_guiact_is_a_click_and_the_text(tmp_path: Path) -> None:
    guiact(tmp_path)
    label = {"name": "input", "text": "it's", "point": {"related": "<point>0.25, 0.25</point>"}}
    change(tmp_path / "web-multi_test_data.json", 0, actions_label=[label])
    (trajectory,), _ = read_source(tmp_path, "guiact")
    assert trajectory.steps[0].action == Action("click", 100, 50)
    assert trajectory.steps[0].action_code == 'pyautogui.click(100, 50)\npyautogui.write("it\'s")'


@pytest.mark.parametrize(
    ("change_of", "reason"),
    [
        (
            {
                "actions_label": {
                    "name": "tap",
                    "point": {
                        "related": "<point>0.5, 0.5</point>",
                        "absolute": "<point>10, 10</point>",
                    },
                }
            },
            "are two places",
        ),
        (
            {"actions_label": {"name": "tap", "point": {"related": "<point>50, 50</point>"}}},
            "outside",
        ),
        ({"actions_label": []}, "is empty"),
        ({"image_id": "none"}, "convert_parquet_to_png.py"),
    ],
)
def test_what_guiact_does_not_say(change_of: Any, reason: str, tmp_path: Path) -> None:
    guiact(tmp_path)
    change(tmp_path / "web-multi_test_data.json", 0, **change_of)
    (trajectory,), (rejected,) = read_source(tmp_path, "guiact")
    assert reason in rejected.reason
    assert len(trajectory.steps) == 1


def test_rows_of_guiact_that_are_no_episode_are_one_each(tmp_path: Path) -> None:
    guiact(tmp_path)
    file = tmp_path / "web-multi_test_data.json"
    change(file, 0, uid="uid_image_a_qa_01")
    change(file, 1, uid="uid_image_a_qa_02", question="another")
    value, rejected = read_source(tmp_path, "guiact")
    assert not rejected
    assert [(t.id, t.instruction) for t in value] == [
        ("uid_image_a_qa_01", "do it"),
        ("uid_image_a_qa_02", "another"),
    ]


@pytest.mark.parametrize(
    ("action", "expected"),
    [
        ({"input": {"index": 3, "text": "tea"}}, Action("other", text="tea")),
        # Relative to the page's view, whose pixels are not those of the picture.
        ({"click": {"coordinate_x": 5, "coordinate_y": 6}}, Action("other")),
        ({"send_keys": {"keys": "Control+o"}}, Action("hotkey", keys=("ctrl", "o"))),
        ({"wait": {"seconds": 3}}, Action("wait", amount=3)),
        ({"my_own": {"x": 1}}, Action("other")),
        ({"done": {"text": "no", "success": False}}, Action("fail", text="no")),
    ],
)
def test_actions_of_browser_use(action: Any, expected: Action, tmp_path: Path) -> None:
    browser_use(tmp_path)
    change(tmp_path / "run.json", "history", 0, "model_output", action=[action, {"wait": {}}])
    (trajectory,), rejected = read_source(tmp_path, "browser_use")
    assert not rejected
    assert trajectory.steps[0].action == expected


def test_pictures_of_browser_use(tmp_path: Path) -> None:
    browser_use(tmp_path)
    file = tmp_path / "run.json"
    text = base64.b64encode(png(5)).decode()
    change(file, "history", 0, "state", screenshot=text)
    change(file, "history", 1, "state", screenshot_path="C:\\x\\gone.png")
    (tmp_path / "task.json").unlink()
    (trajectory,), (rejected_step, untold) = read_source(tmp_path, "browser_use")
    assert [read_picture(s.image, "") for s in trajectory] == [png(5)]
    assert "'gone.png' is neither beside the history nor in screenshots/" in rejected_step.reason
    assert (untold.field, trajectory.instruction) == ("instruction", "")
    Image.new("RGB", (4, 4)).save(tmp_path / "step_2.png")
    change(file, "history", 1, "state", screenshot_path="step_2.png")
    assert "no page was open" in read_source(tmp_path, "browser_use")[1][0].reason


def lerobot(folder: Path, **features: Any) -> Path:
    """A LeRobot set of two episodes, whose second begins in the first file."""
    info = {
        "codebase_version": "v3.0",
        "fps": 1,
        "features": {
            "observation.image": {"dtype": "image", "shape": [200, 400, 3]},
            "action": {"dtype": "string", "shape": [1]},
            **features,
        },
    }
    write_json(folder / "meta/info.json", info)
    write_table(
        folder / "meta/tasks.parquet",
        [{"task_index": 0, "task": "a"}, {"task_index": 1, "task": "b"}],
    )

    def frame(episode: int, index: int, action: str) -> dict[str, Any]:
        picture = {"bytes": png(10 * episode + index), "path": None}
        about = {"episode_index": episode, "frame_index": index, "task_index": episode}
        return {"observation.image": picture, "action": action, **about}

    click = "pyautogui.click(100, 50)"
    write_table(
        folder / "data/chunk-000/file-000.parquet",
        [frame(0, 0, click), frame(0, 1, "DONE"), frame(1, 0, click)],
    )
    write_table(
        folder / "data/chunk-000/file-001.parquet",
        [frame(1, 1, "pyautogui.click(0.3, 0.2)"), frame(1, 2, "DONE")],
    )
    return folder


def test_lerobot(tmp_path: Path) -> None:
    lerobot(tmp_path / "set")
    assert detect_format(tmp_path) == "lerobot"
    (first, two), (rejected,) = read_source(tmp_path, "lerobot")
    assert [(t.id, t.instruction, len(t.steps)) for t in (first, two)] == [
        ("set/000000", "a", 2),
        ("set/000001", "b", 2),
    ]
    assert [s.index for s in two] == [0, 2]
    assert first.steps[0].action == Action("click", 100, 50)
    assert [read_picture(s.image, "") for s in two] == [png(10), png(12)]
    assert "fraction" in rejected.reason


@pytest.mark.parametrize(
    ("features", "reason"),
    [
        ({"action": {"dtype": "float32", "shape": [7]}}, "nothing says which number is a place"),
        ({"observation.image": {"dtype": "video", "shape": [3, 200, 400]}}, "use_videos=False"),
        (
            {"observation.wrist": {"dtype": "image", "shape": [3, 2, 4]}},
            "exactly one must be the screen",
        ),
    ],
)
def test_lerobot_sets_that_are_refused(features: Any, reason: str, tmp_path: Path) -> None:
    lerobot(tmp_path / "set", **features)
    value, (rejected,) = read_source(tmp_path, "lerobot")
    assert not value
    assert reason in rejected.reason
    change(tmp_path / "set/meta/info.json", codebase_version="v2.1")
    _, (rejected,) = read_source(tmp_path, "lerobot")
    assert "convert the set to v3.0" in rejected.reason
