"""Typed dialects: computer_13, UI-TARS, OpenAI and Anthropic computer tools."""

import contextlib
import copy
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hijack_data.actions import DIALECTS, parse_actions
from hijack_data.coords import CoordMap
from hijack_data.errors import (
    ActionError,
    HijackError,
    ParameterError,
    ParameterTypeError,
    UnknownNameError,
)
from hijack_data.types import ACTION_TYPES, Action

HALF = CoordMap((540, 960), (1080, 1920))
SIZE = (1080, 1920)


def nested(name, **parameters):
    return {"action_type": name, "parameters": parameters}


MAPPED = [
    (
        "computer_13",
        nested("CLICK", x=10, y=20, button="left"),
        nested("CLICK", x=20, y=40, button="left"),
    ),
    (
        "computer_13",
        {"action_type": "MOVE_TO", "x": 10, "y": 20},
        {"action_type": "MOVE_TO", "x": 20, "y": 40},
    ),
    ("computer_13", nested("DRAG_TO", x=10.25, y=5000), nested("DRAG_TO", x=21, y=1079)),
    ("computer_13", nested("SCROLL", dx=10, dy=-20), nested("SCROLL", dx=10, dy=-20)),
    ("computer_13", nested("CLICK"), nested("CLICK")),
    ("computer_13", {"action_type": "CLICK"}, {"action_type": "CLICK"}),
    ("computer_13", nested("TYPING", text="x=10"), nested("TYPING", text="x=10")),
    ("computer_13", {"action_type": "WAIT"}, {"action_type": "WAIT"}),
    ("computer_13", "DONE", "DONE"),
    ("ui_tars", "Action: click(start_box='(100,200)')", "Action: click(start_box='(100,200)')"),
    (
        "ui_tars_1.5",
        "Thought: at (1,2)\nAction: click(start_box='<|box_start|>(10,20)<|box_end|>')",
        "Thought: at (1,2)\nAction: click(start_box='<|box_start|>(20,40)<|box_end|>')",
    ),
    (
        "ui_tars_1.5",
        "left_double(start_box='[10, 20, 30, 40]')",
        "left_double(start_box='[20, 40, 60, 80]')",
    ),
    (
        "ui_tars_1.5",
        "drag(start_box='(1,2)', end_box='(3, 4)')",
        "drag(start_box='(2,4)', end_box='(6, 8)')",
    ),
    (
        "ui_tars_1.5",
        "scroll(start_box='(1,2)', direction='down')",
        "scroll(start_box='(2,4)', direction='down')",
    ),
    ("ui_tars_1.5", "type(content='(1,2) it\\'s')", "type(content='(1,2) it\\'s')"),
    (
        "ui_tars_1.5",
        (
            "Action:"
            " click(start_box='(1,2)')\n\ntype(content='a)\n\n(3,4)')\n\nclick(start_box=\"(5,6)\")"
        ),
        (
            "Action:"
            " click(start_box='(2,4)')\n\ntype(content='a)\n\n(3,4)')\n\nclick(start_box=\"(10,12)\")"
        ),
    ),
    (
        "openai",
        {"type": "click", "x": 10, "y": 20, "button": "left"},
        {"type": "click", "x": 20, "y": 40, "button": "left"},
    ),
    (
        "openai",
        {"type": "scroll", "x": 1, "y": 2, "scroll_x": 3, "scroll_y": -400},
        {"type": "scroll", "x": 2, "y": 4, "scroll_x": 3, "scroll_y": -400},
    ),
    (
        "openai",
        {"type": "drag", "path": [{"x": 1, "y": 2}, {"x": 3, "y": 4}]},
        {"type": "drag", "path": [{"x": 2, "y": 4}, {"x": 6, "y": 8}]},
    ),
    (
        "openai",
        {"type": "drag", "path": [[1, 2], (3, 4)]},
        {"type": "drag", "path": [[2, 4], [6, 8]]},
    ),
    (
        "openai",
        {"type": "keypress", "keys": ["CTRL", "C"]},
        {"type": "keypress", "keys": ["CTRL", "C"]},
    ),
    ("openai", {"type": "screenshot"}, {"type": "screenshot"}),
    (
        "anthropic",
        {"action": "left_click", "coordinate": [10, 20], "text": "shift"},
        {"action": "left_click", "coordinate": [20, 40], "text": "shift"},
    ),
    (
        "anthropic",
        {"action": "left_click_drag", "start_coordinate": [1, 2], "coordinate": (3, 4)},
        {"action": "left_click_drag", "start_coordinate": [2, 4], "coordinate": [6, 8]},
    ),
    (
        "anthropic",
        {"action": "scroll", "coordinate": [1, 2], "scroll_direction": "down", "scroll_amount": 5},
        {"action": "scroll", "coordinate": [2, 4], "scroll_direction": "down", "scroll_amount": 5},
    ),
    (
        "anthropic",
        {"action": "zoom", "region": [1, 2, 3, 4]},
        {"action": "zoom", "region": [2, 4, 6, 8]},
    ),
    ("anthropic", {"action": "key", "text": "ctrl+s"}, {"action": "key", "text": "ctrl+s"}),
]


