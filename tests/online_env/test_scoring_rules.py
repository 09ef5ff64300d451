"""The rules of offline scoring, part by part, and how an answer is read."""

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

from hijack_data.errors import ParameterError
from hijack_data.types import Action
from online_env.scoring.answers import read_answer
from online_env.scoring.onlookers import is_reminder, overlap
from online_env.scoring.outlines import target_outline
from online_env.scoring.rules import (
    HELP,
    Distance,
    ExpectedStep,
    compare,
    inside,
    same_keys,
    same_text,
    unanswered,
)

SIZE = (1000, 2000)


def expected_step(action, **more):
    return ExpectedStep(action=action, size=SIZE, **more)


def parts(verdict):
    return {name for name, right in verdict.parts.items() if right}


CLICK = Action("click", 100, 200)


@pytest.mark.parametrize(
    ("got", "right"),
    [
        (Action("click", 90, 190), True),
        (Action("click", 119, 209), True),
        (Action("click", 120, 209), False),  # boxes are half-open
        (Action("click", 119, 210), False),
        (Action("click", 89, 200), False),
        (Action("click"), False),
        (Action("double_click", 100, 200), False),
        (Action("click", 100, 200, keys=("ctrl",)), False),
        (Action("fail"), False),
    ],
)
def test_a_click_is_right_inside_the_box(got, right):
    verdict = compare(expected_step(CLICK, box=(90, 190, 120, 210)), got)
    assert verdict.right is right
    assert bool(verdict.reason) is not right


def test_a_wrong_type_leaves_no_part_right():
    verdict = compare(
        expected_step(CLICK, box=(90, 190, 120, 210)), Action("right_click", 100, 200)
    )
    assert verdict.parts == {"type": False, "place": False}
    assert verdict.reason == "right_click in the place of click"


@pytest.mark.parametrize(("x", "right"), [(132, True), (133, False)])
def test_without_a_box_the_distance_counts(x, right):
    assert compare(expected_step(CLICK), Action("click", x, 200)).right is right


def test_the_distance_counts_in_pixels_of_the_recorded_screen():
    half = expected_step(CLICK, scale=(0.5, 0.5))
    assert compare(half, Action("click", 116, 200)).right
    assert not compare(half, Action("click", 117, 200)).right


def test_a_share_counts_widths_and_heights_as_aitw_does():
    near = Distance.parse("14%")
    assert compare(expected_step(CLICK), Action("click", 100 + 280, 200), near).right
    assert not compare(expected_step(CLICK), Action("click", 100 + 281, 200), near).right
    assert not compare(expected_step(CLICK), Action("click", 100, 200 + 141), near).right


@pytest.mark.parametrize("text", ["", "0", "-1", "nan", "inf", "101%", "0%", "far", "20000"])
def test_a_distance_that_is_none(text):
    with pytest.raises(ParameterError, match="must be pixels such as 32"):
        Distance.parse(text)


@pytest.mark.parametrize("text", ["32", "7.5", "14%"])
def test_a_distance_is_written_as_it_is_read(text):
    assert str(Distance.parse(text)) == text


@pytest.mark.parametrize(
    "action",
    [
        Action("type", text="hello"),
        Action("hotkey", keys=("ctrl", "s")),
        Action("wait", amount=1),
        Action("done"),
    ],
)
def test_what_goes_where_the_focus_is_has_no_place_in_its_box(action):
    """A text field may stand beside the text: typing has no point that could be inside."""
    verdict = compare(expected_step(action, box=(90, 190, 120, 210)), action)
    assert verdict.right
    assert "place" not in verdict.parts


def test_a_click_without_a_point_counts_in_its_box():
    here = expected_step(Action("click"), box=(90, 190, 120, 210))
    assert compare(here, CLICK).right
    assert not compare(here, Action("click", 10, 10)).right


def test_an_outline_wins_over_the_box():
    corner = expected_step(CLICK, box=(0, 0, 200, 200), polygon=((0, 0), (200, 0), (0, 200)))
    assert compare(corner, Action("click", 10, 10)).right
    assert not compare(corner, Action("click", 190, 190)).right


def test_the_outline_of_a_box_has_the_pixels_of_the_box():
    square = ((3, 4), (8, 4), (8, 9), (3, 9))
    names = {(x, y) for x in range(12) for y in range(12) if inside(square, (x, y))}
    assert names == {(x, y) for x in range(3, 8) for y in range(4, 9)}


