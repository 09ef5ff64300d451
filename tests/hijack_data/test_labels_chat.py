"""Conversations and grounding text: the addressed parts follow the pixels, nothing else changes."""

import copy
import json
import pickle
import re

import numpy as np
import pytest

import hijack_data as hj
import hijack_data.transforms as tr
from hijack_data.errors import LabelError, ParameterError, UnknownNameError
from hijack_data.labels import Labels, chat

SIZE = (1000, 2000)
HALF = hj.Resolution(scale=0.5).plan(hj.Scene(SIZE), seed=1)
# The smart-resized pictures are 1988 x 1008 and 1008 x 504.
ARGUMENTS = '{"action": "left_click", "coordinate": [%d, %d]}'
CALL = f'<tool_call>\n{{"name": "computer_use", "arguments": {ARGUMENTS}}}\n</tool_call>'
BEFORE, AFTER = CALL % (994, 504), CALL % (504, 252)


def follow(labels, **sample):
    return Labels(labels).follow(HALF, sample)


def halve_words(text, move):
    """A format that nobody foresaw: `at 100 200`."""
    x, y = (int(word) for word in text.split()[1:])
    return f"at {move.scaling.x(x)} {move.scaling.y(y)}"


def talk(answer, **more):
    return [
        {"role": "system", "content": "You are an agent."},
        {"role": "user", "content": [{"type": "image"}, {"type": "text", "text": "Press OK."}]},
        {"role": "assistant", "content": answer, **more},
    ]


@pytest.mark.parametrize(
    ("declared", "before", "after"),
    [
        (chat("qwen2.5_vl"), talk(BEFORE), talk(AFTER)),
        (chat("qwen2.5_vl"), tuple(talk(BEFORE)), tuple(talk(AFTER))),
        (
            chat("qwen2.5_vl"),
            [{"from": "human", "value": "<image>\nPress OK."}, {"from": "gpt", "value": BEFORE}],
            [{"from": "human", "value": "<image>\nPress OK."}, {"from": "gpt", "value": AFTER}],
        ),
        (
            chat("qwen2.5_vl"),
            talk([{"type": "text", "text": BEFORE}, "Then I wait."]),
            talk([{"type": "text", "text": AFTER}, "Then I wait."]),
        ),
        (
            chat("qwen2.5_vl"),
            talk(
                None,
                tool_calls=[
                    {
                        "id": "a",
                        "type": "function",
                        "function": {"name": "computer_use", "arguments": ARGUMENTS % (994, 504)},
                    }
                ],
            ),
            talk(
                None,
                tool_calls=[
                    {
                        "id": "a",
                        "type": "function",
                        "function": {"name": "computer_use", "arguments": ARGUMENTS % (504, 252)},
                    }
                ],
            ),
        ),
        (
            chat("anthropic"),
            talk(
                [
                    {"type": "text", "text": "Now."},
                    {
                        "type": "tool_use",
                        "id": "t",
                        "name": "computer",
                        "input": {"action": "left_click", "coordinate": [994, 504]},
                    },
                ]
            ),
            talk(
                [
                    {"type": "text", "text": "Now."},
                    {
                        "type": "tool_use",
                        "id": "t",
                        "name": "computer",
                        "input": {"action": "left_click", "coordinate": [497, 252]},
                    },
                ]
            ),
        ),
        (chat(halve_words), talk("at 100 200"), talk("at 50 100")),
        (
            chat("ui_tars_1.5"),
            [*talk("Action: click(point='<point>994 504</point>')"), *talk("It is open.")],
            [*talk("Action: click(point='<point>504 252</point>')"), *talk("It is open.")],
        ),
        (
            chat("pyautogui", indices=[-1]),
            talk("pyautogui.click(100, 200)"),
            talk("pyautogui.click(50, 100)"),
        ),
        (
            chat("pyautogui", indices=[-1], others="leave"),
            [*talk("pyautogui.click(8, 9)"), *talk("pyautogui.click(100, 200)")],
            [*talk("pyautogui.click(8, 9)"), *talk("pyautogui.click(50, 100)")],
        ),
        (
            chat("grounding", others="<box>"),
            [
                {"role": "user", "content": "What is at <box>100 200 300 400</box>?"},
                {"role": "assistant", "content": "<box>[[100,200,300,400]]</box>"},
            ],
            [
                {"role": "user", "content": "What is at <box>50 100 150 200</box>?"},
                {"role": "assistant", "content": "<box>[[50,100,150,200]]</box>"},
            ],
        ),
        (chat("qwen2.5_vl"), json.dumps(talk(BEFORE)), json.dumps(talk(AFTER))),
        (chat("qwen2.5_vl"), [talk(BEFORE), talk(BEFORE)], [talk(AFTER), talk(AFTER)]),
        (chat("qwen3_vl"), talk(CALL % (500, 250)), talk(CALL % (500, 250))),
    ],
)
def test_the_addressed_messages_follow_and_all_others_stay(declared, before, after):
    options = copy.deepcopy(before)
    assert follow({"messages": declared}, messages=before)["messages"] == after
    assert before == options


