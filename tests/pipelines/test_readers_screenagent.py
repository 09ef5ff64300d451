import json
from pathlib import Path
from typing import Any

import pytest

from hijack_data.types import Action, Trajectory
from pipelines.readers import Rejected, detect_format, get_reader

from support.formats import png, screenagent

FIRST = "s1/2023-12-20_19-31-30.json"


def read(path: Path) -> tuple[list[Trajectory], list[Rejected]]:
    items = list(get_reader("screenagent").read(path))
    return [i for i in items if isinstance(i, Trajectory)], [
        i for i in items if isinstance(i, Rejected)
    ]


def change(folder: Path, **values: Any) -> None:
    """Change fields of the first step."""
    record = json.loads((folder / FIRST).read_text())
    (folder / FIRST).write_text(json.dumps({**record, **values}, ensure_ascii=False))


def mouse(kind: str, x: float | None = 100, y: float = 50, **more: Any) -> dict[str, Any]:
    fields = {} if x is None else {"mouse_position": {"width": x, "height": y}}
    return {"action_type": "MouseAction", "mouse_action_type": kind, **fields, **more}


def keys(kind: str, **more: Any) -> dict[str, Any]:
    return {"action_type": "KeyboardAction", "keyboard_action_type": kind, **more}


TALK = {"action_type": "PlanAction", "element": "打开"}


@pytest.mark.parametrize(
    ("actions", "expected"),
    [
        ([mouse("click", mouse_button="left")], Action("click", 100, 50)),
        ([mouse("click", mouse_button="right")], Action("right_click", 100, 50)),
        ([mouse("double_click")], Action("double_click", 100, 50)),
        ([mouse("move")], Action("move", 100, 50)),
        ([mouse("drag")], Action("drag", x2=100, y2=50)),
        ([mouse("scroll_down", None, scroll_repeat=10)], Action("scroll", amount=-10)),
        ([mouse("scroll_up", scroll_repeat=2)], Action("scroll", 100, 50, amount=2)),
        ([keys("text", keyboard_text="冯诺依曼")], Action("type", text="冯诺依曼")),
        ([keys("press", keyboard_key="Return")], Action("hotkey", keys=("enter",))),
        ([keys("press", keyboard_key="ctrl+C")], Action("hotkey", keys=("ctrl", "C"))),
        ([{"action_type": "WaitAction", "wait_time": 1.5}], Action("wait", amount=1.5)),
        ([TALK, TALK], Action("other")),
        ([TALK, mouse("click"), keys("text", keyboard_text="a")], Action("click", 100, 50)),
    ],
)
def test_actions(actions: list[Any], expected: Action, tmp_path: Path) -> None:
    change(screenagent(tmp_path), actions=actions)
    (trajectory,), rejected = read(tmp_path)
    assert not rejected
    assert trajectory.steps[0].action == expected
    assert json.loads(trajectory.steps[0].action_code) == actions


@pytest.mark.parametrize(
    ("changes", "field", "reason"),
    [
        ({"actions": [mouse("click", 400, 50)]}, "actions[0]", "(400, 50) is outside the 400x200"),
        ({"actions": [mouse("click", 50, 200)]}, "actions[0]", "(50, 200) is outside the 400x200"),
        ({"actions": [mouse("click", -3)]}, "actions[0]", "outside"),
        ({"actions": [TALK, mouse("click", float("nan"))]}, "actions[1]", "finite"),
        ({"actions": [mouse("click", 10**400)]}, "actions[0]", "finite"),
        ({"actions": [mouse("click", 1e300)]}, "actions.mouse_position", "beyond"),
        ({"actions": [mouse("jump")]}, "actions.mouse_action_type", "'jump'"),
        ({"actions": [keys("sing")]}, "actions.keyboard_action_type", "'sing'"),
        ({"actions": [keys("text", keyboard_text=3)]}, "actions[0]", "string"),
        ({"actions": [{"action_type": "Dance"}]}, "actions[0].action_type", "'Dance'"),
        ({"actions": []}, "actions", "empty"),
        ({"actions": [4]}, "actions[0]", "object"),
        ({"actions": None}, "actions", "missing"),
        ({"video_width": 1024}, "video_width", "400x200"),
        ({"video_height": 100}, "video_height", "400x200"),
        ({"saved_image_name": "9.jpg"}, "saved_image_name", "not in the source"),
        ({"saved_image_name": "../../../x.jpg"}, "saved_image_name", "leaves"),
        ({"saved_image_name": "/etc/hostname"}, "saved_image_name", "absolute"),
        ({"session_id": None}, "session_id", "missing"),
        ({"task_prompt": ""}, "task_prompt", "empty"),
    ],
)
def test_a_bad_step_is_counted_and_the_others_stay(
    changes: dict[str, Any], field: str, reason: str, tmp_path: Path
) -> None:
    change(screenagent(tmp_path), **changes)
    (trajectory,), (rejected,) = read(tmp_path)
    assert (rejected.file, rejected.field) == (FIRST, field)
    assert reason in rejected.reason
    assert [s.index for s in trajectory] == [1]
    assert trajectory.instruction == "打开浏览器"


