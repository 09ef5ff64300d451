"""Reading pyautogui code into the one Action of the library."""

import contextlib
import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hijack_data.actions import parse_actions, parse_pyautogui
from hijack_data.errors import ActionError, ParameterError, ParameterTypeError
from hijack_data.types import ACTION_TYPES, Action

SIZE = (720, 1280)


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        ("pyautogui.click(10, 20)", Action("click", 10, 20)),
        ("pyautogui.leftClick(10, 20)", Action("click", 10, 20)),
        ("pyautogui.click()", Action("click")),
        ("pyautogui.click(x=10.5, y=5000)", Action("click", 11, 719)),
        ("pyautogui.click(10, 20, 2)", Action("double_click", 10, 20)),
        ("pyautogui.click(10, 20, clicks=3)", Action("triple_click", 10, 20)),
        ("pyautogui.click(10, 20, clicks=4)", Action("other", 10, 20)),
        ("pyautogui.click(10, 20, button='right')", Action("right_click", 10, 20)),
        ("pyautogui.click(10, 20, button='middle')", Action("middle_click", 10, 20)),
        ("pyautogui.click(10, 20, clicks=2, button='right')", Action("other", 10, 20)),
        ("pyautogui.click(10, 20, button=pyautogui.RIGHT)", Action("right_click", 10, 20)),
        ("pyautogui.doubleClick((10, 20))", Action("double_click", 10, 20)),
        ("pyautogui.doubleClick(10, 20, button='right')", Action("other", 10, 20)),
        ("computer.tripleClick(x=10, y=20)", Action("triple_click", 10, 20)),
        ("pyautogui.rightClick(10, 20)", Action("right_click", 10, 20)),
        ("pyautogui.middleClick(10, 20)", Action("middle_click", 10, 20)),
        ("x = 10; pyautogui.moveTo(x, 20, duration=2)", Action("move", 10, 20)),
        (
            "pyautogui.moveTo(1, 2)\npyautogui.dragTo(3, 4, button='left')",
            Action("drag", 1, 2, 3, 4),
        ),
        ("pyautogui.dragTo(3, 4)", Action("drag", x2=3, y2=4)),
        ("pyautogui.moveTo(1, 2)\npyautogui.dragTo(3, 4, button='right')", Action("other", 1, 2)),
        ("pyautogui.moveTo(5, 6); pyautogui.dragRel(10, -20)", Action("drag", 5, 6, 15, 0)),
        ("pyautogui.moveTo(5, 6); pyautogui.moveRel(10, -2)", Action("move", 15, 4)),
        ("pyautogui.moveRel(10, -2)", Action("other")),
        ("pyautogui.dragRel(10, -2)", Action("other")),
        (
            "pyautogui.moveTo(1, 2); pyautogui.mouseDown(); pyautogui.moveTo(3, 4); pyautogui.mouseUp()",
            Action("drag", 1, 2, 3, 4),
        ),
        ("pyautogui.mouseDown(1, 2); pyautogui.mouseUp(3, 4)", Action("drag", 1, 2, 3, 4)),
        ("pyautogui.mouseDown(1, 2); pyautogui.mouseUp()", Action("click", 1, 2)),
        ("pyautogui.mouseDown(1, 2); pyautogui.moveTo(3, 4)", Action("other", 1, 2)),
        ("pyautogui.mouseDown(1, 2)", Action("mouse_down", 1, 2)),
        ("pyautogui.mouseUp()", Action("mouse_up")),
        ("pyautogui.mouseDown(button='right')", Action("other")),
        ("pyautogui.moveTo(1, 2); pyautogui.click()", Action("click", 1, 2)),
        ("pyautogui.moveTo(1, 2); pyautogui.click(3, 4)", Action("click", 3, 4)),
        ("pyautogui.moveTo(1, 2); time.sleep(1); pyautogui.moveTo(3, 4)", Action("move", 3, 4)),
        ("pyautogui.scroll(-54)", Action("scroll", amount=-54)),
        ("pyautogui.moveTo(5, 6)\npyautogui.scroll(-54)", Action("scroll", 5, 6, amount=-54)),
        ("pyautogui.scroll(3, 5, 6)", Action("scroll", 5, 6, amount=3)),
        ("pyautogui.scroll(3, 5, 6); pyautogui.scroll(4)", Action("scroll", 5, 6, amount=7)),
        ("pyautogui.hscroll(3, 5, 6)", Action("other", 5, 6)),
        ("pyautogui.write('hi')", Action("type", text="hi")),
        ("pyautogui.typewrite(message='a' 'b', interval=0.1)", Action("type", text="ab")),
        ("pyautogui.write('a'); pyautogui.write('b')", Action("type", text="ab")),
        (
            "pyautogui.write(message='VAMPIRE')\npyautogui.press(keys=['enter'])",
            Action("type", text="VAMPIRE\n"),
        ),
        ("pyautogui.write('a'); pyautogui.press('tab')", Action("other")),
        (
            "import pyperclip\npyperclip.copy('é')\npyautogui.hotkey('ctrl', 'v')",
            Action("type", text="é"),
        ),
        ("pyperclip.copy('é')", Action("other", text="é")),
        ("pyautogui.press('enter')", Action("hotkey", keys=("enter",))),
        ("pyautogui.press(['a'])", Action("hotkey", keys=("a",))),
        ("pyautogui.press(['a', 'b'])", Action("other")),
        ("pyautogui.press('tab', presses=3)", Action("other")),
        ("pyautogui.hotkey('ctrl', 'c')", Action("hotkey", keys=("ctrl", "c"))),
        ("pyautogui.hotkey(['ctrl', 'c'])", Action("hotkey", keys=("ctrl", "c"))),
        ("pyautogui.hotkey(keys=['ctrl', 'c'])", Action("hotkey", keys=("ctrl", "c"))),
        ("pyautogui.hotkey()", Action("other")),
        ("pyautogui.write(pyautogui.linear)", Action("other")),
        ("pyautogui.keyDown('shift')", Action("key_down", keys=("shift",))),
        ("pyautogui.keyUp('shift')", Action("key_up", keys=("shift",))),
        (
            "pyautogui.keyDown('ctrl'); pyautogui.keyDown('a'); pyautogui.keyUp('a'); pyautogui.keyUp('ctrl')",
            Action("hotkey", keys=("ctrl", "a")),
        ),
        (
            "pyautogui.keyDown('ctrl'); pyautogui.press('a'); pyautogui.keyUp('ctrl')",
            Action("hotkey", keys=("ctrl", "a")),
        ),
        (
            "pyautogui.keyDown('ctrl'); pyautogui.click(1, 2); pyautogui.keyUp('ctrl')",
            Action("click", 1, 2, keys=("ctrl",)),
        ),
        (
            "pyautogui.keyDown('ctrl'); pyautogui.click(1, 2); pyautogui.keyUp('alt')",
            Action("other", 1, 2),
        ),
        (
            "pyautogui.keyDown('shift'); pyautogui.write('a'); pyautogui.keyUp('shift')",
            Action("other", text="a"),
        ),
        ("computer.wait()", Action("wait")),
        ("import time\ntime.sleep(2); time.sleep(0.5)", Action("wait", amount=2.5)),
        ("pyautogui.sleep(3)", Action("wait", amount=3)),
        ("computer.terminate(status='success')", Action("done")),
        ("computer.terminate('failure')", Action("fail")),
        ("computer.terminate()", Action("other")),
        (" DONE\n", Action("done")),
        ("WAIT", Action("wait")),
        ("FAIL", Action("fail")),
        ("", Action("other")),
        ("pyautogui.click(1, 2); pyautogui.click(3, 4)", Action("other", 1, 2)),
        ("pyautogui.write('a'); pyautogui.click(3, 4)", Action("other", 3, 4)),
        (
            "import time\n'''click(1, 2)'''\ntime.sleep(1)\npyautogui.click(10, 20)\n",
            Action("click", 10, 20),
        ),
    ],
)
def test_code_becomes_one_action(code, expected):
    assert parse_pyautogui(code, SIZE) == expected
    assert parse_actions(code, "pyautogui", SIZE) == [expected]