@pytest.mark.parametrize(("dialect", "action", "expected"), MAPPED)
def test_mapping_changes_coordinates_only_and_never_the_input(dialect, action, expected):
    before = copy.deepcopy(action)
    assert HALF.typed_to_screen(action, dialect) == expected
    assert HALF.inverse().typed_to_observation(action, dialect) == expected
    assert action == before


@pytest.mark.parametrize(("dialect", "action", "expected"), MAPPED)
def test_mapping_and_reading_commute(dialect, action, expected):
    size, screen = ((540, 960), (1080, 1920)) if dialect != "ui_tars" else (SIZE, SIZE)
    actions = parse_actions(action, dialect, size)
    result = [HALF.action_to_screen(a) for a in actions] if dialect != "ui_tars" else actions
    for value, want in zip(parse_actions(expected, dialect, screen), result, strict=True):
        assert (value.type, value.text, value.keys, value.amount) == (
            want.type,
            want.text,
            want.keys,
            want.amount,
        )
        for a, b in zip(
            (value.x, value.y, value.x2, value.y2), (want.x, want.y, want.x2, want.y2), strict=True
        ):
            assert (a is None) == (b is None)
            assert a is None or abs(a - b) <= 1  # a fraction is rounded before or after


@pytest.mark.parametrize(
    ("dialect", "action", "expected"),
    [
        ("computer_13", nested("MOVE_TO", x=1, y=2), Action("move", 1, 2)),
        ("computer_13", nested("CLICK", button="right", x=1, y=2), Action("right_click", 1, 2)),
        ("computer_13", nested("CLICK", num_clicks=2), Action("double_click")),
        ("computer_13", {"action_type": "CLICK", "parameters": None}, Action("click")),
        ("computer_13", nested("RIGHT_CLICK", x=1, y=2), Action("right_click", 1, 2)),
        ("computer_13", nested("DOUBLE_CLICK", x=1, y=2), Action("double_click", 1, 2)),
        ("computer_13", nested("MOUSE_DOWN"), Action("mouse_down")),
        ("computer_13", nested("MOUSE_UP", button="right"), Action("other")),
        ("computer_13", nested("DRAG_TO", x=1, y=2), Action("drag", x2=1, y2=2)),
        ("computer_13", nested("SCROLL", dx=0, dy=-3), Action("scroll", amount=-3)),
        ("computer_13", nested("SCROLL", dx=5), Action("other")),
        ("computer_13", nested("TYPING", text="a\n"), Action("type", text="a\n")),
        ("computer_13", nested("PRESS", key="Return"), Action("hotkey", keys=("enter",))),
        ("computer_13", nested("KEY_DOWN", key="shift"), Action("key_down", keys=("shift",))),
        ("computer_13", nested("KEY_UP", key="shift"), Action("key_up", keys=("shift",))),
        ("computer_13", nested("HOTKEY", keys=["ctrl", "c"]), Action("hotkey", keys=("ctrl", "c"))),
        ("computer_13", {"action_type": "FAIL"}, Action("fail")),
        ("computer_13", "WAIT", Action("wait")),
        ("ui_tars", "Thought: x\nAction: click(start_box='(500,500)')", Action("click", 960, 540)),
        ("ui_tars", "click(start_box='[100, 200, 300, 400]')", Action("click", 384, 324)),
        ("ui_tars", "click(start_box='(1000,1000)')", Action("click", 1919, 1079)),
        (
            "ui_tars_1.5",
            "right_single(start_box='<|box_start|>(10,20)<|box_end|>')",
            Action("right_click", 10, 20),
        ),
        ("ui_tars_1.5", "left_double(start_box='(10, 20)')", Action("double_click", 10, 20)),
        ("ui_tars_1.5", "click(start_box='[10,20,31,40]')", Action("click", 21, 30)),
        ("ui_tars_1.5", "drag(start_box='(1,2)', end_box='(3,4)')", Action("drag", 1, 2, 3, 4)),
        ("ui_tars_1.5", "hotkey(key='ctrl c')", Action("hotkey", keys=("ctrl", "c"))),
        ("ui_tars_1.5", "hotkey(key='arrowleft')", Action("hotkey", keys=("left",))),
        ("ui_tars_1.5", r"type(content='it\'s \"a\"\n')", Action("type", text='it\'s "a"\n')),
        ("ui_tars_1.5", "type(content='it's raw')", Action("type", text="it's raw")),
        ("ui_tars_1.5", r"type(content='C:\\new\d')", Action("type", text="C:\\new\\d")),
        (
            "ui_tars_1.5",
            "scroll(start_box='(1,2)', direction='down')",
            Action("scroll", 1, 2, amount=-5),
        ),
        ("ui_tars_1.5", "scroll(direction='up')", Action("scroll", amount=5)),
        ("ui_tars_1.5", "scroll(start_box='(1,2)', direction='left')", Action("other", 1, 2)),
        ("ui_tars_1.5", "Action: wait()", Action("wait", amount=5.0)),
        ("ui_tars_1.5", "finished(content='all done')", Action("done", text="all done")),
        ("ui_tars", "Thought: no\nAction: finished()", Action("done")),
        ("ui_tars", "call_user()", Action("fail")),
        (
            "openai",
            {"type": "click", "x": 1, "y": 2, "button": "right"},
            Action("right_click", 1, 2),
        ),
        (
            "openai",
            {"type": "click", "x": 1, "y": 2, "button": "wheel"},
            Action("middle_click", 1, 2),
        ),
        ("openai", {"type": "click", "x": 1, "y": 2, "button": "back"}, Action("other", 1, 2)),
        (
            "openai",
            {"type": "double_click", "x": 1, "y": 2, "keys": ["CTRL"]},
            Action("double_click", 1, 2, keys=("ctrl",)),
        ),
        ("openai", {"type": "move", "x": 1, "y": 2}, Action("move", 1, 2)),
        (
            "openai",
            {"type": "scroll", "x": 1, "y": 2, "scroll_x": 0, "scroll_y": 300},
            Action("scroll", 1, 2, amount=-3),
        ),
        (
            "openai",
            {"type": "scroll", "x": 1, "y": 2, "scroll_x": 9, "scroll_y": 0},
            Action("other", 1, 2),
        ),
        ("openai", {"type": "type", "text": "hi"}, Action("type", text="hi")),
        (
            "openai",
            {"type": "keypress", "keys": ["CTRL", "ARROWUP"]},
            Action("hotkey", keys=("ctrl", "up")),
        ),
        ("openai", {"type": "drag", "path": [[1, 2], [9, 9], [3, 4]]}, Action("drag", 1, 2, 3, 4)),
        ("openai", {"type": "wait"}, Action("wait")),
        ("openai", {"type": "screenshot"}, Action("other")),
        ("anthropic", {"action": "left_click", "coordinate": [1, 2]}, Action("click", 1, 2)),
        ("anthropic", {"action": "left_click"}, Action("click")),
        (
            "anthropic",
            {"action": "left_click", "coordinate": [1, 2], "text": "ctrl+shift"},
            Action("click", 1, 2, keys=("ctrl", "shift")),
        ),
        (
            "anthropic",
            {"action": "triple_click", "coordinate": [1, 2]},
            Action("triple_click", 1, 2),
        ),
        ("anthropic", {"action": "mouse_move", "coordinate": [1, 2]}, Action("move", 1, 2)),
        ("anthropic", {"action": "left_mouse_down"}, Action("mouse_down")),
        ("anthropic", {"action": "left_mouse_up"}, Action("mouse_up")),
        (
            "anthropic",
            {"action": "left_click_drag", "start_coordinate": [1, 2], "coordinate": [3, 4]},
            Action("drag", 1, 2, 3, 4),
        ),
        (
            "anthropic",
            {"action": "left_click_drag", "coordinate": [3, 4]},
            Action("drag", x2=3, y2=4),
        ),
        (
            "anthropic",
            {
                "action": "scroll",
                "coordinate": [1, 2],
                "scroll_direction": "up",
                "scroll_amount": 3,
            },
            Action("scroll", 1, 2, amount=3),
        ),
        (
            "anthropic",
            {
                "action": "scroll",
                "coordinate": [1, 2],
                "scroll_direction": "left",
                "scroll_amount": 3,
            },
            Action("other", 1, 2),
        ),
        ("anthropic", {"action": "type", "text": "a+b"}, Action("type", text="a+b")),
        (
            "anthropic",
            {"action": "key", "text": "ctrl+Page_Down"},
            Action("hotkey", keys=("ctrl", "pagedown")),
        ),
        ("anthropic", {"action": "key", "text": "+"}, Action("hotkey", keys=("+",))),
        (
            "anthropic",
            {"action": "hold_key", "text": "shift", "duration": 2},
            Action("hotkey", keys=("shift",), amount=2),
        ),
        ("anthropic", {"action": "wait", "duration": 3}, Action("wait", amount=3)),
        ("anthropic", {"action": "cursor_position"}, Action("other")),
        ("anthropic", {"action": "zoom", "region": [1, 2, 3, 4]}, Action("other")),
    ],
)
def test_reading(dialect, action, expected):
    assert parse_actions(action, dialect, SIZE) == [expected]