def test_pictures_may_lie_beside_the_steps(tmp_path: Path) -> None:
    screenagent(tmp_path)
    for file in (tmp_path / "s1" / "images").iterdir():
        file.rename(tmp_path / "s1" / file.name)
    (tmp_path / "s1" / "images").rmdir()
    (trajectory,), rejected = read(tmp_path)
    assert not rejected
    assert [Path(s.image).read_bytes() for s in trajectory] == [png(0), png(1)]


def test_two_steps_on_one_picture_and_two_sessions_of_one_id(tmp_path: Path) -> None:
    screenagent(tmp_path)
    text = (tmp_path / FIRST).read_text()
    (tmp_path / FIRST.replace(".json", "_translate.json")).write_text(text)
    (tmp_path / "s2" / "images").mkdir(parents=True)
    (tmp_path / "s2" / "images" / "0.jpg").write_bytes(png(0))
    (tmp_path / "s2" / "a.json").write_text(text)
    (trajectory,), rejected = read(tmp_path)
    assert len(trajectory.steps) == 2
    assert [(r.file, r.field) for r in rejected] == [
        (FIRST.replace(".json", "_translate.json"), "saved_image_name"),
        ("s2", "session_id"),
    ]


def test_a_step_of_another_session_in_the_folder(tmp_path: Path) -> None:
    screenagent(tmp_path)
    second = tmp_path / "s1" / "2023-12-20_19-31-31.json"
    second.write_text(json.dumps({**json.loads(second.read_text()), "session_id": "s7"}))
    (trajectory,), (rejected,) = read(tmp_path)
    assert (trajectory.id, len(trajectory.steps)) == ("s1", 1)
    assert rejected.field == "session_id"


def test_the_real_sessions(shared_data: Path) -> None:
    folder = shared_data / "trajectories" / "screenagent"
    assert detect_format(folder) == "screenagent"
    trajectories, rejected = read(folder)
    assert not rejected
    assert len(trajectories) == 15
    assert sum(len(t.steps) for t in trajectories) == 119
    first = trajectories[0]
    assert (first.id, first.instruction) == (
        "02ea503d419c440cbda9e42263706d6a",
        "上网查找冯诺依曼的相关资料",
    )
    # width 487, height 193
    assert [s.action for s in first][:2] == [Action("other"), Action("click", 487, 193)]
    assert json.loads(first.steps[1].action_code)[1]["keyboard_text"] == "冯诺依曼"
    assert Path(first.steps[1].image).name == "2023-12-20_19-33-28-140419.jpg"
    beyond = [
        s.action.point
        for t in trajectories
        for s in t
        if s.action.point and s.action.point[0] >= 768
    ]
    assert beyond  # with x and y swapped, these would leave the 1024x768 screen


def test_a_double_click_on_an_icon_lands_on_it(shared_data: Path) -> None:
    import numpy as np
    from PIL import Image

    session = shared_data / "trajectories" / "screenagent" / "1707c19bc8d1476698ccbdefe06537ad"
    (trajectory,), _ = read(session)
    step = trajectory.steps[1]
    assert step.action == Action("double_click", 65, 57)
    picture = np.asarray(Image.open(step.image).convert("L")).astype(int)
    icon, empty = picture[30:85, 40:90], picture[500:555, 700:750]
    assert icon.std() > 3 * empty.std()
