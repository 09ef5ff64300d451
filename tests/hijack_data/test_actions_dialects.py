"""Every form of every dialect: what it means, as an action, as code, and after halving the picture.

The expected pixels are written out, not computed by the library. The picture is 1000 x 2000, so
that thousandths of it are easy to read; the smart-resized one is 1008 x 1988.
"""

import gc
import json
import time

import pytest

import hijack_data as hj
from hijack_data.actions import DIALECTS, FRACTIONS, RESIZED_DIALECTS, code_of, parse_actions
from hijack_data.actions.recorded_actions import map_recorded
from hijack_data.actions.scaling import Scaling
from hijack_data.errors import HijackError
from hijack_data.labels import Labels
from hijack_data.smart_resize import smart_resize
from hijack_data.types import Action

SIZE = (1000, 2000)
HALF = hj.Resolution(scale=0.5).plan(hj.Scene(SIZE), seed=1)
RESIZED = smart_resize(*SIZE)
HALF_RESIZED = smart_resize(500, 1000)


def qwen(**arguments):
    data = json.dumps({"name": "computer_use", "arguments": arguments})
    return f"<tool_call>\n{data}\n</tool_call>"


def xml(function="computer_use", tag="tool_call", **parameters):
    inner = "".join(f"<parameter={k}>\n{v}\n</parameter>\n" for k, v in parameters.items())
    return f"<{tag}>\n<function={function}>\n{inner}</function>\n</{tag}>"