def test_a_reply_of_several_actions():
    reply = "Thought: first\nAction: click(start_box='(10,20)')\n\ntype(content='a\\n')\n\nwait()"
    assert [a.type for a in parse_actions(reply, "ui_tars_1.5", SIZE)] == ["click", "type", "wait"]


def test_only_the_last_action_label_counts():
    reply = "Action: wait()\nThought: no\nAction: finished()"
    assert parse_actions(reply, "ui_tars_1.5") == [Action("done")]


@pytest.mark.parametrize(
    ("dialect", "action", "reason"),
    [
        ("computer_13", {"action_type": "click"}, "did you mean 'CLICK'"),
        ("computer_13", {"action_type": "DRAG"}, "did you mean 'DRAG_TO'"),
        ("computer_13", {}, "no action None"),
        ("computer_13", nested("MOVE_TO"), "needs both x and y"),
        ("computer_13", nested("CLICK", x=1), "needs both x and y"),
        ("computer_13", nested("CLICK", x="1", y=2), "must be a number"),
        ("computer_13", nested("CLICK", x=float("nan"), y=2), "finite"),
        ("computer_13", nested("CLICK", x=10**400, y=2), "finite"),
        ("computer_13", nested("CLICK", x=True, y=2), "must be a number"),
        ("ui_tars", "Thought: hm", "no action at character 0"),
        ("ui_tars", "clik(start_box='(1,2)')", "did you mean 'click'"),
        ("ui_tars", "click()", "needs start_box"),
        ("ui_tars", "click(start_box='')", "must be"),
        ("ui_tars", "click(start_box='(1,2,3)')", "must be"),
        ("ui_tars", "click(start_box='(1,2]')", "must be"),
        ("ui_tars", "click(start_box='(a,b)')", "must be"),
        ("ui_tars", "click((1,2))", "cannot read"),
        ("ui_tars", "click(start_box='(1500,20)')", "pixels already"),
        ("ui_tars", "drag(start_box='(1,2)')", "needs end_box"),
        ("ui_tars_1.5", "click(start_box='(" + "9" * 5000 + ",2)')", "finite"),
        ("openai", {"type": "clik", "x": 1, "y": 2}, "did you mean 'click'"),
        ("openai", {"type": "click", "x": 1}, "click y must be a number"),
        ("openai", {"type": "drag", "path": []}, "list of points"),
        ("openai", {"type": "drag", "path": [[1]]}, r"path\[0\]"),
        ("openai", {"type": "drag", "path": [{"x": 1}]}, r"path\[0\] y"),
        ("anthropic", {"action": "left_clik"}, "did you mean 'left_click'"),
        ("anthropic", {"action": ["left_click"]}, "no action"),
        ("anthropic", {"action": "mouse_move"}, "coordinate must be"),
        ("anthropic", {"action": "left_click", "coordinate": [1, "2"]}, "number"),
        ("anthropic", {"action": "left_click", "coordinate": "1,2,3"}, "must be"),
        ("anthropic", {"action": "zoom"}, "region must be"),
        ("anthropic", {"action": "zoom", "region": [9, 9, 1, 1]}, "region"),
    ],
)
def test_what_is_malformed_is_refused_by_mapping_and_by_reading(dialect, action, reason):
    with pytest.raises(ActionError, match=reason):
        HALF.typed_to_screen(action, dialect)
    if not (isinstance(action, dict) and action.get("action") == "zoom"):
        with pytest.raises(ActionError, match=reason):
            parse_actions(action, dialect, SIZE)


