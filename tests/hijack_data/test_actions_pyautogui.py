"""Mapping of pyautogui code: the numbers of pointer calls change, every other byte stays."""

import ast
import contextlib
import json
import sys
import warnings

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hijack_data.actions import scale_normalized
from hijack_data.coords import CoordMap
from hijack_data.errors import ActionError, ParameterTypeError

HALF = CoordMap((540, 960), (1080, 1920))
ODD = CoordMap((601, 799), (1080, 1920))


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        ("pyautogui.click(10, 20)", "pyautogui.click(20, 40)"),
        ("pyautogui.click( 10 ,20 )", "pyautogui.click( 20 ,40 )"),
        ("pyautogui.click(x=10, y=20)", "pyautogui.click(x=20, y=40)"),
        ("pyautogui.click(y=20, x=10)", "pyautogui.click(y=40, x=20)"),
        ("pyautogui.click(10, y=20)", "pyautogui.click(20, y=40)"),
        ("pyautogui.click(10, 20, 2, 0.25, 'left')", "pyautogui.click(20, 40, 2, 0.25, 'left')"),
        (
            "pyautogui.click(10, 20, clicks=2, button='right')",
            "pyautogui.click(20, 40, clicks=2, button='right')",
        ),
        ("pyautogui.click((10, 20))", "pyautogui.click((20, 40))"),
        ("pyautogui.click([10, 20], clicks=2)", "pyautogui.click([20, 40], clicks=2)"),
        ("pyautogui.moveTo(x=(10,20))", "pyautogui.moveTo(x=(20,40))"),
        ("pyautogui.moveTo((10, 20), duration=1)", "pyautogui.moveTo((20, 40), duration=1)"),
        ("pyautogui.click((10, 20, 4, 6))", "pyautogui.click((24, 46))"),
        ("pyautogui.click(-10, +20)", "pyautogui.click(0, 40)"),
        ("pyautogui.click(0.5, 10.25)", "pyautogui.click(1, 21)"),
        ("pyautogui.click(5000, 20)", "pyautogui.click(1919, 40)"),
        ("pyautogui.click(960 // 2, (3 + 7) * 2)", "pyautogui.click(960, 40)"),
        ("pyautogui.click(10, None)", "pyautogui.click(20, None)"),
        ("pyautogui.click(None, 20)", "pyautogui.click(None, 40)"),
        ("pyautogui.moveTo(10)", "pyautogui.moveTo(20)"),
        ("pyautogui.click()", "pyautogui.click()"),
        ("pyautogui.click(clicks=2)", "pyautogui.click(clicks=2)"),
        (
            "pyautogui.dragTo(10, 20, 1.5, button='left')",
            "pyautogui.dragTo(20, 40, 1.5, button='left')",
        ),
        ("pyautogui.moveRel(-10, 20, 0.5)", "pyautogui.moveRel(-20, 40, 0.5)"),
        ("pyautogui.move((-10, 20))", "pyautogui.move((-20, 40))"),
        (
            "pyautogui.dragRel(xOffset=-1000, yOffset=0)",
            "pyautogui.dragRel(xOffset=-2000, yOffset=0)",
        ),
        ("pyautogui.drag(0, 3, 1)", "pyautogui.drag(0, 6, 1)"),
        ("pyautogui.scroll(-10)", "pyautogui.scroll(-10)"),
        ("pyautogui.scroll(-10, 10, 20)", "pyautogui.scroll(-10, 20, 40)"),
        ("pyautogui.hscroll(clicks=7, x=10)", "pyautogui.hscroll(clicks=7, x=20)"),
        ("computer.tripleClick(x=10, y=20)", "computer.tripleClick(x=20, y=40)"),
        ("import pyautogui as pg\npg.click(10, 20)", "import pyautogui as pg\npg.click(20, 40)"),
        (
            "from pyautogui import moveTo as mv; mv(10, 20)",
            "from pyautogui import moveTo as mv; mv(20, 40)",
        ),
        ("a = 1; pyautogui.click(10, 20); b = 2", "a = 1; pyautogui.click(20, 40); b = 2"),
        (
            "pyautogui.click(\n    10,  # left\n    20,\n)",
            "pyautogui.click(\n    20,  # left\n    40,\n)",
        ),
        (
            "pyautogui.write('é→🙂'); pyautogui.click(10, 20)",
            "pyautogui.write('é→🙂'); pyautogui.click(20, 40)",
        ),
        ("pyautogui.click(10,\r\n20)\r\n", "pyautogui.click(20,\r\n40)\r\n"),
        ("x = 1\rpyautogui.click(10, 20)", "x = 1\rpyautogui.click(20, 40)"),
        (
            "s = '\x0c\x1c\u2028'\npyautogui.click(10, 20)",
            "s = '\x0c\x1c\u2028'\npyautogui.click(20, 40)",
        ),
        ("  pyautogui.click(10, 20)", "  pyautogui.click(20, 40)"),
        ("\n\n pyautogui.click(10, 20)\n", "\n\n pyautogui.click(20, 40)\n"),
        (
            "# click(1, 2)\npyautogui.click(10, 20) # and (3, 4)",
            "# click(1, 2)\npyautogui.click(20, 40) # and (3, 4)",
        ),
        ("time.sleep(10); pyautogui.sleep(20)", "time.sleep(10); pyautogui.sleep(20)"),
    ],
)
def test_forms(code, expected):
    assert HALF.code_to_screen(code) == expected
    assert HALF.inverse().code_to_observation(code) == expected


