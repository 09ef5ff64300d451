"""Typed actions: a point in a field that the dialect does not have is never passed on as it is."""

import contextlib
import itertools
import json

import pytest

from hijack_data.actions import parse_actions
from hijack_data.actions.dialects.computer_13 import NAMES as COMPUTER_13
from hijack_data.actions.dialects.computer_tools import ANTHROPIC_NAMES, OPENAI_NAMES
from hijack_data.coords import CoordMap
from hijack_data.errors import ActionError

HALF = CoordMap((540, 960), (1080, 1920))
SIZE = (540, 960)

# What each action needs, without a point where it can do without one.
NEEDED = {
    "MOVE_TO": {"x": 100, "y": 200},
    "DRAG_TO": {"x": 100, "y": 200},
    "click": {"x": 100, "y": 200},
    "double_click": {"x": 100, "y": 200},
    "move": {"x": 100, "y": 200},
    "drag": {"path": [[100, 200], [300, 400]]},
    "mouse_move": {"coordinate": [100, 200]},
    "left_click_drag": {"coordinate": [100, 200]},
    "zoom": {"region": [100, 200, 300, 400]},
}
# Fields that hold a point, here (51, 62), under all the names that models make up.
STRAY = [
    {"coordinates": [51, 62]},
    {"coordinate": [51, 62]},
    {"Coordinate": [51, 62]},
    {"start_coordinate": [51, 62]},
    {"end_coordinate": [51, 62]},
    {"x": 51, "y": 62},
    {"X": 51, "Y": 62},
    {"x1": 51, "y1": 62},
    {"start_x": 51, "start_y": 62},
    {"to": [51, 62]},
    {"point": "<point>51 62</point>"},
    {"position": {"x": 51, "y": 62}},
    {"start_box": "(51,62)"},
    {"where": "51, 62"},
    {"target": "51"},
    {"ms": [51, 62]},
    {"region": [51, 62, 71, 82]},
    {"box": [51, 62, 71, 82]},
    {"path": [[51, 62], [71, 82]]},
    {"path": [{"x": 51, "y": 62}]},
    {"args": {"points": [{"at": [51, 62]}]}},
    {"parameters": {"x": 51, "y": 62}},
    {"parameters": {"coordinate": [51, 62]}},
]
ACTIONS = [
    *(("computer_13", "action_type", name) for name in COMPUTER_13),
    *(("openai", "type", name) for name in OPENAI_NAMES),
    *(("anthropic", "action", name) for name in ANTHROPIC_NAMES),
]


@pytest.mark.parametrize(("dialect", "field", "name"), ACTIONS)
def test_a_stray_point_is_mapped_or_refused(dialect, field, name):
    needed = NEEDED.get(name, {})
    for stray, nested in itertools.product(STRAY, (False, True)):
        action = {field: name, **needed, **stray}
        if nested:
            action = {field: name, "parameters": {**needed, **stray}}
        with contextlib.suppress(ActionError):
            mapped = HALF.typed_to_screen(action, dialect)
            assert "51" not in json.dumps(mapped)


@pytest.mark.parametrize(
    ("dialect", "action", "reason"),
    [
        (
            "anthropic",
            {"action": "left_click", "coordinates": [5, 6]},
            "anthropic left_click has no field 'coordinates', got .5, 6., .*mean 'coordinate'",
        ),
        ("anthropic", {"action": "left_click", "x": 5, "y": 6}, "no field 'x'"),
        ("anthropic", {"action": "left_click", "region": [1, 2, 3, 4]}, "no field 'region'"),
        ("openai", {"type": "keypress", "keys": ["a"], "x": 5, "y": 6}, "no field 'x'"),
        ("openai", {"type": "drag", "path": [{"x": 1, "y": 2, "z": 3}]}, "no field 'z'"),
        ("openai", {"type": "click", "x": 1, "y": 2, "Y": 3}, "no field 'Y'.*mean 'y'"),
        ("computer_13", {"action_type": "CLICK", "parameters": {}, "x": 5}, "no field 'x'"),
        ("computer_13", {"action_type": "CLICK", "parameters": {"coordinate": [5, 6]}}, "'coord"),
        ("ui_tars", "scroll(spot='<point>5 6</point>', direction='up')", "no field 'spot'"),
        ("ui_tars", "click(start_box='(5,6)', point='(7,8)')", "start_box is given twice"),
        ("ui_tars", "click(start_box='(5,6)', start_box='(7,8)')", "start_box is given twice"),
        ("ui_tars_1.5", "drag(start_box='(5,6)', end_box='(7,8)', end_box='(9,9)')", "end_box is"),
        ("ui_tars_1.5", "wait(start_box='(5,6)')", "takes no point"),
        ("ui_tars_1.5", "hotkey(key='a', start_box='(5,6)')", "takes no point"),
        ("ui_tars_1.5", "type(content='a', start_box='(5,6)')", "takes no point"),
        ("ui_tars_1.5", "type(content='it's')\nclick(start_box='(5,6)')", "not clear where"),
    ],
)
def test_the_message_names_the_field_and_the_likely_one(dialect, action, reason):
    for task in (HALF.typed_to_screen, parse_actions):
        with pytest.raises(ActionError, match=reason):
            task(action, dialect, **({"size": SIZE} if task is parse_actions else {}))


