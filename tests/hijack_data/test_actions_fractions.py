"""Fractions of the picture where a recorded action gives pixels: refused, never the corner of the
screen."""

import pytest

from hijack_data.actions import parse_actions
from hijack_data.coords import CoordMap
from hijack_data.errors import ActionError, HijackError
from hijack_data.labels import FORMATS, Move

HALF = CoordMap((540, 960), (1080, 1920))
SIZE = (1080, 1920)

FRACTIONS = [
    ("pyautogui", "pyautogui.click(0.5, 0.25)"),
    ("pyautogui", "pyautogui.click(x=0.5, y=1)"),
    ("pyautogui", "pyautogui.moveTo((0.5, 0.25))"),
    ("pyautogui", "x, y = 0.5, 0.25\npyautogui.dragTo(x, y)"),
    ("pyautogui", "pyautogui.scroll(3, 0.5, 0.25)"),
    ("computer_13", {"action_type": "CLICK", "parameters": {"x": 0.5, "y": 0.25}}),
    ("openai", {"type": "click", "x": 0.5, "y": 0.25}),
    ("openai", {"type": "drag", "path": [{"x": 10, "y": 20}, {"x": 0.5, "y": 0.25}]}),
    ("anthropic", {"action": "left_click", "coordinate": [0.5, 0.25]}),
    (
        "anthropic",
        {"action": "left_click_drag", "start_coordinate": [0.5, 0], "coordinate": [10, 20]},
    ),
    ("ui_tars_1.5", "Action: click(start_box='(0.5,0.25)')"),
    ("ui_tars_1.5", "Action: click(start_box='[0.4,0.2,0.6,0.3]')"),
    ("ui_tars", "Action: click(start_box='(0.5,0.25)')"),
]


@pytest.mark.parametrize(("dialect", "action"), FRACTIONS)
def test_fractions_are_refused_in_recordings_and_labels(dialect, action):
    with pytest.raises(ActionError, match="are fractions"):
        parse_actions(action, dialect, SIZE)
    with pytest.raises(HijackError, match="are fractions"):
        FORMATS[dialect].map_value(action, Move(SIZE, (540, 960)))


@pytest.mark.parametrize(
    ("dialect", "action"),
    [
        ("pyautogui", "pyautogui.click(0, 0)"),
        ("pyautogui", "pyautogui.click(1, 0)"),
        ("pyautogui", "pyautogui.click(0.5, 10)"),
        ("pyautogui", "pyautogui.moveRel(0.5, 0.25)"),
        ("pyautogui", "pyautogui.scroll(0.5)"),
        ("openai", {"type": "move", "x": 0, "y": 1}),
        ("ui_tars", "Action: click(start_box='(0,0)')"),
    ],
)
def test_pixels_at_the_corner_and_offsets_are_not(dialect, action):
    parse_actions(action, dialect, SIZE)
    FORMATS[dialect].map_value(action, Move(SIZE, (540, 960)))


def test_what_a_live_agent_says_is_rounded():
    assert HALF.code_to_screen("pyautogui.click(0.5, 0.25)") == "pyautogui.click(1, 1)"