CLICK = [Action("click", 500, 250)]
CLICK_CODE = ["pyautogui.click(500, 250)"]
DRAG = [Action("drag", 500, 250, 1000, 500)]
DRAG_CODE = ["pyautogui.moveTo(500, 250)\npyautogui.dragTo(1000, 500, button='left')"]
WRITE = ["pyautogui.write('hi')"]
# dialect, reply, actions, code. Thousandths (250, 250) are pixel (500, 250) of 2000 x 1000.
FORMS = [
    # UI-TARS: ByteDance's codes/ui_tars/prompt.py
    ("ui_tars", "Action: click(point='<point>250 250</point>')", CLICK, CLICK_CODE),
    ("ui_tars", "Action: click(point='(250,250)')", CLICK, CLICK_CODE),
    ("ui_tars", "Action：click(start_box='<bbox>240 240 260 260</bbox>')", CLICK, CLICK_CODE),
    (
        "ui_tars",
        "Thought: a\nAction: drag(start_point='<point>250 250</point>', "
        "end_point='<point>500 500</point>')",
        DRAG,
        DRAG_CODE,
    ),
    (
        "ui_tars",
        "Action: scroll(point='<point>250 250</point>', direction='right')",
        [Action("other", 500, 250)],
        ["pyautogui.hscroll(5, 500, 250)"],
    ),
    (
        "ui_tars",
        "Action: hover(point='<point>250 250</point>')",
        [Action("move", 500, 250)],
        ["pyautogui.moveTo(500, 250)"],
    ),
    (
        "seed",
        "<thinkt>at <point>9 9</point></thinkt>\n"
        + xml("click", "seed:tool_call", point="<point>250 250</point>"),
        CLICK,
        CLICK_CODE,
    ),
    ("seed", xml("click", point="250 250"), CLICK, CLICK_CODE),
    ("seed", xml("type", "seed:tool_call", content="hi"), [Action("type", text="hi")], WRITE),
    (
        "seed",
        xml("drag", start_point="<point>250 250</point>", end_point="<point>500 500</point>"),
        DRAG,
        DRAG_CODE,
    ),
    # Qwen
    ("qwen3_vl", qwen(action="left_click", coordinate=[250, 250]), CLICK, CLICK_CODE),
    ("qwen3_vl", qwen(action="left_click", coordinate=["250", "250"]), CLICK, CLICK_CODE),
    ("qwen3_vl", qwen(action="left_click", coordinate="[250, 250]"), CLICK, CLICK_CODE),
    ("qwen3_vl", qwen(action="left_click", coordinate=[240, 240, 260, 260]), CLICK, CLICK_CODE),
    ("qwen3_vl", xml(action="left_click", coordinate="[250, 250]"), CLICK, CLICK_CODE),
    ("qwen3_vl", xml(action="type", text="hi"), [Action("type", text="hi")], WRITE),
    (
        "qwen3_vl",
        xml(action="key", keys='["ctrl", "c"]'),
        [Action("hotkey", keys=("ctrl", "c"))],
        ["pyautogui.hotkey('ctrl', 'c')"],
    ),
    (
        "qwen3_vl",
        '{"name": "computer_use", "arguments": {"action": "left_click", "coordinate": [250, 250]}}',
        CLICK,
        CLICK_CODE,
    ),
    ("qwen3_vl", '```json\n{"action": "click", "coordinate": [250, 250]}\n```', CLICK, CLICK_CODE),
    ("qwen3_vl", qwen(action="left_click", coordinate=[-1, -1]), [Action("other")], ["WAIT"]),
    (
        "qwen3_vl",
        "<think>no <tool_call> yet</think>" + qwen(action="left_click", coordinate=[250, 250]),
        CLICK,
        CLICK_CODE,
    ),
    (
        "gui_owl",
        qwen(action="drag", coordinate1=[250, 250], coordinate2=[500, 500]),
        DRAG,
        DRAG_CODE,
    ),
    ("gui_owl", qwen(action="interact", text="log in"), [Action("fail")], ["FAIL"]),
    # 999 thousandths of MAI-UI are the edge: 250 * 2000 / 999 = 500.5, 250 * 1000 / 999 = 250.25
    (
        "mai_ui",
        "<thinking>x</thinking>\n" + qwen(action="click", coordinate=[250, 250]),
        [Action("click", 501, 250)],
        ["pyautogui.click(501, 250)"],
    ),
    (
        "mai_ui",
        qwen(action="drag", start_coordinate=[0, 0], end_coordinate=[999, 999]),
        [Action("drag", 0, 0, 1999, 999)],
        ["pyautogui.moveTo(0, 0)\npyautogui.dragTo(1999, 999, button='left')"],
    ),
    ("mai_ui", qwen(action="terminate", status="fail"), [Action("fail")], ["FAIL"]),
    # OpenAI and Anthropic: the items of their APIs
    (
        "openai",
        {
            "type": "computer_call",
            "id": "cu_1",
            "call_id": "call_1",
            "action": {"type": "click", "button": "left", "x": 500, "y": 250},
            "pending_safety_checks": [{"id": "1", "code": "c", "message": "m"}],
            "status": "completed",
        },
        CLICK,
        CLICK_CODE,
    ),
    (
        "openai",
        {
            "type": "computer_call",
            "call_id": "call_1",
            "actions": [
                {"type": "click", "button": "left", "x": 500, "y": 250},
                {"type": "type", "text": "hi"},
            ],
        },
        [*CLICK, Action("type", text="hi")],
        [*CLICK_CODE, *WRITE],
    ),
    (
        "anthropic",
        {
            "type": "tool_use",
            "id": "toolu_1",
            "name": "computer",
            "input": {"action": "left_click", "coordinate": [500, 250]},
        },
        CLICK,
        CLICK_CODE,
    ),
    (
        "anthropic",
        {
            "type": "tool_use",
            "id": "toolu_1",
            "name": "left_click",
            "toolset_name": "computer",
            "input": {"coordinate": "[500, 250]"},
        },
        CLICK,
        CLICK_CODE,
    ),
    (
        "anthropic",
        {"action": "hover", "coordinate": [500, 250]},
        [Action("move", 500, 250)],
        ["pyautogui.moveTo(500, 250)"],
    ),
    # OpenCUA: pixels of the smart-resized picture; see below for the mapping
    (
        "opencua",
        "## Action:\nClick.\n\n## Code:\n```python\npyautogui.click(x=0, y=0)\n```",
        [Action("click", 0, 0)],
        ["pyautogui.click(x=0, y=0)"],
    ),
    (
        "opencua",
        "```\ncomputer.triple_click(x=0, y=0)\npyautogui.press('down', presses=3)\n```",
        None,
        ["pyautogui.tripleClick(x=0, y=0)\npyautogui.press('down', presses=3)"],
    ),
    (
        "opencua",
        "```code\ncomputer.triple_click(x=0, y=0)\n```",
        [Action("triple_click", 0, 0)],
        ["pyautogui.tripleClick(x=0, y=0)"],
    ),
    ("opencua", "```\ncomputer.terminate(status='failure')\n```", [Action("fail")], ["FAIL"]),
    # GLM-4.5V
    (
        "glm",
        "I press OK.\n<|begin_of_box|>left_click(start_box='[250,250]', element_info='OK (1,2)')"
        "<|end_of_box|>\nMemory:\n[]",
        CLICK,
        CLICK_CODE,
    ),
    ("glm", "Action: left_drag(start_box='[250,250]', end_box='[500,500]')", DRAG, DRAG_CODE),
    (
        "glm",
        "scroll(start_box='[250,250]', direction='down', step=3)",
        [Action("scroll", 500, 250, amount=-3)],
        ["pyautogui.scroll(-3, 500, 250)"],
    ),
    ("glm", "type(content='hi')", [Action("type", text="hi")], WRITE),
    ("glm", "key(keys='ctrl+c')", [Action("hotkey", keys=("ctrl", "c"))], None),
    ("glm", "WAIT()", [Action("wait", amount=5)], ["WAIT"]),
    ("glm", "DONE()", [Action("done")], ["DONE"]),
    (
        "glm",
        'Memory: none\nReason: x\nAction: {"action_type": "click", "box_2d": [[240,240,260,260]]}',
        CLICK,
        CLICK_CODE,
    ),
    (
        "glm",
        '{"action_type": "input_text", "text": "hi", "box_2d": [[250,250,250,250]], '
        '"override": true}',
        None,
        [
            "pyautogui.click(500, 250)\npyautogui.hotkey('ctrl', 'a')\npyautogui.press('delete')\n"
            "pyautogui.write('hi\\n')"
        ],
    ),
    # CogAgent
    (
        "cogagent",
        "Action: Click OK.\nGrounded Operation: CLICK(box=[[240,240,260,260]], "
        "element_type='Clickable text', element_info='OK')\n<<一般操作>>",
        CLICK,
        CLICK_CODE,
    ),
    (
        "cogagent",
        "Grounded Operation: SCROLL_DOWN(box=[[000,000,500,500]], step_count=5, "
        "element_info='[None]')",
        [Action("scroll", 500, 250, amount=-5)],
        ["pyautogui.scroll(-5, 500, 250)"],
    ),
    (
        "cogagent",
        "Grounded Operation: GESTURE(actions=[KEY_DOWN(key='Lcontrol'), KEY_PRESS(key='A'), "
        "KEY_UP(key='Lcontrol')])",
        None,
        ["pyautogui.keyDown('ctrl')\npyautogui.press('a')\npyautogui.keyUp('ctrl')"],
    ),
    ("cogagent", "Grounded Operation: END", [Action("done")], ["DONE"]),
    # AutoGLM
    (
        "autoglm",
        '<think>x</think>\n<answer>do(action="Tap", element=[250,250])</answer>',
        CLICK,
        CLICK_CODE,
    ),
    ("autoglm", 'do(action="Swipe", start=[250,250], end=[500,500])', DRAG, DRAG_CODE),
    ("autoglm", 'do(action="Type", text="it\'s")', [Action("type", text="it's")], None),
    ("autoglm", 'do(action="Wait", duration="3 seconds")', [Action("wait", amount=3)], ["WAIT"]),
    ("autoglm", 'finish(message="ok")', [Action("done", text="ok")], ["DONE"]),
    # ShowUI
    ("showui", "{'action': 'CLICK', 'value': None, 'position': [0.25, 0.25]}", CLICK, CLICK_CODE),
    ("showui", "[0.25, 0.25]", CLICK, CLICK_CODE),
    ("showui", '{"action": "CLICK", "value": null, "position": [0.25, 0.25]}', CLICK, CLICK_CODE),
    (
        "showui",
        "{'action': 'CLICK', 'value': None, 'position': [0.25, 0.25]},\n"
        "{'action': 'ENTER', 'value': None, 'position': None}",
        [*CLICK, Action("hotkey", keys=("enter",))],
        None,
    ),
    (
        "showui",
        "{'action': 'SELECT_TEXT', 'value': None, 'position': [[0.25,0.25], [0.5,0.5]]}",
        DRAG,
        DRAG_CODE,
    ),
    # InternVL
    ("internvl", "<ref>OK</ref><box>[[240, 240, 260, 260]]</box>", CLICK, CLICK_CODE),
    # Holo
    ("holo2", '{"x": 250, "y": 250}', CLICK, CLICK_CODE),
    (
        "holo2",
        '{"note": "", "thought": "x", "action": {"action": "click_element", "element": "OK", '
        '"x": 250, "y": 250}}',
        CLICK,
        CLICK_CODE,
    ),
    ("holo1.5", "Click(0, 0)", [Action("click", 0, 0)], ["pyautogui.click(0, 0)"]),
    # Gemini
    ("gemini", {"name": "click_at", "args": {"x": 250, "y": 250}}, CLICK, CLICK_CODE),
    ("gemini", {"functionCall": {"name": "click", "args": {"x": 250, "y": 250}}}, CLICK, None),
    (
        "gemini",
        {
            "name": "drag_and_drop",
            "args": {"x": 250, "y": 250, "destination_x": 500, "destination_y": 500},
        },
        DRAG,
        DRAG_CODE,
    ),
    (
        "gemini",
        {"name": "type_text_at", "args": {"x": 250, "y": 250, "text": "hi", "press_enter": True}},
        None,
        [
            "pyautogui.click(500, 250)\npyautogui.hotkey('ctrl', 'a')\npyautogui.press('delete')\n"
            "pyautogui.write('hi\\n')"
        ],
    ),
    (
        "gemini",
        {"name": "scroll_at", "args": {"x": 250, "y": 250, "direction": "down", "magnitude": 500}},
        [Action("scroll", 500, 250, amount=-5)],  # half of 1000 pixels
        ["pyautogui.scroll(-5, 500, 250)"],
    ),
    (
        "gemini",
        {"name": "key_combination", "args": {"keys": "control+c"}},
        [Action("hotkey", keys=("ctrl", "c"))],
        None,
    ),
]


