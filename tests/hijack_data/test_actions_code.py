"""Typed actions as code: nothing of what the model asked for is lost on the way."""

import json
from dataclasses import replace

import pytest

from hijack_data.actions import (
    DIALECTS,
    RESIZED_DIALECTS,
    code_of,
    parse_actions,
    parse_pyautogui,
    read_action,
)
from hijack_data.coords import CoordMap
from hijack_data.errors import ActionError, ParameterTypeError, UnknownNameError
from hijack_data.smart_resize import smart_resize

SIZE = (1080, 1920)


def resized(dialect):
    return smart_resize(*SIZE) if dialect in RESIZED_DIALECTS else SIZE


def qwen(**arguments):
    data = json.dumps({"name": "computer_use", "arguments": arguments})
    return f"<tool_call>\n{data}\n</tool_call>"


def openai(type, **fields):
    return {"type": type, **fields}


def anthropic(action, **fields):
    return {"action": action, **fields}


PATH = [{"x": 1, "y": 2}, {"x": 30, "y": 40}, [50, 60]]
WRITTEN = [
    ("openai", openai("click", x=1, y=2), ["pyautogui.click(1, 2)"]),
    ("openai", openai("screenshot"), ["WAIT"]),
    ("openai", openai("wait"), ["WAIT"]),
    ("openai", openai("click", x=1, y=2, button="back"), ["pyautogui.hotkey('alt', 'left')"]),
    ("openai", openai("click", x=1, y=2, button="forward"), ["pyautogui.hotkey('alt', 'right')"]),
    ("openai", openai("keypress", keys=["CTRL", "S"]), ["pyautogui.hotkey('ctrl', 's')"]),
    ("openai", openai("keypress", keys=["S"]), ["pyautogui.press('S')"]),
    (
        "openai",
        openai("scroll", x=1, y=2, scroll_x=0, scroll_y=250),
        ["pyautogui.scroll(-3, 1, 2)"],
    ),
    ("openai", openai("scroll", x=1, y=2, scroll_x=0, scroll_y=20), ["pyautogui.scroll(-1, 1, 2)"]),
    (
        "openai",
        openai("scroll", x=1, y=2, scroll_x=300, scroll_y=0),
        ["pyautogui.hscroll(3, 1, 2)"],
    ),
    (
        "openai",
        openai("scroll", x=1, y=2, scroll_x=-100, scroll_y=-100, keys=["CTRL"]),
        [
            "pyautogui.keyDown('ctrl')\npyautogui.scroll(1, 1, 2)\npyautogui.hscroll(-1, 1, 2)\n"
            "pyautogui.keyUp('ctrl')"
        ],
    ),
    (
        "openai",
        openai("drag", path=PATH),
        [
            "pyautogui.moveTo(1, 2)\npyautogui.mouseDown()\npyautogui.moveTo(30, 40)\n"
            "pyautogui.moveTo(50, 60)\npyautogui.mouseUp()"
        ],
    ),
    (
        "openai",
        openai("drag", path=PATH[:2]),
        ["pyautogui.moveTo(1, 2)\npyautogui.dragTo(30, 40, button='left')"],
    ),
    ("anthropic", anthropic("zoom", region=[0, 0, 10, 10]), ["WAIT"]),
    ("anthropic", anthropic("cursor_position"), ["WAIT"]),
    (
        "anthropic",
        anthropic("key", text="ctrl+Z", repeat=2),
        ["pyautogui.hotkey('ctrl', 'z')\npyautogui.hotkey('ctrl', 'z')"],
    ),
    (
        "anthropic",
        anthropic("hold_key", text="shift", duration=1.5),
        ["pyautogui.keyDown('shift')\npyautogui.sleep(1.5)\npyautogui.keyUp('shift')"],
    ),
    (
        "anthropic",
        anthropic("type", text="hi", coordinate=[3, 4], press_enter=True),
        ["pyautogui.click(3, 4)\npyautogui.write('hi\\n')"],
    ),
    # Names of keys as xdotool has them; pyautogui ignores what it does not know.
    ("anthropic", anthropic("key", text="ctrl+minus"), ["pyautogui.hotkey('ctrl', '-')"]),
    ("anthropic", anthropic("key", text="ctrl++"), ["pyautogui.hotkey('ctrl', '+')"]),
    ("anthropic", anthropic("key", text="KP_Enter"), ["pyautogui.press('enter')"]),
    ("anthropic", anthropic("key", text="Prior"), ["pyautogui.press('pageup')"]),
    ("anthropic", anthropic("key", text="ctrl c"), ["pyautogui.hotkey('ctrl', 'c')"]),
    ("anthropic", anthropic("key", text="ctrl + c"), ["pyautogui.hotkey('ctrl', 'c')"]),
    (
        "anthropic",
        anthropic("key", text="ctrl+a Down Down"),
        ["pyautogui.hotkey('ctrl', 'a')\npyautogui.press('down')\npyautogui.press('down')"],
    ),
    ("anthropic", anthropic("type", text="a", press_enter=True), ["pyautogui.write('a\\n')"]),
    ("openai", openai("keypress", keys=["ctrl+a"]), ["pyautogui.hotkey('ctrl', 'a')"]),
    (
        "anthropic",
        anthropic("scroll", coordinate=[3, 4], scroll_direction="left", scroll_amount=2),
        ["pyautogui.hscroll(-2, 3, 4)"],
    ),
    (
        "anthropic",
        anthropic("scroll", scroll_direction="right", scroll_amount=2, text="shift"),
        ["pyautogui.keyDown('shift')\npyautogui.hscroll(2)\npyautogui.keyUp('shift')"],
    ),
    (
        "anthropic",
        anthropic("left_click_drag", start_coordinate=[1, 2], coordinate=[3, 4]),
        ["pyautogui.moveTo(1, 2)\npyautogui.dragTo(3, 4, button='left')"],
    ),
    ("qwen3_vl", qwen(action="left_click", coordinate=[500, 500]), ["pyautogui.click(960, 540)"]),
    ("qwen3_vl", qwen(action="hscroll", pixels=300), ["pyautogui.hscroll(3)"]),
    ("qwen3_vl", qwen(action="key", keys=["ctrl", "S"]), ["pyautogui.hotkey('ctrl', 's')"]),
    ("qwen3_vl", qwen(action="terminate", status="failure"), ["FAIL"]),
    ("qwen2.5_vl", qwen(action="left_click", coordinate=[966, 546]), ["pyautogui.click(960, 540)"]),
    (
        "qwen2.5_vl",
        qwen(action="key", keys=["enter"]) + qwen(action="wait", time=1),
        ["pyautogui.press('enter')", "WAIT"],
    ),
    ("ui_tars", "Action: click(start_box='[490,490,510,510]')", ["pyautogui.click(960, 540)"]),
    (
        "ui_tars_1.5",
        "Thought: x\nAction: scroll(start_box='(966,546)', direction='right')",
        ["pyautogui.hscroll(5, 960, 540)"],
    ),
    ("ui_tars_1.5", "Action: finished(content='ok')", ["DONE"]),
    ("ui_tars", "Action: call_user()", ["FAIL"]),
    ("computer_13", "WAIT", ["WAIT"]),
    (
        "computer_13",
        {"action_type": "SCROLL", "parameters": {"dx": 2, "dy": -3}},
        ["pyautogui.scroll(-3)\npyautogui.hscroll(2)"],
    ),
    ("computer_13", {"action_type": "SCROLL", "dx": -2}, ["pyautogui.hscroll(-2)"]),
]


