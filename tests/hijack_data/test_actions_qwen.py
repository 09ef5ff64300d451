"""Tool calls in text: Qwen2.5-VL counts in the smart-resized picture, Qwen3-VL in thousandths."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hijack_data.actions import map_typed, parse_actions
from hijack_data.actions.dialects.qwen import tool_call_text
from hijack_data.actions.recorded_actions import map_recorded
from hijack_data.actions.scaling import Scaling
from hijack_data.coords import CoordMap, smart_resize
from hijack_data.errors import ActionError, ParameterError
from hijack_data.labels.dataset_rows import detect_dialect
from hijack_data.types import Action

SIZE = (1080, 1920)
HALF = CoordMap((540, 960), SIZE)


def call(action, tool="computer_use", **given):
    return tool_call_text(tool, {"action": action, **given})


@pytest.mark.parametrize(
    ("reply", "expected"),
    [
        (call("left_click", coordinate=[500, 250]), Action("click", 960, 270)),
        (call("right_click", coordinate=[0, 0]), Action("right_click", 0, 0)),
        (call("double_click", coordinate=[1000, 1000]), Action("double_click", 1919, 1079)),
        (call("mouse_move", coordinate=[500, 500]), Action("move", 960, 540)),
        (call("left_click_drag", coordinate=[500, 500]), Action("drag", x2=960, y2=540)),
        (
            call("left_click_drag", start_coordinate=[0, 0], coordinate=[500, 500]),
            Action("drag", 0, 0, 960, 540),
        ),
        (call("scroll", coordinate=[500, 500], pixels=-300), Action("scroll", 960, 540, amount=-3)),
        (call("hscroll", pixels=5), Action("other")),
        (call("type", text="a\n"), Action("type", text="a\n")),
        (call("key", keys=["ctrl", "c"]), Action("hotkey", keys=("ctrl", "c"))),
        (call("wait", time=2), Action("wait", amount=2)),
        (call("terminate", status="success"), Action("done")),
        (call("terminate", status="failure"), Action("fail")),
        (call("answer", text="42"), Action("done", text="42")),
        (call("click", "mobile_use", coordinate=[500, 500]), Action("click", 960, 540)),
        (
            call("swipe", "mobile_use", coordinate=[500, 500], coordinate2=[500, 0]),
            Action("drag", 960, 540, 960, 0),
        ),
        (
            call("long_press", "mobile_use", coordinate=[500, 500], time=2),
            Action("other", 960, 540),
        ),
        (call("system_button", "mobile_use", button="Back"), Action("other")),
        (call("open", "mobile_use", text="Clock"), Action("other")),
    ],
)
def test_actions_in_thousandths(reply, expected):
    assert parse_actions(f"I do it.\n{reply}", "qwen3_vl", SIZE) == [expected]


@pytest.mark.parametrize(
    ("reply", "reason"),
    [
        ("click it", "no whole tool call"),
        ("<tool_call>{", "no whole tool call"),
        ("<tool_call>{'a': 1}</tool_call>", "not JSON"),
        (call("left_clik", coordinate=[1, 1]), "did you mean 'left_click'"),
        (call("left_click", tool="bash"), "computer_use"),
        (call("left_click", coordinate=[1]), r"\[x, y\]"),
        (call("left_click", coordinate=[1, 1], bbox=[1, 2, 3, 4]), "bbox"),
        (call("mouse_move"), "needs coordinate"),
        (call("swipe", "mobile_use", coordinate=[1, 1]), "coordinate2"),
        (call("left_click", coordinate=[1200, 5]), "1200"),
        (call("left_click", coordinate=[0.5, 0.5]), "fractions"),
        (call("scroll", pixels="far"), "number"),
    ],
)
def test_what_cannot_be_read(reply, reason):
    with pytest.raises(ActionError, match=reason):
        parse_actions(reply, "qwen3_vl", SIZE)


def test_thousandths_need_a_size_and_stay_as_they_are():
    reply = call("left_click", coordinate=[500, 250])
    with pytest.raises(ParameterError, match="qwen3_vl"):
        parse_actions(reply, "qwen3_vl")
    assert map_typed(reply, "qwen3_vl", Scaling(SIZE, (540, 960))) == reply


@given(st.integers(0, 1931), st.integers(0, 1091), st.integers(0, 1931))
def test_pixels_of_the_resized_picture_follow_it(x, y, x2):
    calls, after = smart_resize(*SIZE), smart_resize(540, 960)
    first = call("left_click_drag", start_coordinate=[x, y], coordinate=[x2, y])
    reply = f"é {first} and {call('wait', time=1)}"
    mapped = map_recorded(reply, "qwen2.5_vl", Scaling(SIZE, (540, 960)), Scaling(calls, after))
    drag, wait = parse_actions(mapped, "qwen2.5_vl", after)
    want = CoordMap(after, calls).to_observation((x, y))
    assert (drag.point, wait) == (want, Action("wait", amount=1))
    assert mapped.startswith("é <tool_call>")
    assert json.loads(mapped.split("<tool_call>")[1].split("</tool_call>")[0])


def test_rows_tell_the_version_by_what_the_action_says():
    reply = call("left_click", coordinate=[483, 273])
    assert detect_dialect(reply, Action("click", 480, 270), SIZE) == "qwen2.5_vl"
    assert detect_dialect(reply, Action("click", 927, 295), SIZE) == "qwen3_vl"
