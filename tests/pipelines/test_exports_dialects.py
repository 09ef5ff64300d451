"""What a dialect writes is read back as the same action."""

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hijack_data.actions import parse_actions
from hijack_data.coords import CoordMap, smart_resize
from hijack_data.errors import ActionError
from hijack_data.types import Action
from pipelines.dataset.columns import ACTION
from pipelines.exports.dialects import DIALECTS, action_text

SIZE = (1080, 1920)


def row(action: Action, code: str = "", size: tuple[int, int] = SIZE) -> dict[str, Any]:
    values = {name: getattr(action, name) for name in ACTION}
    keys = None if action.keys is None else list(action.keys)
    return {
        "action": {**values, "keys": keys},
        "action_code": code,
        "height": size[0],
        "width": size[1],
    }


SAID = [
    (Action("click", 10, 20), "pyautogui.click(10, 20)", "click(start_box='(5,19)')"),
    (
        Action("double_click", 960, 540),
        "pyautogui.doubleClick(960, 540)",
        "left_double(start_box='(500,500)')",
    ),
    (
        Action("right_click", 960, 540),
        "pyautogui.rightClick(960, 540)",
        "right_single(start_box='(500,500)')",
    ),
    (Action("triple_click", 1, 2), "pyautogui.tripleClick(1, 2)", None),
    (Action("middle_click", 1, 2), "pyautogui.middleClick(1, 2)", None),
    (Action("move", 1, 2), "pyautogui.moveTo(1, 2)", None),
    (Action("mouse_down", 1, 2), "pyautogui.mouseDown(1, 2)", None),
    (Action("mouse_up"), "pyautogui.mouseUp()", None),
    (Action("click"), "pyautogui.click()", None),
    (
        Action("drag", 0, 0, 960, 540),
        "pyautogui.moveTo(0, 0)\npyautogui.dragTo(960, 540, button='left')",
        "drag(start_box='(0,0)', end_box='(500,500)')",
    ),
    (Action("drag", x2=960, y2=540), "pyautogui.dragTo(960, 540, button='left')", None),
    (Action("drag", 1, 2), None, None),
    (
        Action("scroll", 960, 540, amount=-5.0),
        "pyautogui.scroll(-5, 960, 540)",
        "scroll(start_box='(500,500)', direction='down')",
    ),
    (Action("scroll", amount=3), "pyautogui.scroll(3)", None),
    (
        Action("hotkey", keys=("a",), amount=2.0),
        "pyautogui.keyDown('a')\npyautogui.sleep(2)\npyautogui.keyUp('a')",
        None,
    ),
    (Action("scroll", 1, 2), None, None),
    (
        Action("type", text="it's\n\\"),
        'pyautogui.write("it\'s\\n\\\\")',
        "type(content='it\\'s\\n\\\\')",
    ),
    (Action("type"), None, None),
    (Action("hotkey", keys=("ctrl", "c")), "pyautogui.hotkey('ctrl', 'c')", "hotkey(key='ctrl c')"),
    (Action("hotkey", keys=("enter",)), "pyautogui.press('enter')", "hotkey(key='enter')"),
    (Action("hotkey", keys=("ctrl", "+")), "pyautogui.hotkey('ctrl', '+')", None),
    (Action("hotkey"), None, None),
    (Action("key_down", keys=("shift",)), "pyautogui.keyDown('shift')", None),
    (Action("key_up", keys=("a", "b")), "pyautogui.keyUp('a')\npyautogui.keyUp('b')", None),
    (
        Action("click", 5, 6, keys=("ctrl", "shift")),
        (
            "pyautogui.keyDown('ctrl')\npyautogui.keyDown('shift')\npyautogui.click(5, 6)\n"
            "pyautogui.keyUp('shift')\npyautogui.keyUp('ctrl')"
        ),
        None,
    ),
    (Action("wait"), "WAIT", "wait()"),
    (Action("done"), "DONE", "finished()"),
    (Action("done", text="42"), "DONE", "finished(content='42')"),
    (Action("fail"), "FAIL", "call_user()"),
    (Action("other"), None, None),
]