@pytest.mark.parametrize(("dialect", "action", "code"), WRITTEN)
def test_a_typed_action_as_code(dialect, action, code):
    assert code_of(action, dialect, SIZE) == code
    for item in code:
        read_action(item)  # a live desktop lets it through


@pytest.mark.parametrize(("dialect", "action", "code"), WRITTEN)
def test_an_action_says_all_that_its_code_does_or_is_other(dialect, action, code):
    (first, *_) = parse_actions(action, dialect, resized(dialect))
    if dialect in RESIZED_DIALECTS:
        first = CoordMap(resized(dialect), SIZE).action_to_screen(first)
    said = parse_pyautogui(code[0], SIZE)
    # Amounts are in seconds or rounded to notches there.
    same = replace(first, amount=None) == replace(said, amount=None)
    assert same or first.type in ("other", "wait", "done", "fail")


def test_the_models_own_size_of_the_picture_counts():
    call = qwen(action="left_click", coordinate=[48, 27])
    assert code_of(call, "qwen2.5_vl", SIZE, (54, 96)) == ["pyautogui.click(969, 549)"]


@pytest.mark.parametrize(
    ("dialect", "action", "problem"),
    [
        ("openai", openai("click", x="1", y=2), "must be a number"),
        ("openai", openai("click", x=float("nan"), y=2), "finite"),
        ("openai", openai("click", x=1, y=2, button="sixth"), "cannot say"),
        ("anthropic", anthropic("left_click", coordinate="[1, 2, 3]"), "must be [x, y]"),
        ("anthropic", anthropic("key", text="a", repeat=1000), "repeat must be"),
        ("anthropic", anthropic("key", text="a", repeat=True), "repeat must be"),
        ("anthropic", anthropic("hold_key", text="a", duration=1e6), "duration must be"),
        ("anthropic", anthropic("open_web_browser"), "no action"),
        ("anthropic", anthropic("key", text="ctrl+entre"), "did you mean 'enter'"),
        ("openai", openai("keypress", keys=["XF86Copy"]), "not the name of a key"),
        ("qwen3_vl", qwen(action="left_click", coordinate=[1800, 500]), "outside the 0 to 1000"),
        ("qwen3_vl", qwen(action="key", keys=["ArrowUp", "up"]), "names 'up' more than once"),
        ("anthropic", anthropic("key", text="ctrl c ctrl v"), "names 'ctrl' more than once"),
        ("qwen2.5_vl", qwen(action="left_click", coordinate=[0.4, 0.5]), "fractions"),
        ("qwen2.5_vl", qwen(action="open", text="x"), "no such key or gesture"),
        ("pyautogui", "pyautogui.click(1, 2)", "code already"),
    ],
)
def test_what_cannot_be_read_or_done_is_refused(dialect, action, problem):
    with pytest.raises(ActionError, match=problem.replace("[", r"\[").replace("]", r"\]")):
        code_of(action, dialect, SIZE)