@pytest.mark.parametrize(
    ("dialect", "action", "reason"),
    [
        ("computer_13", nested("PRESS"), "must name keys"),
        ("computer_13", nested("HOTKEY", keys=[]), "names no key"),
        ("computer_13", nested("HOTKEY", keys=["up", "up"]), "HOTKEY keys names 'up' more than"),
        ("ui_tars_1.5", "hotkey(key='up up')", "'up' more than once, .* an action for each press"),
        ("openai", {"type": "keypress", "keys": ["CTRL", "c", "C"]}, "names 'c' more than once"),
        ("anthropic", {"action": "key", "text": "ctrl c ctrl v"}, "names 'ctrl' more than once"),
        ("computer_13", nested("HOTKEY", keys=["ctrl", 3]), "must be a string"),
        ("computer_13", nested("TYPING", text=3), "must be a string"),
        ("computer_13", nested("SCROLL", dy="3"), "must be a number"),
        ("ui_tars", "hotkey(key='')", "names no key"),
        ("ui_tars", "scroll(start_box='(1,2)', direction='sideways')", "direction"),
        ("ui_tars", "type(hello)", "quoted text"),
        ("openai", {"type": "keypress"}, "must name keys"),
        ("openai", {"type": "type"}, "must be a string"),
        ("anthropic", {"action": "scroll", "scroll_amount": 3}, "scroll_direction"),
        ("anthropic", {"action": "scroll", "scroll_direction": "up"}, "scroll_amount"),
        ("anthropic", {"action": "wait", "duration": "3"}, "number"),
    ],
)
def test_what_says_no_action_cannot_be_read(dialect, action, reason):
    with pytest.raises(ActionError, match=reason):
        parse_actions(action, dialect, SIZE)