def test_an_outline_scales_with_the_picture():
    extra = '{"target_polygon": [[0, 0], [100, 0], [0, 100]]}'
    assert target_outline(extra, (0.5, 0.25)) == ((0, 0), (50, 0), (0, 25))
    assert target_outline('{"thought": "target_polygon"}', (1, 1)) == ()
    assert target_outline(None, (1, 1)) == ()
    with pytest.raises(ParameterError, match="three points"):
        target_outline('{"target_polygon": [[0, 0], [100, "0"]]}', (1, 1))


def test_both_ends_of_a_drag_count():
    drag = expected_step(Action("drag", 100, 100, 400, 100), box=(90, 90, 110, 110))
    assert compare(drag, Action("drag", 101, 101, 405, 100)).right
    assert parts(compare(drag, Action("drag", 101, 101, 500, 100))) == {"type", "place"}
    assert parts(compare(drag, Action("drag", x2=400, y2=100))) == {"type", "end"}


def test_of_a_scroll_the_direction_counts():
    down = expected_step(Action("scroll", 100, 100, amount=-5.0))
    assert compare(down, Action("scroll", 900, 900, amount=-1.0)).right
    assert not compare(down, Action("scroll", 100, 100, amount=5.0)).right
    assert not compare(down, Action("scroll", 100, 100)).right


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("hello", " hello\n", True),
        ("a  b", "a b", True),
        ("caf\u00e9", "cafe\u0301", True),
        ("Hello", "hello", False),
        ("a b", "ab", False),
        ("", "", True),
    ],
)
def test_texts(one, other, same):
    assert same_text(one, other) is same
    typed = compare(expected_step(Action("type", text=one)), Action("type", text=other))
    assert typed.right is same


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        (("ctrl", "shift", "s"), ("shift", "control", "S"), True),
        (("ctrlleft", "c"), ("ctrl", "c"), True),
        (("return",), ("enter",), True),
        (("cmd", "c"), ("ctrl", "c"), False),
        (("ctrl", "a", "c"), ("ctrl", "c", "a"), False),
        (("left",), ("right",), False),
        ((), ("ctrl",), False),
    ],
)
def test_keys(one, other, same):
    assert same_keys(one, other) is same


def test_help_is_right_only_where_nothing_else_helps():
    locked = expected_step(Action("wait"), helpless=True)
    assert compare(locked, Action("wait")).right
    assert compare(locked, Action(HELP)).right
    assert not compare(locked, Action("fail")).right
    assert not compare(expected_step(Action("wait")), Action(HELP)).right


def test_an_answer_without_an_action_has_no_part_right():
    verdict = unanswered(expected_step(CLICK), "no action")
    assert verdict.parts == {"type": False, "place": False}
    assert not verdict.right


@pytest.mark.parametrize(
    ("text", "action"),
    [
        ("pyautogui.click(10, 20)", Action("click", 10, 20)),
        ("```python\npyautogui.click(10, 20)\n```", Action("click", 10, 20)),
        ("pyautogui.click(5000, -7)", Action("click", 1999, 0)),
        ("WAIT", Action("wait")),
        ("DONE", Action("done")),
        ("REQUEST_REINIT", Action("reinit")),
        ("pyautogui.click(1, 2); pyautogui.click(2, 2)", Action("other", 1, 2)),
    ],
)
def test_the_first_action_is_read(text, action):
    answer = read_answer("words", [text, "DONE"], SIZE)
    assert answer.action == action
    assert answer.further_actions == 1


@pytest.mark.parametrize(
    "actions",
    [
        [],
        [""],
        ["for i in range(2): pyautogui.click(i, 2)"],
        ["click the button"],
        ["import os; os.system('ls')"],
        ["pyautogui.click(0.5, 0.3)"],
        ["pyautogui.click(float('nan'), 3)"],
        ["pyautogui.click('button.png')"],
        [None],
        [{"type": "click"}],
        ["\ud800"],
        ["x" * 100_000],
        ["(" * 5000],
    ],
)
def test_what_is_no_action(actions):
    answer = read_answer("words", actions, SIZE)
    assert answer.action is None
    assert answer.problem.startswith("no action")


@pytest.mark.parametrize("text", [None, "", " None. ", "Reminder: None", "reminder: ", "'none'"])
def test_no_reminder(text):
    assert not is_reminder(text)


@pytest.mark.parametrize("text", ["Reminder: wait", "The screen is locked.", "None of it works"])
def test_a_reminder(text):
    assert is_reminder(text)


def test_the_overlap_of_words():
    assert overlap("The agent clicked.", "agent CLICKED") == 1
    assert overlap("agent clicked", "nothing happened") == 0
    assert overlap("", "") == 1
    assert overlap("agent clicked twice", "agent clicked") == pytest.approx(0.8)