@pytest.mark.parametrize(
    ("dialect", "action", "problem"),
    [
        ("openai", openai("double_click", x=1, y=2, button="right"), "cannot say"),
        ("openai", openai("drag", path=PATH, button="right"), "cannot say"),
        ("openai", openai("type", text="a", keys=["CTRL"]), "does not take 'keys'"),
        ("anthropic", anthropic("left_click", ref="ref_7"), "does not take 'ref'"),
        ("anthropic", anthropic("hold_key", text="a", repeat=3), "does not take 'repeat'"),
        ("anthropic", anthropic("type", text="a", press_enter="true"), "press_enter must be"),
        ("qwen3_vl", qwen(action="left_click", coordinate=[1, 2], button="right"), "'button'"),
        ("qwen3_vl", qwen(action="type", text="a", clear=True), "does not take 'clear'"),
        ("qwen3_vl", qwen(action="terminate", status="failed"), "status must be one of success"),
        ("ui_tars", "Action: click(start_box='(1,2)', modifiers='ctrl')", "'modifiers'"),
        ("gemini", {"name": "click", "args": {"x": 1, "y": 2, "button": "right"}}, "'button'"),
        ("glm", '{"action_type": "status", "goal_status": "failed"}', "goal_status must be one of"),
    ],
)
def test_what_would_be_ignored_is_refused(dialect, action, problem):
    with pytest.raises(ActionError, match=problem):
        code_of(action, dialect, SIZE)


@pytest.mark.parametrize(
    ("dialect", "action", "code"),
    [
        ("openai", openai("click", x=1, y=2, button="left", keys=None), "pyautogui.click(1, 2)"),
        (
            "glm",
            "left_click(start_box='[500,500]', element_info='OK')",
            "pyautogui.click(960, 540)",
        ),
        ("qwen3_vl", qwen(action="terminate", status="success", text="42"), "DONE"),
        (
            "openai",
            openai("click", x=1, y=2, button="back", keys=["CTRL"]),
            "pyautogui.keyDown('ctrl')\npyautogui.hotkey('alt', 'left')\npyautogui.keyUp('ctrl')",
        ),
    ],
)
def test_what_asks_for_nothing_or_is_done_is_accepted(dialect, action, code):
    assert code_of(action, dialect, SIZE) == [code]


def test_every_dialect_has_its_way():
    for dialect in DIALECTS[1:]:
        with pytest.raises((ActionError, ParameterTypeError)):
            code_of({"nothing": 1}, dialect, SIZE)
    with pytest.raises(UnknownNameError, match="did you mean"):
        code_of("", "qwen3vl", SIZE)