@pytest.mark.parametrize(
    ("setup", "arguments", "mapped"),
    [
        ("x, y = 10, 20", "x, y", "20, 40"),
        ("[x, y] = [10, 20]", "x, y", "20, 40"),
        ("tag_1=(3, 4)", "tag_1", "(6, 8)"),
        ("pos = [3, 4]", "pos", "(6, 8)"),
        ("pos = (3, 4)\nother = pos", "other, clicks=2", "(6, 8), clicks=2"),
        ("x = 10\nx = 11", "x, x", "22, 22"),
        ("x = 10\nx = x * 2 + 1", "[x, x]", "[42, 42]"),
        ("w, h = 100, 50", "w * 0.5, h // 2", "100, 50"),
        ("left, size = -3, 10 % 4", "left + 10, size", "14, 4"),
    ],
)
def test_variables_are_substituted_at_the_call_only(setup, arguments, mapped):
    code = f"{setup}\npyautogui.click({arguments})\npyautogui.write('x')\n"
    assert HALF.code_to_screen(code) == code.replace(f"click({arguments})", f"click({mapped})")


@pytest.mark.parametrize("code", ["WAIT", "DONE", "FAIL", "\n  DONE\n", "WAIT ", "\tFAIL"])
def test_special_words_pass(code):
    assert HALF.code_to_screen(code) == code


@pytest.mark.parametrize(
    "code",
    [
        "pyautogui.write('click(10, 20)')",
        'pyautogui.typewrite("pyautogui.click(10, 20)", interval=0.1)',
        "pyautogui.press('enter', presses=3)",
        "pyautogui.hotkey('ctrl', 'c')",
        "pyautogui.hotkey(keys=['ctrl', 'c'])",
        "pyautogui.keyDown('shift')\npyautogui.keyUp('shift')",
        "computer.terminate(status='success')",
        "computer.wait()",
        "'''\nThought: click(10, 20)\n'''",
        "pyautogui.write(r'C:\\new') # \\d",
        "",
        "# nothing",
        "pyautogui.write('\\d')",
        "pyautogui.PAUSE = 0.5",
        "import pyautogui\nimport time",
        "from time import sleep\nsleep(3)",
        "import pyperclip\npyperclip.copy('é')\npyautogui.hotkey('ctrl', 'v')",
    ],
)
def test_what_holds_no_coordinates_stays(code):
    assert HALF.code_to_screen(code) == code