@pytest.mark.parametrize("dialect", [d for d in DIALECTS if d != "pyautogui"])
def test_the_wrong_kind_of_action_is_a_type_error(dialect):
    for action in (None, 3, [], b"click"):
        with pytest.raises(ParameterTypeError):
            HALF.typed_to_screen(action, dialect)
        with pytest.raises(ParameterTypeError):
            parse_actions(action, dialect, SIZE)


def test_dialects_and_sizes_are_checked():
    with pytest.raises(UnknownNameError, match="did you mean 'computer_13'"):
        parse_actions({}, "computer13")
    with pytest.raises(ParameterError, match="size"):
        parse_actions("click(start_box='(1,2)')", "ui_tars")
    assert parse_actions({"type": "move", "x": 5000, "y": 1}, "openai") == [Action("move", 5000, 1)]


def test_numpy_numbers_are_numbers_and_results_are_plain_json():
    action = {"type": "move", "x": np.int32(5), "y": np.float32(6.5)}
    assert (
        json.dumps(HALF.typed_to_screen(action, "openai")) == '{"type": "move", "x": 10, "y": 13}'
    )


def test_model_space_of_ui_tars_goes_to_the_screen():
    model = CoordMap.model((1080, 1920))
    assert (
        model.typed_to_screen("click(start_box='(966,546)')", "ui_tars_1.5")
        == "click(start_box='(960,540)')"
    )