def test_without_a_size_points_are_only_rounded():
    assert parse_pyautogui("pyautogui.click(5000.5, -3)", None) == Action("click", 5001, -3)
    assert parse_pyautogui("pyautogui.moveTo(5, 6); pyautogui.moveRel(-9, 0)", None) == Action(
        "move", -4, 6
    )


def test_fractions_become_pixels():
    drag = (
        "pyautogui.moveTo(x=0.328, y=0.4697)\npyautogui.dragTo(x=0.5025, y=0.6039, button='left')"
    )
    assert parse_pyautogui(drag, SIZE, normalized=True) == Action("drag", 420, 338, 643, 435)
    assert parse_pyautogui("pyautogui.click(1.0, 0)", SIZE, normalized=True) == Action(
        "click", 1279, 0
    )
    assert parse_pyautogui("pyautogui.scroll(-54)", SIZE, normalized=True) == Action(
        "scroll", amount=-54
    )
    code = "pyautogui.moveTo(0.5, 0.5); pyautogui.dragRel(0.25, 0)"
    assert parse_pyautogui(code, SIZE, normalized=True) == Action("drag", 640, 360, 960, 360)
    with pytest.raises(ActionError, match="pixels already"):
        parse_pyautogui("pyautogui.click(100, 200)", SIZE, normalized=True)
    with pytest.raises(ParameterError, match="size"):
        parse_pyautogui("pyautogui.click(0.1, 0.2)", None, normalized=True)