REFUSED = {
    "for i in range(3): pyautogui.click(i, 20)": "a for loop .*write out the calls",
    "while c:\n  pyautogui.click(1, 1)": "a while loop",
    "if c: pyautogui.click(1, 1)": "an if statement .*one branch",
    "try: pyautogui.click(1, 1)\nfinally: pass": "a try statement",
    "match c:\n  case 1: pass": "a match statement",
    "with pyautogui.hold('shift'): pass": "a with statement .*keyDown",
    "def f(): pyautogui.click(1, 2)": "a function definition",
    "async def f(): pass": "a function definition",
    "class K: pyautogui.click(1, 2)": "a class",
    "x = 1; x += 1": "an augmented assignment",
    "x: int = 1": "an annotated assignment",
    "pass": "a pass statement .*WAIT",
    "del x": "the statement 'delete'",
    "assert pyautogui.click(1, 2)": "the statement 'assert'",
    "x = y = 1": "several targets",
    "x, y = 1, 2, 3": "anything but 2 values for 2 names .*x, y = 100, 200",
    "x, y = 1": "anything but 2 values",
    "a, *b = 1, 2": "an assignment to anything but a name",
    "p = [1, 2]; p[0] = 3": "an assignment to anything but a name",
    "pyautogui.click = 5": "an assignment to anything but a name",
    "time.PAUSE = 5": "an assignment to anything but a name",
    "pyautogui = 5": "a second meaning of the name 'pyautogui'",
    "import time as pyautogui": "a second meaning of the name 'pyautogui'",
    "x = 1; import time as x": "a second meaning of the name 'x'",
    "import os": "an import of 'os' .*import only pyautogui, time, ",
    "import pyautogui._pyautogui_x11 as x": "an import of 'pyautogui._pyautogui_x11'",
    "from os import system": "an import of 'os'",
    "from . import pyautogui": "an import of '.'",
    "from pyautogui import *": r"pyautogui\.\*",
    "from pyautogui import clik": "pyautogui.clik .*did you mean 'click'",
    "click(1, 2)": r"click\(\) without its module .*write pyautogui.click",
    "print('a')": r"a call of print\(\)",
    "pg.click(1, 2)": r"a call of pg.click\(\)",
    "getattr(pyautogui, 'click')(1, 2)": "a call of getattr",
    "(lambda x: pyautogui.click(x, 5))(3)": "a call of ",
    "pyautogui.click.__call__(1, 2)": "a call of pyautogui.click.__call__",
    "sys.modules['pyautogui'].moveTo(1, 2)": "a call of sys.modules",
    "pyautogui.screenshot()": "pyautogui.screenshot .*cannot read the screen",
    "pyautogui.position()": "pyautogui.position",
    "pyautogui.pixel(10, 20)": "pyautogui.pixel",
    "pyautogui.run('g10,20 c')": "pyautogui.run",
    "pyautogui.terminate()": "pyautogui.terminate",
    "time.time()": "time.time",
    "pyautogui.click(x, 20)": "the name 'x' without a value",
    "pyautogui.click(x, 20); x = 5": "the name 'x' without a value",
    "pyautogui.click(*(1, 2))": r"a star argument .*click\(100, 200\)",
    "pyautogui.click(**{'x': 1})": "a star argument",
    "pyautogui.click((1, *x))": "a star argument",
    "w, h = pyautogui.size()": "the result of a call",
    "pyautogui.click(int(2.5), 3)": "the result of a call",
    "p = (1, 2); pyautogui.click(p[0], 3)": "an index",
    "pyautogui.write(f'{1}')": "an f-string",
    "pyautogui.write('a' + 'b')": "arithmetic on 'a'",
    "pyautogui.press(['left'] * 5)": r"arithmetic on \['left'\]",
    "pyautogui.click(True + 1, 5)": "arithmetic on True",
    "pyautogui.click(9**9**9, 5)": "an operator other than",
    "pyautogui.click(~5, 5)": "an operator other than",
    "pyautogui.click(1 // 0, 5)": "arithmetic that fails",
    "pyautogui.click(1 if c else 2, 5)": "a conditional expression",
    "pyautogui.click(x := 5, 6)": "an assignment inside an expression",
    "pyautogui.click([1 for _ in c], 6)": "a list comprehension",
    "pyautogui.click({1}, {2})": "a set .*without braces",
    "pyautogui.click({})": "a dict",
    "pyautogui.click(lambda: 5, 3)": "a lambda",
    "pyautogui.click(1j, 5)": "a value of type complex",
    "pyautogui.write(b'a')": "a value of type bytes",
    "pyautogui.click(..., 5)": "a value of type ellipsis",
    "pyautogui.write(pyautogui.click)": "an attribute",
    "pyautogui.click(await f(), 5)": "an expression of this kind",
    "pyautogui.hotkey([['ctrl'], 'c'])": "a sequence in a sequence",
    "p = (1, 2); pyautogui.click((p, p))": "a sequence in a sequence",
    "pyautogui.click(1e999, 5)": r"a number beyond 10\*\*15",
    "pyautogui.click(10**15 * 1, 5)": "an operator other than",
    "pyautogui.click(2000000000000000, 5)": r"a number beyond 10\*\*15",
    "[pyautogui.click(1, 2) for x in (1, 2)]": "an expression that is not a call",
    "(pyautogui.click(1, 2), 5)": "an expression that is not a call",
    "- pyautogui.click(1, 2)": "an expression that is not a call",
    "f'{pyautogui.click(1, 2)}'": "an expression that is not a call",
    "pyautogui.click(1, 2)\nDONE": "the name 'DONE' alone on a line .*WAIT, DONE and FAIL",
    # within the grammar, but not a place on the screen
    "pyautogui.click('ok.png')": "picture",
    "pyautogui.click(True, 5)": "not a number",
    "pyautogui.click(pyautogui.linear, 5)": "not a number",
    "pyautogui.click((True, 5))": "not a number",
    "pyautogui.click((1, 2, 3))": "two numbers",
    "pyautogui.click((1, None))": "two numbers",
    "pyautogui.click((1, 2), 3)": "second argument",
    "pyautogui.click(1, (2, 3))": "not a number",
    "pyautogui.moveRel(1e12, 5)": r"2\*\*31",
}


