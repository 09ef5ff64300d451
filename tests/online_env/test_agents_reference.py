"""Agents without a model: random, fail and scripted."""

import json
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

from hijack_data.actions import parse_pyautogui, read_action
from hijack_data.errors import ConfigError, ParameterError
from online_env.agents.baselines import RandomActions
from online_env.agents.registry import make
from online_env.agents.scripted import Scripted, read_script


def picture(number, height=90, width=160):
    return np.random.default_rng(number).integers(0, 256, (height, width, 3), dtype=np.uint8)


def answers(agent, pictures, task="write hello"):
    return [agent.predict(task, {"screenshot": image})[1][0] for image in pictures]


def test_random_actions_can_be_repeated_anywhere():
    pictures = [picture(number) for number in range(8)]
    agent = RandomActions()
    first = answers(agent, pictures)
    agent.reset()
    assert answers(agent, pictures) == first
    assert answers(RandomActions(), pictures) == first
    assert answers(RandomActions(1), pictures) != first
    code = (
        "import numpy as np; from online_env.agents.registry import make;"
        "picture = np.random.default_rng(0).integers(0, 256, (90, 160, 3), dtype=np.uint8);"
        "print(make('random').predict('write hello', {'screenshot': picture})[1][0])"
    )
    process = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert process.stdout.strip() == first[0]


def test_picture_task_and_step_decide_random_actions():
    def draws(pictures, task="task"):
        return [answers(RandomActions(), [image] * 6, task) for image in pictures]

    value, second = draws([picture(0), picture(1)])
    assert value != second
    assert draws([picture(0)], "another task") != [value]
    assert len(set(value)) > 1
    assert draws([picture(0).reshape(160, 90, 3)]) != [value]


def test_random_actions_are_all_types_and_inside_the_picture():
    names = set()
    for number in range(300):
        (action,) = answers(RandomActions(), [picture(number, 40, 60)])
        request = read_action(action)
        if request.kind != "code":
            names.add(request.kind)
            continue
        pyautogui = parse_pyautogui(request.code, None)
        names.add(pyautogui.type)
        for point in (pyautogui.point, pyautogui.end):
            assert point is None or (0 <= point[0] < 60 and 0 <= point[1] < 40)
    assert names == {
        "click",
        "double_click",
        "right_click",
        "drag",
        "scroll",
        "type",
        "hotkey",
        "wait",
        "done",
        "fail",
    }


def test_random_actions_without_an_instruction():
    pictures = [picture(number, 1, 1) for number in range(60)]
    for action in answers(RandomActions(), pictures, ""):
        read_action(action)


def test_fail_gives_up():
    assert make("fail").predict("task", {"screenshot": picture(0)})[1] == ["FAIL"]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("moves.yaml", "- pyautogui.click(1, 2)\n- WAIT\n"),
        ("moves.json", json.dumps(["pyautogui.click(1, 2)", "WAIT"])),
    ],
)
def test_a_script_is_played_then_it_is_done(name, text, tmp_path, monkeypatch):
    (tmp_path / name).write_text(text)
    monkeypatch.setenv("AGENTHIJACK_SCRIPT", str(tmp_path / name))
    agent = make("scripted")
    pictures = [picture(0)] * 4
    assert answers(agent, pictures) == ["pyautogui.click(1, 2)", "WAIT", "DONE", "DONE"]
    agent.reset()
    assert answers(agent, pictures)[0] == "pyautogui.click(1, 2)"


def test_a_class_names_its_script(tmp_path, monkeypatch):
    monkeypatch.delenv("AGENTHIJACK_SCRIPT", raising=False)
    with pytest.raises(ParameterError, match=r"AGENTHIJACK_SCRIPT=FILE\.yaml"):
        make("scripted")
    (tmp_path / "moves.yaml").write_text("[DONE]")

    class Mine(Scripted):
        script = str(tmp_path / "moves.yaml")

    assert answers(Mine(), [picture(0)]) == ["DONE"]
    assert len(Mine.settings()["sha256"]) == 64


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "must be a list of actions"),
        ("[]", "must be a list of actions"),
        ("a: b", "must be a list of actions"),
        ("- [", "cannot be parsed"),
        ("- DONE\n- import os\n- 3\n", r"action 2: .*not allowed[\s\S]*action 3: .*string"),
    ],
)
def test_a_bad_script_names_all_mistakes(text, message, tmp_path):
    file = tmp_path / "moves.yaml"
    file.write_text(text)
    with pytest.raises(ConfigError, match=message):
        read_script(file)


def test_a_script_that_is_not_there(tmp_path):
    with pytest.raises(ConfigError, match="cannot be read"):
        read_script(tmp_path / "none.yaml")