@pytest.mark.parametrize(("dialect", "reply", "actions", "code"), FORMS)
def test_each_form_means_the_same_pixels_when_it_is_read_written_and_halved(
    dialect, reply, actions, code
):
    calls = RESIZED if dialect in RESIZED_DIALECTS else SIZE
    result = parse_actions(reply, dialect, calls)
    if actions is not None:
        assert result == actions
    if code is not None:
        assert code_of(reply, dialect, SIZE) == code
    halved = Labels({"answer": dialect}).follow(HALF, {"answer": reply})["answer"]
    if dialect in FRACTIONS:
        assert halved == reply
        return
    value = parse_actions(
        halved, dialect, HALF_RESIZED if dialect in RESIZED_DIALECTS else (500, 1000)
    )
    for before, after in zip(result, value, strict=True):
        # Halving puts pixel 2 i + 1 and pixel 2 i into pixel i.
        assert after.point == (before.point and (before.x // 2, before.y // 2))
        assert after.end == (before.end and (before.x2 // 2, before.y2 // 2))


@pytest.mark.parametrize(
    ("dialect", "reply", "expected"),
    [
        # The centre 994.5 of 1988 columns is 504.25 of 1008; 504.5 of 1008 rows is 252.25 of 504.
        ("holo1.5", "Click(994, 504)", "Click(504, 252)"),
        (
            "holo1.5",
            'Here:\n```json\n{"action": "click_absolute", "x": 994, "y": 504}\n```',
            'Here:\n```json\n{"action": "click_absolute", "x": 504, "y": 252}\n```',
        ),
        (
            "holo1.5",
            '{"note": "é", "action": {"action": "click_element", "element": "a", "x": 994, "y": 504}}',
            '{"note": "é", "action": {"action": "click_element", "element": "a", "x": 504, "y": 252}}',
        ),
        (
            "opencua",
            "Press (994, 504).\n```python\npyautogui.click(x=994, y=504)  # 994\n```\n",
            "Press (994, 504).\n```python\npyautogui.click(x=504, y=252)  # 994\n```\n",
        ),
        (
            "qwen2.5_vl",
            "at 994\n" + xml(action="left_click", coordinate="[994, 504]"),
            "at 994\n" + xml(action="left_click", coordinate="[504, 252]"),
        ),
        (
            "ui_tars_1.5",
            "Thought: (994,504)\nAction: click(point='<point>994 504</point>')",
            "Thought: (994,504)\nAction: click(point='<point>504 252</point>')",
        ),
        (
            "ui_tars_1.5",
            "Action: drag(start_point='<point>0 0</point>', end_point='<point>994 504</point>')",
            "Action: drag(start_point='<point>0 0</point>', end_point='<point>504 252</point>')",
        ),
        (
            "ui_tars_1.5",
            xml("click", "seed:tool_call", point="<point>994 504</point>"),
            xml("click", "seed:tool_call", point="<point>504 252</point>"),
        ),
        (
            "pyautogui",
            "```python\npyautogui.click(994, 504)\n```",
            "```python\npyautogui.click(497, 252)\n```",
        ),
        (
            "ui_tars_1.5",
            "<think>click(point='<point>994 504</point>')</think>Action: wait()",
            "<think>click(point='<point>994 504</point>')</think>Action: wait()",
        ),
    ],
)
def test_text_in_pixels_changes_in_its_numbers_only(dialect, reply, expected):
    follow = Labels({"answer": dialect}).follow
    assert (RESIZED, HALF_RESIZED) == ((1008, 1988), (504, 1008))
    assert follow(HALF, {"answer": reply})["answer"] == expected


@pytest.mark.parametrize(
    ("dialect", "reply", "reason"),
    [
        ("qwen3_vl", "<think>" + qwen(action="left_click", coordinate=[1, 1]), "does not end"),
        ("ui_tars", "<think>hm\nAction: click(start_box='(1,2)')", "does not end"),
        ("ui_tars", "Action: press_back()", "phone"),
        ("ui_tars", "Action: tap(point='<point>1 2</point>')", "UI-TARS has no action 'tap'"),
        ("glm", "tap(start_box='[1,2]')", "the actions are left_click, right_click"),
        ("glm", "left_click(start_box='[1,2]') or left_click(start_box='[3,4]')", "mentioned"),
        ("glm", "left_click(start_box='[1,2]', box='[3,4]')", "no field 'box'"),
        ("glm", "left_click(start_box='[1,2]'", "close its quotes"),
        ("glm", "left_click(start_box='[1200,2]')", "outside the 0 to 1000"),
        ("cogagent", "CLICK(box=[[1,2,3]])", "must be"),
        ("cogagent", "LAUNCH(app='Settings', url='None')", "pointer"),
        ("autoglm", 'do(action="Launch", app="Settings")', "phone"),
        ("autoglm", 'do(action="Fly", element=[1,2])', "autoglm has no action 'Fly'"),
        ("showui", "{'action': 'CLICK', 'position': [500, 250]}", "outside the 0 to 1"),
        ("internvl", "<box>[[1,2,3,4]]</box><box>[[1,2,3,4]]</box>", "one box"),
        ("holo2", '{"action": "goto", "url": "https://a.example"}', "browser"),
        ("holo2", "Click(1, 2) or Click(3, 4)", "no action"),
        ("gemini", {"name": "navigate", "args": {"url": "a"}}, "browser"),
        ("gemini", {"name": "clik_at", "args": {"x": 1, "y": 2}}, "did you mean 'click_at'"),
        ("mai_ui", qwen(action="swipe", direction="up"), "phone"),
        ("mai_ui", qwen(action="click", coordinate=[1060, 5]), "0 to 999"),
        ("qwen3_vl", xml("bash", command="ls"), "computer_use"),
        ("qwen3_vl", "<tool_call><function=computer_use><parameter=action>x", "does not end"),
        ("openai", {"type": "computer_call", "call_id": "1"}, "must be a dict"),
        ("anthropic", {"type": "tool_use", "name": "bash", "input": {}}, "no action 'bash'"),
        ("opencua", "```\npyautogui.click(1, 2)\n``` and ```", "fence"),
    ],
)
def test_what_a_desktop_cannot_do_or_nobody_can_read_is_refused_in_the_words_of_the_dialect(
    dialect, reply, reason
):
    with pytest.raises(HijackError, match=reason):
        code_of(reply, dialect, SIZE)


def test_every_dialect_has_a_form_here_or_in_the_tests_of_its_own():
    older = {"pyautogui", "computer_13", "ui_tars_1.5", "qwen2.5_vl"}
    assert {form[0] for form in FORMS} | older == set(DIALECTS)


def test_rows_of_datasets_follow_in_every_dialect():
    model = Scaling(RESIZED, HALF_RESIZED)
    for dialect, reply, _, _ in FORMS:
        text = reply if isinstance(reply, str) else json.dumps(reply)
        mapped_text = map_recorded(text, dialect, Scaling(SIZE, (500, 1000)), model)
        if dialect in FRACTIONS:
            assert mapped_text == text


MANY = 40_000
LONG = [
    part * (MANY // len(part))
    for part in (
        *("1,", "<tool_call>", '{"a":', "click(", "left_click(start_box='", "Action: ", "<think>"),
        *("</think>", "<box>", "```", "<function=click>", "' ", "[", " ", "<tool_call>{["),
    )
]


def test_the_effort_grows_with_the_length_of_a_reply_and_not_faster():
    def seconds(text):
        start = time.process_time()
        for dialect in DIALECTS:
            if dialect not in ("computer_13", "pyautogui"):
                with pytest.raises(HijackError):
                    code_of(text, dialect, SIZE)
        return time.process_time() - start

    # A collection goes through all that the other tests of the process left behind.
    gc.collect()
    gc.disable()
    try:
        for reply in LONG:
            # Ten times the length: ten times the effort, where a square would be a hundred times.
            assert seconds(reply) < 40 * seconds(reply[: MANY // 10]) + 0.5, reply[:20]
    finally:
        gc.enable()
