"""What a person's hands do, event by event, comes out as one action each, with the screen before
it."""

import itertools

import pytest

from hijack_data.actions import parse_pyautogui
from hijack_data.types import Action
from online_env.recording.action_recognizer import ActionRecognizer


class Clock:
    """A clock that stands still until it is told to go on."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


def recognize(*events):
    """The actions, each with the number of the look before it; a number among the events lets time
    pass."""
    clock, looks, items = Clock(), itertools.count(), []

    def done(view, code):
        items.append((view, code))

    actions = ActionRecognizer(lambda: next(looks), done, clock)
    for event in events:
        if isinstance(event, dict):
            actions.event(event)
        else:
            clock.now += event
    actions.flush()
    assert [view for view, _ in items] == list(range(len(items)))
    return [parse_pyautogui(code, (1080, 1920)) for _, code in items]


def press(x, y, button="left"):
    return [
        {"type": "down", "x": x, "y": y, "button": button},
        {"type": "up", "x": x, "y": y, "button": button},
    ]


def typed(text):
    return [{"type": "type", "text": letter} for letter in text]


def key(name):
    return [{"type": "key_down", "key": name}, {"type": "key_up", "key": name}]


def test_a_click_for_each_button():
    for button, kind in (("left", "click"), ("right", "right_click"), ("middle", "middle_click")):
        assert recognize(*press(30, 40, button)) == [Action(kind, 30, 40)]


def test_two_clicks_are_one_double_click_only_if_they_are_quick_and_in_one_place():
    assert recognize(*press(30, 40), 0.2, *press(31, 40)) == [Action("double_click", 30, 40)]
    assert recognize(*press(30, 40), 0.2, *press(30, 40), 0.2, *press(30, 40)) == [
        Action("triple_click", 30, 40)
    ]
    assert recognize(*press(30, 40), 0.9, *press(30, 40)) == [Action("click", 30, 40)] * 2
    assert recognize(*press(30, 40), 0.2, *press(60, 40)) == [
        Action("click", 30, 40),
        Action("click", 60, 40),
    ]
    assert [a.type for a in recognize(*press(30, 40), 0.2, *press(30, 40, "right"))] == [
        "click",
        "right_click",
    ]


def test_a_trembling_hand_clicks_and_one_that_goes_away_drags():
    down, up = press(30, 40)
    assert recognize(down, {"type": "move", "x": 33, "y": 41}, {**up, "x": 33, "y": 41}) == [
        Action("click", 30, 40)
    ]
    assert recognize(down, {"type": "move", "x": 90, "y": 41}, {**up, "x": 90, "y": 41}) == [
        Action("drag", 30, 40, 90, 41)
    ]


def test_letters_are_one_text_until_there_is_a_pause_or_a_click():
    assert recognize(*typed("Größe 5")) == [Action("type", text="Größe 5")]
    assert recognize(*typed("ab"), 3.0, *typed("c")) == [
        Action("type", text="ab"),
        Action("type", text="c"),
    ]
    assert [a.type for a in recognize(*typed("ab"), *press(5, 5), *typed("c"))] == [
        "type",
        "click",
        "type",
    ]
    assert recognize({"type": "key_down", "key": "shift"}, *typed("A"), *key("shift")) == [
        Action("type", text="A")
    ]


def test_keys_with_and_without_modifiers():
    assert recognize(*key("enter")) == [Action("hotkey", keys=("enter",))]
    items = [
        {"type": "key_down", "key": "ctrl"},
        {"type": "key", "key": "s"},
        {"type": "key_up", "key": "ctrl"},
    ]
    assert recognize(*items) == [Action("hotkey", keys=("ctrl", "s"))]
    assert recognize(*key("ctrl")) == []
    assert recognize(*key("win")) == [Action("hotkey", keys=("win",))]


def test_a_click_with_a_key_held():
    events = [{"type": "key_down", "key": "ctrl"}, *press(7, 8), {"type": "key_up", "key": "ctrl"}]
    assert recognize(*events) == [Action("click", 7, 8, keys=("ctrl",))]


@pytest.mark.parametrize(("amounts", "wanted"), [((-1, -1, -1), [-3]), ((-1, 1), [-1, 1])])
def test_turns_of_the_wheel_in_one_direction_are_one_scroll(amounts, wanted):
    result = recognize(
        *({"type": "scroll", "x": 9, "y": 9, "amount": amount} for amount in amounts)
    )
    assert [action.amount for action in result] == wanted
    assert {action.point for action in result} == {(9, 9)}


def test_moves_and_unknown_events_are_no_actions():
    assert recognize({"type": "move", "x": 1, "y": 1}, {"type": "dance"}, {}) == []