@pytest.mark.parametrize(
    ("declared", "messages", "reason"),
    [
        (
            chat("pyautogui"),
            [{"role": "user", "content": "Press (100, 200)."}],
            r"message 0 \(user\), 'content': .*others='leave'",
        ),
        (chat("pyautogui"), [{"role": "user", "content": "1920x1080"}], "size of the screen"),
        (chat("pyautogui"), talk("I press (100, 200)."), r"message 2 \(assistant\)"),
        (chat("qwen2.5_vl"), talk(BEFORE[:-21]), "message 2"),
        (chat("qwen2.5_vl"), talk(CALL % (5000, 5)), "outside the picture"),
        (chat("qwen2.5_vl", roles="user"), talk(BEFORE), r"\(assistant\)"),
        (chat("pyautogui", indices=[7]), talk("pyautogui.click(1, 2)"), "7"),
        (chat("pyautogui"), [{"text": "hi"}], "neither a role"),
        (chat("pyautogui"), ["hi"], "must be a dictionary"),
        (chat("pyautogui"), {"role": ["user"], "content": ["a"]}, "list of messages"),
        (chat("pyautogui"), talk("WAIT", bbox=[1, 2, 3, 4]), "'bbox'"),
        (chat("pyautogui"), talk(7), "text or a list of parts"),
    ],
)
def test_what_could_hold_a_point_and_is_not_addressed_is_an_error(declared, messages, reason):
    with pytest.raises(LabelError, match=reason):
        follow({"messages": declared}, messages=messages)


def test_a_declaration_can_be_pickled_and_a_lambda_is_refused():
    labels = Labels({"messages?": chat(halve_words, others="leave"), "text": halve_words})
    again = pickle.loads(pickle.dumps(labels))
    assert repr(again) == repr(labels)
    assert pickle.dumps(again) == pickle.dumps(labels)
    assert again.follow(HALF, {"text": "at 8 6"}) == {"text": "at 4 3"}
    for form in (lambda text, move: text, "qwen4"):
        with pytest.raises((ParameterError, UnknownNameError), match=r"top level|unknown format"):
            chat(form)
    with pytest.raises(ParameterError, match="top level"):
        Labels({"text": lambda text, move: text})


def test_a_transform_maps_a_conversation_and_keeps_its_target_in_sight():
    sample = {"image": np.zeros((1000, 2000, 3), np.uint8), "id": "a", "messages": talk(BEFORE)}
    labels = {"messages": chat("qwen2.5_vl")}
    half = tr.Resolution(scale=0.5, seed=1, labels=labels)(sample)
    assert half["messages"] == talk(AFTER)
    target = Labels(labels).find_target(sample, SIZE)
    assert [round(n) for n in target.target] == [1000, 500]


@pytest.mark.parametrize(
    ("form", "before", "after"),
    [
        ("bbox_2d", '[{"bbox_2d": [100, 200, 300, 401], "label": "OK 3 x 4"}]', None),
        ("point_2d", '```json\n{"point_2d": [101, 51],\n "label": "a"}\n```', None),
        ("<box>", "<ref>OK</ref><box>(100,200),(300,400)</box>", None),
        ("<box>", "OK: <|box_start|>(100,200),(300,400)<|box_end|>", None),
        ("<bbox>", "<bbox>100 200 300 400</bbox> and <bbox>8 8 10 10</bbox>", None),
        ("<point>", "<point>101 51</point>", None),
        ("<point>", "<point>[[101, 51]]</point>", None),
        ("grounding", "<point>101.5 51.0</point>", "<point>50.75 25.5</point>"),
        (
            "bbox_2d_resized",
            '{"bbox_2d": [994, 504, 1200, 600]}',
            '{"bbox_2d": [504, 252, 609, 300]}',
        ),
        ("<point>_resized", "<point>994 504</point>", "<point>504 252</point>"),
    ],
)
def test_grounding_text_changes_in_its_numbers_only(form, before, after):
    halved = {"100": "50", "200": "100", "300": "150", "401": "201", "400": "200", "101": "50"}
    halved |= {"51": "25", "8": "4", "10": "5"}
    if after is None:
        quoted = before.replace('"OK 3 x 4"', '"?"')
        after = "".join(halved.get(word, word) for word in re.split(r"(\d+)", quoted)).replace(
            '"?"', '"OK 3 x 4"'
        )
    assert follow({"answer": form}, answer=before)["answer"] == after


@pytest.mark.parametrize(
    ("form", "text"),
    [
        ("bbox_2d1000", '{"bbox_2d": [100, 200, 300, 400]}'),
        ("<point>01", "<point>0.5 0.25</point>"),
        ("<loc>", "<loc0123><loc0456><loc0700><loc1000> OK"),
    ],
)
def test_fractions_in_grounding_text_stay(form, text):
    assert follow({"answer": form}, answer=text)["answer"] == text


@pytest.mark.parametrize(
    ("form", "text", "reason"),
    [
        ("bbox_2d", '{"bbox_2d": [100, 200, 300]}', "4 numbers"),
        ("bbox_2d", '{"bbox_2d": [300, 200, 100, 400]}', "wrong order"),
        ("bbox_2d", '{"bbox_2d": [1, 2, 3, 4], "center": [2, 3]}', "outside of its marks"),
        ("bbox_2d", '{"box_2d": [1, 2, 3, 4]}', "none of"),
        ("<box>", "<box>(1,2),(3,4)</box> or 100, 200", "outside of its marks"),
        ("<box>", "<box>0.1 0.2 0.3 0.4</box>", "fractions"),
        ("<point>", "<point>5000 51</point>", "outside the picture"),
        ("<point>1000", "<point>5000 51</point>", "leaves 0..1000"),
        ("<point>", "<point>a b</point>", "2 numbers"),
        ("<loc>", "100 200", "no <loc"),
    ],
)
def test_grounding_text_with_a_number_that_has_no_place_is_an_error(form, text, reason):
    with pytest.raises(LabelError, match=reason):
        follow({"answer": form}, answer=text)