@pytest.mark.parametrize(("code", "reason"), REFUSED.items(), ids=list(REFUSED))
def test_what_cannot_be_mapped_is_refused_by_name(code, reason):
    with pytest.raises(ActionError, match=rf"^line \d+, column \d+: .*{reason}") as refusal:
        HALF.code_to_screen(code)
    assert "; " in str(refusal.value), "a remedy follows"


def test_the_place_counts_characters_and_leading_lines():
    with pytest.raises(
        ActionError, match=r"^line 3, column 26: pyautogui.click\(...\): x = 'no' cannot be mapped"
    ):
        HALF.code_to_screen("\n\r\n   pyautogui.write('é'); pyautogui.click('no', 1)")
    with pytest.raises(ActionError, match=r"^line 3, column 5: not Python"):
        HALF.code_to_screen("\n\r\n  x )")


@pytest.mark.parametrize(
    "code",
    [
        "pyautogui.click(",
        "click the button",
        "a\n  b",
        "\x00",
        "'\ud800'",
        "-" * 100_000 + "1",
        "(" * 300,
        "1+" * 50_000 + "1",
        "a" + ".b" * 50_000,
        "9" * 5000,
        "[" * 5000,
        "\ufeffx",
        "pyautogui.click(" + "9" * 5000 + ", 1)",
    ],
)
def test_what_is_not_python_is_an_action_error(code):
    with pytest.raises(ActionError):
        HALF.code_to_screen(code)


def test_growing_numbers_are_bounded():
    squares = "x = 9\n" + "x = x * x\n" * 60
    nested = "a = (1, 2)\n" + "a = (a, a)\n" * 60
    for code in (squares, nested, "x = 0x" + "f" * 9000, "x = " + "1 + " * 5000 + "1"):
        with pytest.raises(ActionError):
            HALF.code_to_screen(f"{code}\npyautogui.click(10, 20)")