@pytest.mark.parametrize(("action", "code", "tars"), SAID)
def test_the_texts(action: Action, code: str | None, tars: str | None) -> None:
    for dialect, text in (("pyautogui", code), ("ui_tars", tars)):
        if text is None:
            with pytest.raises(ActionError, match=f"{dialect} cannot say '{action.type}'"):
                action_text(row(action), dialect)
        else:
            assert action_text(row(action), dialect) == text


def test_recorded_code_is_kept() -> None:
    assert action_text(
        row(Action("click", 1, 2), "x = 1\npyautogui.click(x, 2)"), "pyautogui"
    ).startswith("x = 1")
    assert action_text(row(Action("click", 1, 2), " \n"), "pyautogui") == "pyautogui.click(1, 2)"


@pytest.mark.parametrize(
    ("code", "kept"),
    [
        ("import pyautogui\npyautogui.click(1, 2)", True),
        ("  pyautogui.write('\\d')", True),
        (" DONE\n", True),
        ('{"action_type": "CLICK", "parameters": {"text": "pyautogui"}}', False),
        ("Thought: pyautogui would do.\nAction: click(start_box='(1,2)')", False),
        ("click(start_box='(1,2)')", False),
        ("computer.terminate(status='success')", False),
        ("pyautogui.click(", False),
        ("(" * 5000, False),
        ("\0", False),
        ("", False),
    ],
)
def test_code_in_other_dialects_is_not_passed_on_as_pyautogui(code: str, kept: bool) -> None:
    expected = code if kept else "pyautogui.click(7, 8)"
    assert action_text(row(Action("click", 7, 8), code), "pyautogui") == expected


@pytest.mark.parametrize(
    "action", [action for action, code, _ in SAID if code and action.type not in ("done",)]
)
def test_code_is_read_back(action: Action) -> None:
    if action.type in ("key_up",):  # two keys are two calls
        return
    (value,) = parse_actions(action_text(row(action), "pyautogui"), "pyautogui", SIZE)
    if action.type == "hotkey":  # for how long keys are held is not read back
        action = replace(action, amount=None)
    assert value == action


@given(
    st.integers(0, 1919),
    st.integers(0, 1079),
    st.integers(0, 1919),
    st.integers(0, 1079),
    st.text(max_size=20),
)
def test_ui_tars_is_read_back_to_the_same_place(
    x: int, y: int, x2: int, y2: int, text: str
) -> None:
    (drag,) = parse_actions(
        action_text(row(Action("drag", x, y, x2, y2)), "ui_tars"), "ui_tars", SIZE
    )
    given_points, found_points = (x, y, x2, y2), (drag.x, drag.y, drag.x2, drag.y2)
    assert all(abs(a - b) <= 2 for a, b in zip(given_points, found_points, strict=True))  # type: ignore[operator]
    result = smart_resize(*SIZE)
    (click,) = parse_actions(
        action_text(row(Action("click", x, y)), "ui_tars_1.5"), "ui_tars_1.5", result
    )
    back = CoordMap.model(SIZE).to_screen((click.x, click.y))  # type: ignore[arg-type]
    assert abs(back[0] - x) <= 1
    assert abs(back[1] - y) <= 1
    (typed,) = parse_actions(
        action_text(row(Action("type", text=text)), "ui_tars"), "ui_tars", SIZE
    )
    assert typed.text == text


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_screen_that_no_model_takes(dialect: str) -> None:
    tall = row(Action("click", 1, 2), size=(30000, 10))
    if dialect == "ui_tars_1.5":
        with pytest.raises(ValueError, match="200 times"):
            action_text(tall, dialect)
    else:
        assert action_text(tall, dialect)