@given(st.integers(0, 959), st.integers(0, 539))
def test_every_dialect_lands_on_the_same_pixel(x, y):
    want = HALF.to_screen((x, y))
    assert (
        parse_actions(
            HALF.typed_to_screen(nested("CLICK", x=x, y=y), "computer_13"), "computer_13"
        )[0].point
        == want
    )
    assert (
        parse_actions(HALF.code_to_screen(f"pyautogui.click({x}, {y})"), "pyautogui")[0].point
        == want
    )
    text = HALF.typed_to_screen(f"click(start_box='({x},{y})')", "ui_tars_1.5")
    assert parse_actions(text, "ui_tars_1.5")[0].point == want
    tool = HALF.typed_to_screen({"action": "left_click", "coordinate": [x, y]}, "anthropic")
    assert parse_actions(tool, "anthropic")[0].point == want


@given(st.text())
def test_typed_text_is_read_back(text):
    escaped = text.replace("\\", "\\\\").replace("'", "\\'").replace("\n", "\\n")
    reply = f"Action: type(content='{escaped}')"
    if "Action:" not in text:
        assert parse_actions(reply, "ui_tars_1.5")[0] == Action("type", text=text)
        assert HALF.typed_to_screen(reply, "ui_tars_1.5") == reply


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3)
    ),
    max_leaves=5,
)
FIELDS = st.sampled_from(
    [
        "action_type",
        "parameters",
        "type",
        "action",
        "x",
        "y",
        "path",
        "coordinate",
        "start_coordinate",
        "region",
        "keys",
        "key",
        "text",
        "scroll_y",
        "scroll_amount",
        "scroll_direction",
        "duration",
        "button",
        "dx",
        "dy",
        "num_clicks",
    ]
)
WORDS = st.sampled_from(
    [
        "CLICK",
        "SCROLL",
        "HOTKEY",
        "PRESS",
        "click",
        "drag",
        "scroll",
        "keypress",
        "left_click",
        "zoom",
        "key",
        "wait",
        "left_click_drag",
        "hold_key",
        "DRAG_TO",
        "MOUSE_UP",
        "up",
        "move",
    ]
)
PIECES = [
    "click(",
    "start_box=",
    "'",
    '"',
    "(1,2)",
    ")",
    "\n\n",
    "type(content=",
    "Action:",
    "<|box_start|>",
    "\\",
    " ",
]


@settings(max_examples=200, deadline=None)
@given(
    st.dictionaries(FIELDS, JSON | WORDS, max_size=6) | JSON,
    st.lists(st.sampled_from(PIECES)).map("".join) | st.text(),
)
def test_garbage_is_refused_or_read(data, text):
    for dialect in DIALECTS[1:]:
        action = text if dialect.startswith("ui_tars") else data
        before = copy.deepcopy(action)
        with contextlib.suppress(ActionError, ParameterTypeError):
            HALF.typed_to_screen(action, dialect)
        with contextlib.suppress(ActionError, ParameterTypeError):
            assert all(a.type in ACTION_TYPES for a in parse_actions(action, dialect, SIZE))
        assert repr(action) == repr(before)


def test_hostile_values_are_named_and_not_printed_in_full():
    loop = []
    loop.append(loop)
    deep = []
    for _ in range(100_000):
        deep = [deep]
    for value in (loop, deep, "9" * 10**6, 10**5000):
        with pytest.raises(HijackError) as error:
            HALF.typed_to_screen({"type": "move", "x": value, "y": 1}, "openai")
        assert len(str(error.value)) < 300
    while deep:  # freed level by level: the interpreter's own clean-up recurses
        deep = deep[0]