@pytest.mark.parametrize(
    "code",
    [
        "pyautogui.click(x, 20)",
        "click on the button",
        "pyautogui.click('a.png')",
        "for i in range(3):\n    pyautogui.click(i, 4)",
        "import os\npyautogui.click(1, 2)",
        "\x00",
        "-" * 99_999 + "1",
    ],
)
def test_what_cannot_be_read_is_an_action_error(code):
    with pytest.raises(ActionError):
        parse_pyautogui(code, SIZE)


def test_deep_nesting_of_held_keys_is_refused():
    with pytest.raises(ActionError, match="nested too deeply"):
        parse_pyautogui("pyautogui.keyDown('a')\n" * 1500 + "pyautogui.keyUp('a')\n" * 1500, SIZE)


def test_code_must_be_text():
    with pytest.raises(ParameterTypeError):
        parse_pyautogui(None, SIZE)


def test_every_recorded_action_parses(shared_data):
    folder = shared_data / "trajectories"
    codes = [
        step["action"]
        for path in sorted((folder / "agentnetbench").glob("*.json"))
        for step in json.loads(path.read_text())["steps"]
    ]
    raw = (folder / "agentnet_raw" / "raw_example.jsonl").read_text().splitlines()
    codes += [step["value"]["code"] for line in raw for step in json.loads(line)["traj"]]
    actions = [parse_pyautogui(code, SIZE, normalized=True) for code in codes]
    counts = {name: sum(a.type == name for a in actions) for name in ACTION_TYPES}
    assert {name: n for name, n in counts.items() if n} == EXPECTED_COUNTS
    for code, action in zip(codes, actions, strict=True):
        assert (action.point is None) == ("x=" not in code)
        assert action.type != "click" or code.startswith("pyautogui.click")


EXPECTED_COUNTS = {
    "click": 27,
    "right_click": 1,
    "drag": 3,
    "scroll": 2,
    "type": 4,
    "hotkey": 5,
    "done": 4,
}


def test_recorded_truth_agrees(shared_data):
    """AgentNetBench also holds each action as data: the points must agree to half a pixel."""
    checked = 0
    for path in sorted((shared_data / "trajectories" / "agentnetbench").glob("*.json")):
        for step in json.loads(path.read_text())["steps"]:
            truth = [
                t["params"]["position"]
                for t in step["ground_truth_actions"]
                if "position" in t["params"]
            ]
            if len(truth) != step["action"].count("x="):
                continue
            action = parse_pyautogui(step["action"], SIZE, normalized=True)
            for x, y, true in zip(
                (action.x, action.x2), (action.y, action.y2), truth, strict=False
            ):
                assert abs(x - true["x"] * 1280) <= 0.5
                assert abs(y - true["y"] * 720) <= 0.5
                checked += 1
    assert checked >= 20


PIECES = [
    "pyautogui.click(",
    "pyautogui.keyDown('a')",
    "moveTo(1, 2)",
    "x",
    ")",
    "\n",
    "; ",
    "=",
    "*",
    ",",
    "9",
    "'",
    "[",
    "]",
    "(",
    "pyautogui.mouseUp(",
    "pyautogui.scroll(3)",
    "pyautogui.dragRel(1, 2)",
    "pyautogui.hotkey(",
    "time.sleep(1)",
    "lambda: ",
]


@settings(max_examples=200, deadline=None)
@given(st.text(), st.lists(st.sampled_from(PIECES)), st.booleans(), st.sampled_from([None, SIZE]))
def test_garbage_is_refused_or_read(text, pieces, normalized, size):
    for code in (text, "".join(pieces), "\n".join(pieces)):
        with contextlib.suppress(ActionError, ParameterError):
            action = parse_pyautogui(code, size, normalized)
            assert action.type in ACTION_TYPES
            assert (
                size is None
                or action.point is None
                or (0 <= action.x < 1280 and 0 <= action.y < 720)
            )
