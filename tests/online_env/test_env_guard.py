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
    "for x, y in [(1, 2), (3, 4)]:\n    pyautogui.click(x, y)",
    "for i in range(3): pyautogui.press('a')",
    "with pyautogui.hold('shift'):\n    pyautogui.press(['left', 'left'])",
    "pyautogui.PAUSE = 0.5\npyautogui.moveTo(1, 2, duration=0.5, tween=pyautogui.easeInQuad)",
    "x = 5\ny = x * 2 - 1\npyautogui.click(x, y, button=pyautogui.RIGHT)",
    "p = pyautogui.position()\npyautogui.click(p.x + 1, p.y)",
    "pyautogui.write(f'a{1 + 1}')",
    "pyautogui.write('```')",
    "n = 2\nn += 1\npyautogui.scroll(-n)",
]
REFUSED = {
    "import os": "module 'os'",
    "import pyautogui, os": "module 'os'",
    "import time.sleep": "module 'time.sleep'",
    "from os import system": "os.system",
    "from pyautogui import *": "pyautogui.*",
    "from . import pyautogui": "pyautogui",
    "os.system('x')": r"os.system\(\)",
    "exec('x')": r"exec\(\)",
    "open('x')": r"open\(\)",
    "min(['x'], key=exec)": "'exec' may be called",
    "f = exec\nf('x')": "'exec'",
    "print = exec\nprint('x')": "exec",
    "for print in [exec]:\n  print('x')": "exec",
    "import pyautogui as range\nrange(3)": r"range\(\)",
    "time = 3\ntime.sleep(1)": r"time.sleep\(\)",
    "f = pyautogui.click\nf(1, 2)": "pyautogui.click is not",
    "pyautogui.__class__": "__class__",
    "pyautogui.run('c')": r"pyautogui.run\(\)",
    "pyautogui.screenshot('/tmp/x')": "screenshot",
    "pyautogui.alert('x')": "alert",
    "pyautogui.pyscreeze.click()": "pyscreeze",
    "pyautogui.click = print": "pyautogui.click",
    "().__class__": "__class__",
    "(pyautogui).click.__self__": "__self__",
    "lambda: 0": "Lambda",
    "while True: pass": "While",
    "[x for x in []]": "ListComp",
    "def f(): pass": "FunctionDef",
    "x: int = 3": "AnnAssign",
    "with open('x'): pass": "hold",
    "with pyautogui.hold('shift') as f: pass": "hold",
    "b'1'": "bytes",
    "1j": "complex",
    "click": "not defined",
    "DONE\npyautogui.click(1, 2)": "not defined",
    "pyautogui.write(__builtins__)": "not defined|passed on",
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
    wanted = {"WAIT": "wait", "DONE": "done", "FAIL": "fail", REINIT: "reinit"}[word]
    assert read_action(f" {word}\n").kind == read_action(f"So:\n```\n{word}\n```").kind == wanted
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
    loaded = {
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
    assert not (called | loaded) & dangerous
