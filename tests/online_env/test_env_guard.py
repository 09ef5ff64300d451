"""What an agent may do: words, pyautogui code, and nothing else."""

import ast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hijack_data.actions.agent_actions import MAX_CODE_CHARS, REINIT, read_action
from hijack_data.errors import ActionError

ALLOWED = [
    "pyautogui.click(1, 2)",
    "import pyautogui\nimport time as t\npyautogui.click(x=1, y=2)\nt.sleep(1)",
    "from pyautogui import click\nfrom time import sleep\nclick(1, 2); sleep(0.5)",
    "pyautogui.press(['left', 'left'])  # twice",
    "pyautogui.PAUSE = 0.5\npyautogui.moveTo(1, 2, duration=0.5, tween=pyautogui.easeInQuad)",
    "x = 5\ny = x * 2 - 1\npyautogui.click(x, y, button=pyautogui.RIGHT)",
    "tag_1 = (30, 40)\npyautogui.click(tag_1)",
    "pyautogui.write('```')",
    "'''\nThought: open it\n'''\npyautogui.scroll(-2)",
]
REFUSED = {
    "import os": "an import of 'os'",
    "import pyautogui, os": "an import of 'os'",
    "from os import system": "an import of 'os'",
    "import pyperclip": "import only pyautogui, time",
    "computer.terminate(status='success')": r"computer.terminate\(\)",
    "os.system('x')": r"os.system\(\)",
    "exec('x')": r"exec\(\)",
    "for i in range(3): pyautogui.press('a')": "for loop",
    "with pyautogui.hold('shift'): pyautogui.press('a')": "with statement",
    "f = exec\nf('x')": "'exec'",
    "print = exec\nprint('x')": "'exec'",
    "import pyautogui as range\nrange(3)": r"range\(\)",
    "pyautogui.write(eval('1'))": "result of a call",
    "f = pyautogui.click\nf(1, 2)": "an attribute",
    "pyautogui.__class__('x')": "__class__",
    "pyautogui.run('c')": "pyautogui.run",
    "pyautogui.screenshot('/tmp/x')": "cannot read the screen",
    "pyautogui.alert('x')": "alert",
    "pyautogui.triple_click(1, 2)": "did you mean 'tripleClick'",
    "pyautogui.pyscreeze.click()": "pyscreeze",
    "pyautogui.click = 5": "anything but a name",
    "pyautogui.write(().__class__)": "an attribute",
    "(pyautogui).click.__self__": "not a call",
    "DONE\npyautogui.click(1, 2)": "'DONE' alone",
    "pyautogui.write(__builtins__)": "'__builtins__' without a value",
    "I click the button.": "not Python",
    "(" * 5000: "not Python",
    "": "empty",
    "``````": "not Python|empty",
}


@pytest.mark.parametrize("code", ALLOWED)
def test_pointer_and_keyboard_are_let_through_as_they_are(code: str) -> None:
    assert read_action(code) == read_action(f"I will do this:\n```python\n{code}\n```")
    assert read_action(code).code == code


@pytest.mark.parametrize(
    ("code", "reason"), REFUSED.items(), ids=[repr(code)[:30] for code in REFUSED]
)
def test_all_else_is_refused_with_the_reason(code: str, reason: str) -> None:
    with pytest.raises(ActionError, match=reason):
        read_action(code)


@pytest.mark.parametrize("word", ["WAIT", "DONE", "FAIL", REINIT])
def test_words_are_words_wherever_they_stand_alone(word: str) -> None:
    expected = {"WAIT": "wait", "DONE": "done", "FAIL": "fail", REINIT: "reinit"}[word]
    assert read_action(f" {word}\n").kind == read_action(f"So:\n```\n{word}\n```").kind == expected
    with pytest.raises(ActionError):
        read_action(f"{word} it")


def test_one_action_at_a_time() -> None:
    with pytest.raises(ActionError, match="2 blocks"):
        read_action("```\nWAIT\n```\n```\nDONE\n```")


def test_any_code_runs_where_that_is_asked_for() -> None:
    code = "import os\nos.system('true')"
    assert read_action(code, allow_code=True).code == code
    assert read_action("FAIL", allow_code=True).kind == "fail"


@pytest.mark.parametrize(
    "text", [5, None, b"WAIT", "x" * (MAX_CODE_CHARS + 1), "pyautogui.write('a\0')", "'\ud800'"]
)
@pytest.mark.parametrize("allow_code", [False, True])
def test_what_no_guest_can_take_is_refused_in_any_case(text: object, allow_code: bool) -> None:
    with pytest.raises(ActionError):
        read_action(text, allow_code)


def test_long_code_is_read_quickly() -> None:
    lines = "\n".join(f"import time as t{i}\npyautogui.click({i}, {i})" for i in range(600))
    assert read_action(lines).kind == "code"


WORDS = (
    "pyautogui time exec click x import from for in print range os lambda as open eval min key"
    " __class__"
)


@pytest.mark.parametrize(
    "answer",
    [
        "a:\n```python\npyautogui.click(1, 2)\n``` b: ```python\npyautogui.click(3, 4)\n```",
        "```python\npyautogui.click(1, 2)\n```\n\n```python\npyautogui.click(3, 4)",
        "```python\npyautogui.click(1, 2)\n``` \ntext ```pyautogui.click(3, 4)```",
        "> ```\n> pyautogui.click(1, 2)\n> ```\n```\npyautogui.click(3, 4)\n```",
        "```pyautogui.click(1, 2)```\n```pyautogui.click(3, 4)```",
    ],
)
def test_two_fences_are_malformed_however_they_are_set(answer):
    with pytest.raises(ActionError, match="give one action at a time"):
        read_action(answer)


PIECES = st.sampled_from([*WORDS.split(), *".()=,1[]:", "'a'", "```", "\n", " ", "    "])


@given(
    st.one_of(
        st.text(),
        st.lists(PIECES, max_size=25).map(" ".join),
        st.lists(PIECES, max_size=25).map("".join),
    )
)
def test_whatever_is_let_through_calls_nothing_but_pointer_and_keyboard(text: str) -> None:
    try:
        request = read_action(text)
    except ActionError:
        return
    if request.kind != "code":
        return
    nodes = list(ast.walk(ast.parse(request.code)))
    called = {ast.unparse(node.func) for node in nodes if isinstance(node, ast.Call)}
    module_names = {
        node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)
    }
    dangerous = {
        "exec",
        "eval",
        "open",
        "compile",
        "__import__",
        "getattr",
        "globals",
        "os",
        "input",
        "breakpoint",
    }
    assert not (called | module_names) & dangerous
