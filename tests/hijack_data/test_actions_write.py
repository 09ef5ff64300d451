"""Actions as pyautogui code, and back."""

import pytest

from hijack_data.actions import parse_pyautogui
from hijack_data.actions.dialects.pyautogui_write import write_pyautogui
from hijack_data.errors import ActionError
from hijack_data.types import Action

CODES = [
    (Action("click", 3, 4), "pyautogui.click(3, 4)"),
    (Action("double_click", 3, 4), "pyautogui.doubleClick(3, 4)"),
    (Action("triple_click", 3, 4), "pyautogui.tripleClick(3, 4)"),
    (Action("right_click", 3, 4), "pyautogui.rightClick(3, 4)"),
    (Action("middle_click", 3, 4), "pyautogui.middleClick(3, 4)"),
    (Action("move", 3, 4), "pyautogui.moveTo(3, 4)"),
    (Action("scroll", 3, 4, amount=-5.0), "pyautogui.scroll(-5, 3, 4)"),
    (Action("drag", 1, 2, 3, 4), "pyautogui.moveTo(1, 2)\npyautogui.dragTo(3, 4, button='left')"),
    (Action("hotkey", keys=("esc",)), "pyautogui.press('esc')"),
    (Action("hotkey", keys=("alt", "f4")), "pyautogui.hotkey('alt', 'f4')"),
    (Action("type", text="it's\n"), 'pyautogui.write("it\'s\\n")'),
    (Action("wait"), "WAIT"),
    (Action("done"), "DONE"),
    (Action("fail"), "FAIL"),
]


@pytest.mark.parametrize(("action", "code"), CODES)
def test_what_is_written_is_read_back(action, code):
    assert write_pyautogui(action) == code
    again = parse_pyautogui(code, (100, 100))
    assert (again.type, again.keys, again.text, again.amount) == (
        action.type,
        action.keys,
        action.text,
        action.amount,
    )
    assert (again.point, again.x2, again.y2) == (action.point, action.x2, action.y2)


def test_keys_are_held_for_as_long_as_the_action_says():
    assert write_pyautogui(Action("hotkey", keys=("ctrl", "a"), amount=1.5)).splitlines() == [
        "pyautogui.keyDown('ctrl')",
        "pyautogui.keyDown('a')",
        "pyautogui.sleep(1.5)",
        "pyautogui.keyUp('a')",
        "pyautogui.keyUp('ctrl')",
    ]


def test_keys_that_are_held_go_down_before_and_up_after():
    pyautogui = write_pyautogui(Action("click", 3, 4, keys=("ctrl", "shift")))
    assert [line.split("(")[0].rpartition(".")[2] for line in pyautogui.splitlines()] == [
        "keyDown",
        "keyDown",
        "click",
        "keyUp",
        "keyUp",
    ]


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (Action("hotkey"), "pyautogui cannot say 'hotkey' with nothing else"),
        (Action("scroll", 1, 2), "cannot say 'scroll' with x, y"),
        (Action("drag", 1, 2), "cannot say 'drag' with x, y"),
        (Action("type"), "cannot say 'type'"),
        (Action("other", 1, 2), "cannot say 'other'"),
    ],
)
def test_what_pyautogui_cannot_say(action, message):
    with pytest.raises(ActionError, match=message):
        write_pyautogui(action)