@pytest.mark.parametrize(
    ("dialect", "action"),
    [
        ("anthropic", {"action": "left_click", "note": "at the top", "id": 7, "coordinates": None}),
        ("anthropic", {"action": "key", "text": "a", "repeat": 3}),
        ("openai", {"type": "wait", "ms": 500, "id": "call_1", "pending_safety_checks": []}),
        ("openai", {"type": "screenshot", "status": "completed", "path": "shots/first.png"}),
        ("computer_13", {"action_type": "PRESS", "parameters": {"key": "a", "presses": 2}}),
        ("ui_tars_1.5", "scroll(direction='down', amount='5')"),
        ("ui_tars_1.5", "click(start_box='(0,0)', end_box='')"),
    ],
)
def test_fields_that_hold_no_point_may_stay(dialect, action):
    assert HALF.typed_to_screen(action, dialect) == action
    parse_actions(action, dialect, SIZE)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "Action: click(start_box='(1,2)')\nThought: no\nAction: click(start_box='(3,4)')",
            "Action: click(start_box='(2,4)')\nThought: no\nAction: click(start_box='(6,8)')",
        ),
        (
            "Action: click(start_box='(1,2)')\nAction: finished()",
            "Action: click(start_box='(2,4)')\nAction: finished()",
        ),
        (
            "Action: I will click at (1,2)\nAction: drag(start_box='(1,2)', end_box='(3,4)')",
            "Action: I will click at (1,2)\nAction: drag(start_box='(2,4)', end_box='(6,8)')",
        ),
        (
            "Action: type(content='x\nAction: click(start_box=\"(1,2)\")')\nAction: wait()",
            "Action: type(content='x\nAction: click(start_box=\"(1,2)\")')\nAction: wait()",
        ),
        (
            "Action: wait()\nclick(start_box='(1,2)')\nclick(start_box='(3,4)')",
            "Action: wait()\nclick(start_box='(2,4)')\nclick(start_box='(6,8)')",
        ),
        (
            "click(start_box='(1,2)') click(start_box='(3,4)')",
            "click(start_box='(2,4)') click(start_box='(6,8)')",
        ),
        (
            "Action: click(start_box='(1,2)', end_box='(3,4)')",
            "Action: click(start_box='(2,4)', end_box='(6,8)')",
        ),
    ],
)
def test_every_action_of_a_text_is_mapped(text, expected):
    assert HALF.typed_to_screen(text, "ui_tars_1.5") == expected


@pytest.mark.parametrize(
    "text",
    [
        r"Action: type(content='x\nAction: click(start_box=\'(1,2)\')')",
        "Action: type(content='x\nAction: click(start_box=\\'(1,2)\\')')",
        "Action: type(content=\"a\nclick(start_box='(1,2)')\nhotkey(key='enter')\")",
        "Action: type(content='click(start_box=\\'(365,795)\\')\nvim process.py')",
        "type(content='it's raw')",
        "type(content='a)\n\n(3,4)')\n\nwait()",
    ],
)
def test_what_is_typed_is_not_mapped(text):
    assert HALF.typed_to_screen(text, "ui_tars_1.5") == text
    assert parse_actions(text, "ui_tars_1.5", SIZE)[0].type == "type"


@pytest.mark.parametrize(
    "text",
    [
        "Action: click(start_box='(1,2)'\nAction: wait()",
        "Action: type(content='it's\nAction: wait()",
        "Action: press(start_box='(1,2)')\nAction: wait()",
        "Action: click(start_box='(1,2)') or drag(start_box='(3,4)')\nAction: wait()",
    ],
)
def test_an_earlier_action_that_cannot_be_read_is_refused(text):
    with pytest.raises(ActionError, match="no whole action at character"):
        HALF.typed_to_screen(text, "ui_tars_1.5")