def test_the_effort_grows_with_the_length_of_the_code():
    lines = "x = 3\npyautogui.click(x, 2); pyautogui.write('é')\n"
    steps = [count_steps(lines * number) for number in (30, 120)]
    assert 3 < steps[1] / steps[0] < 5


def count_steps(code):
    """Return how many functions Python calls, its own and built-in ones, to map `code`."""
    count = 0

    def note(frame, event, argument):
        nonlocal count
        count += event in ("call", "c_call")

    before = sys.getprofile()
    sys.setprofile(note)
    try:
        HALF.code_to_screen(code)
    finally:
        sys.setprofile(before)
    return count


def test_code_must_be_text():
    with pytest.raises(ParameterTypeError, match="must be a string"):
        HALF.code_to_screen(b"pyautogui.click(1, 2)")


def test_normalized_code_becomes_pixels():
    code = (
        "pyautogui.moveTo(x=0.328, y=0.4697)\npyautogui.dragTo(x=0.5025, y=0.6039, button='left')"
    )
    expected = "pyautogui.moveTo(x=420, y=338)\npyautogui.dragTo(x=643, y=435, button='left')"
    assert scale_normalized(code, (720, 1280)) == expected
    assert scale_normalized("pyautogui.click(1, 1.0)", (720, 1280)) == "pyautogui.click(1279, 719)"
    assert scale_normalized("pyautogui.scroll(-54)", (720, 1280)) == "pyautogui.scroll(-54)"
    assert (
        scale_normalized("pyautogui.moveRel(-0.5, 0)", (720, 1280)) == "pyautogui.moveRel(-640, 0)"
    )
    for pixels in ("pyautogui.click(100, 200)", "pyautogui.click(-0.2, 0)"):
        with pytest.raises(ActionError):
            scale_normalized(pixels, (720, 1280))


def test_real_recordings_map(shared_data):
    codes = list(recorded_codes(shared_data))
    assert len(codes) > 40
    for code in codes:
        pixels = scale_normalized(code, (1080, 1920))
        assert HALF.code_to_screen(HALF.code_to_observation(pixels)).count("(") == code.count("(")
        assert ast.dump(skeleton(pixels)) == ast.dump(skeleton(code))


def recorded_codes(shared_data):
    folder = shared_data / "trajectories"
    for path in sorted((folder / "agentnetbench").glob("*.json")):
        yield from (step["action"] for step in json.loads(path.read_text())["steps"])
    for line in (folder / "agentnet_raw" / "raw_example.jsonl").read_text().splitlines():
        yield from (step["value"]["code"] for step in json.loads(line)["traj"])


def skeleton(code):
    """The syntax tree with every number set to 0."""
    tree = ast.parse(code)
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
            node.value = 0
    return tree


@settings(max_examples=60)
@given(st.text())
def test_typed_text_never_changes(text):
    text = text.encode("utf-8", "ignore").decode()
    code = f"pyautogui.write({text!r}); pyautogui.click(10, 20); x = {text!r}"
    assert (
        HALF.code_to_screen(code) == code.replace("click(10, 20); x", "click(20, 40); x")
        or "click(10, 20)" in text
    )


@settings(max_examples=200, deadline=None)
@given(
    st.text(),
    st.lists(
        st.sampled_from(
            [
                "pyautogui.click(",
                "x",
                ")",
                "(",
                "\n",
                " ",
                "=",
                "lambda ",
                "*",
                ",",
                "9",
                "'",
                "[",
                "]",
                "for ",
                "in ",
                ":",
                "if ",
                "{",
                "f'",
                "\\",
                "def f(x):",
                "-",
            ]
        )
    ),
)
@example("\ud800", [])
@example("", ["x", "=", "x", "\n", "pyautogui.click(", "x", ")"])
def test_garbage_is_refused_or_passes(text, pieces):
    for code in (text, "".join(pieces)):
        CoordMap.identity((9, 9)).code_to_screen(code)
        with contextlib.suppress(ActionError), warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)  # of the garbage itself
            warnings.simplefilter("ignore", DeprecationWarning)
            ast.parse(HALF.code_to_screen(code).lstrip())
