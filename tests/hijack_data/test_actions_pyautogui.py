"""Mapping of pyautogui code: the numbers of pointer calls change, every other byte stays."""

import ast
import contextlib
import json
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
        ("click(10,20)", "click(20,40)"),
        ("pyautogui.click( 10 ,20 )", "pyautogui.click( 20 ,40 )"),
        ("pyautogui.click(x=10, y=20)", "pyautogui.click(x=20, y=40)"),
        ("pyautogui.click(y=20, x=10)", "pyautogui.click(y=40, x=20)"),
        ("pyautogui.click(10, y=20)", "pyautogui.click(20, y=40)"),
        ("pyautogui.click(10, 20, 2, 0.25, 'left')", "pyautogui.click(20, 40, 2, 0.25, 'left')"),
        (
            "pyautogui.click(10, 20, clicks=2, button='right')",
            "pyautogui.click(20, 40, clicks=2, button='right')",
        ),
        ("click((10, 20))", "click((20, 40))"),
        ("pyautogui.click([10, 20], clicks=2)", "pyautogui.click([20, 40], clicks=2)"),
        ("moveTo(x=(10,20))", "moveTo(x=(20,40))"),
        ("pyautogui.moveTo((10, 20), duration=1)", "pyautogui.moveTo((20, 40), duration=1)"),
        ("pyautogui.click((10, 20, 4, 6))", "pyautogui.click((24, 46))"),
        ("pyautogui.click(*(10, 20))", "pyautogui.click(*(20, 40))"),
        ("pyautogui.click(*[10, 20], 2)", "pyautogui.click(*[20, 40], 2)"),
        ("pyautogui.click(*(10,), 20)", "pyautogui.click(*(20,), 40)"),
        ("pyautogui.click(-10, +20)", "pyautogui.click(0, 40)"),
        ("pyautogui.click(0.5, 10.25)", "pyautogui.click(1, 21)"),
        ("pyautogui.click(5000, 20)", "pyautogui.click(1919, 40)"),
        ("pyautogui.click(960 // 2, (3 + 7) * 2)", "pyautogui.click(960, 40)"),
        ("pyautogui.click(int(10.9), round(20.2))", "pyautogui.click(20, 40)"),
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
        ("pyautogui.vscroll(*(3, 10, 20))", "pyautogui.vscroll(*(3, 20, 40))"),
        ("computer.tripleClick(x=10, y=20)", "computer.tripleClick(x=20, y=40)"),
        ("import pyautogui as pg\npg.click(10, 20)", "import pyautogui as pg\npg.click(20, 40)"),
        (
            "from pyautogui import moveTo as mv; mv(10, 20)",
            "from pyautogui import moveTo as mv; mv(20, 40)",
        ),
        ("from pyautogui import *\nclick(10, 20)", "from pyautogui import *\nclick(20, 40)"),
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
        (
            "for _ in range(3):\n    pyautogui.click(10, 20)",
            "for _ in range(3):\n    pyautogui.click(20, 40)",
        ),
        ("if ok: pyautogui.click(10, 20)", "if ok: pyautogui.click(20, 40)"),
        (
            "with pyautogui.hold('shift'):\n\tclick(10, 20)",
            "with pyautogui.hold('shift'):\n\tclick(20, 40)",
        ),
        (
            "def go():\n  pyautogui.click(10, 20)\ngo()",
            "def go():\n  pyautogui.click(20, 40)\ngo()",
        ),
        ("[pyautogui.click(10, 20) for _ in 'ab']", "[pyautogui.click(20, 40) for _ in 'ab']"),
        (
            "(pyautogui.click(10, 20), pyautogui.write('x'))",
            "(pyautogui.click(20, 40), pyautogui.write('x'))",
        ),
        ("shutil.move('a', 'b'); os.scroll(3)", "shutil.move('a', 'b'); os.scroll(3)"),
        ("page.click('text=OK')", "page.click('text=OK')"),
        ("pyautogui.screenshot('a.png')", "pyautogui.screenshot('a.png')"),
        ("time.sleep(10); pyautogui.sleep(20)", "time.sleep(10); pyautogui.sleep(20)"),
    ],
)
def test_forms(code, expected):
    assert HALF.code_to_screen(code) == expected
    assert HALF.inverse().code_to_observation(code) == expected


@pytest.mark.parametrize(
    ("setup", "call", "mapped"),
    [
        ("x, y = 10, 20", "click(x, y)", "click(20, 40)"),
        ("x = y = 10", "click(x, y)", "click(20, 20)"),
        ("pos = (3, 4)", "click(pos)", "click((6, 8))"),
        ("pos = [3, 4]", "click(pos)", "click((6, 8))"),
        ("pos = (3, 4)", "click(*pos)", "click(6, 8)"),
        ("pos = (3, 4, 2)", "click(*pos)", "click(6, 8, 2)"),
        ("pos = (3, 4)", "click(*pos, clicks=2)", "click(6, 8, clicks=2)"),
        ("rest = (-3, 5, 6)", "scroll(*rest)", "scroll(-3, 10, 12)"),
        ("rest = (0.5, 'x')", "moveTo(5, 6, *rest)", "moveTo(10, 12, *rest)"),
        ("pos = (3, 4)", "click(pos[0], pos[-1])", "click(6, 8)"),
        ("pts = [(1, 2), (3, 4)]", "click(*pts[1])", "click(6, 8)"),
        ("x: int = 10", "click(x, 5)", "click(20, 10)"),
        ("x = 10\nx = 11", "click(x, x)", "click(22, 22)"),
        ("x = 10\nx += 5\nx *= 2", "click(x, x)", "click(60, 60)"),
        ("w, h = 100, 50", "click(w * 0.5, h // 2)", "click(100, 50)"),
        ("w, h = pyautogui.size()", "click(w / 2, h - 10)", "click(960, 1060)"),
        ("s = pyautogui.size()", "click(s.width // 4, s[1] // 4)", "click(480, 270)"),
        ("if c:\n    x = 4\nelse:\n    x = 4", "click(x, 1)", "click(8, 2)"),
        ("x = 4\nif c:\n    y = 5", "click(x, 1)", "click(8, 2)"),
        ("x = 7\ndef go():\n    return x", "click(x, 1)", "click(14, 2)"),
        ("items = []\nitems.append(4)", "click([1, 2])", "click([2, 4])"),
        ("a, (b, c) = 1, (2, 3)", "click(b, c)", "click(4, 6)"),
        ("x = 5", "[click(x, 1) for y in z]", "[click(10, 2) for y in z]"),
    ],
)
def test_variables_are_substituted_at_the_call_only(setup, call, mapped):
    code = (
        f"{setup}\npyautogui.{call}\nprint(x, 'x')\n"
        if not call.startswith("[")
        else f"{setup}\n{call}\n"
    )
    expected = code.replace(call, mapped)
    assert HALF.code_to_screen(code) == expected


def test_a_constant_set_inside_the_loop_is_known_there():
    assert (
        HALF.code_to_screen("for i in z:\n  x = 4\n  click(x, 1)\n")
        == "for i in z:\n  x = 4\n  click(8, 2)\n"
    )


def test_a_function_knows_the_names_that_are_bound_once():
    once = "x = 5\ndef go():\n    pyautogui.click(x, 1)\ngo()"
    assert "click(10, 2)" in HALF.code_to_screen(once)
    with pytest.raises(ActionError):
        HALF.code_to_screen(once + "\nx = 6\ngo()")


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
        "def click(a, b): pass\nclick(10, 20)",
        "print(pyautogui.position())",
        "pyautogui.locateOnScreen('a.png')",
    ],
)
def test_what_holds_no_coordinates_stays(code):
    assert HALF.code_to_screen(code) == code


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        ("pyautogui.click(x, 20)", "nothing before this line gives 'x' a value"),
        ("for i in range(3): pyautogui.click(i, 20)", "loop"),
        ("while c:\n  pyautogui.click(x, 1)\n  x = 5", "loop"),
        ("x = 1\nwhile c:\n  x += 1\npyautogui.click(x, 1)", "loop"),
        ("[pyautogui.click(x, 2) for x in (1, 2)]", "loop variable"),
        ("pyautogui.click(*pos)", "'pos'"),
        ("pyautogui.click(10, *pos)", "'pos'"),
        ("pyautogui.click(**where)", "unpacks"),
        ("pyautogui.scroll(3, **where)", "unpacks"),
        ("pyautogui.click(find('a'), 20)", r"result of find\(\)"),
        ("pyautogui.click(*pyautogui.locateCenterOnScreen('a.png'))", "locateCenterOnScreen"),
        ("x, y = pyautogui.position()\npyautogui.click(x, y + 3)", r"position\(\)"),
        ("pyautogui.click(pyautogui.position())", r"position\(\)"),
        ("pyautogui.click('ok.png')", "picture"),
        ("pyautogui.click(True, 5)", "bool"),
        ("pyautogui.click(1j, 5)", "complex"),
        ("pyautogui.click((1, 2, 3))", "two numbers"),
        ("pyautogui.click((1, None))", "two numbers"),
        ("pyautogui.click((1, 2), 3)", "second argument"),
        ("pyautogui.click(1, (2, 3))", "not a number"),
        ("pyautogui.click(1e999, 5)", "finite"),
        ("rest = (3, 10, 20, 1e999)\npyautogui.scroll(*rest)", "finite"),
        ("pyautogui.moveRel(1e12, 5)", "2\\*\\*31"),
        ("pyautogui.click(9**9**9, 5)", "arithmetic"),
        ("pyautogui.click(2**53 + 1, 5)", "arithmetic"),
        ("pyautogui.click(1 // 0, 5)", "arithmetic fails"),
        ("pyautogui.click((-8) ** 0.5, 5)", "complex"),
        ("pyautogui.click(round(5, -10**15), 5)", "digits"),
        ("pyautogui.click(int(1e999), 5)", "int"),
        ("pyautogui.click(x := 5, 6)", "known before"),
        ("x = 1\n(x := 5)\npyautogui.click(x, 6)", ":="),
        ("x = 1\ndef f():\n  global x\n  x = 2\nf()\npyautogui.click(x, 6)", "global"),
        ("(lambda x: pyautogui.click(x, 5))(3)", "parameter"),
        ("def f(x):\n  pyautogui.click(x, 5)", "parameter"),
        ("pyautogui.click((lambda: 5)(), 3)", "result"),
        ("if c:\n  x = 1\nelse:\n  x = 2\npyautogui.click(x, 5)", "every branch"),
        ("if c:\n  x = 1\npyautogui.click(x, 5)", "every branch"),
        ("try:\n  x = 1\nexcept E:\n  x = 2\npyautogui.click(x, 5)", "try"),
        ("match c:\n  case x: pass\npyautogui.click(x, 5)", "match"),
        ("with f() as x: pass\npyautogui.click(x, 5)", "with"),
        ("x = 1\ndel x\npyautogui.click(x, 5)", "'x'"),
        ("x = 1\ndef x(): pass\npyautogui.click(x, 5)", "function"),
        ("if c: pass\nelse: x = None\npyautogui.click(x, 5)", "every branch"),
        ("x = 1\nimport x\npyautogui.click(x, 5)", "'x'"),
        ("pos = [1, 2]\npos.append(3)\npyautogui.click(*pos)", "list may be changed"),
        ("pos = [1, 2]\npos[0] = 5\npyautogui.click(pos)", "list may be changed"),
        ("a, *b = 1, 2, 3\npyautogui.click(a, 5)", "unpacked"),
        ("pyautogui.pixel(10, 20)", r"pixel\(\)"),
        ("pyautogui.pixelMatchesColor(10, 20, (0, 0, 0))", "pixelMatchesColor"),
        ("pyautogui.onScreen(10, 20)", "onScreen"),
        ("pyautogui.run('g10,20 c')", "run"),
        ("pyautogui.screenshot(region=(0, 0, 9, 9))", "region"),
        ("exec('pyautogui.click(1, 2)')", "exec"),
        ("getattr(pyautogui, 'click')(1, 2)", "hides"),
        ("pg = pyautogui\npg.click(1, 2)", "hides"),
        ("f = pyautogui.click\nf(1, 2)", "hides"),
        ("from pyautogui import click\nlist(map(click, [1], [2]))", "hides"),
        ("pyautogui.platformModule._click(1, 2)", "hides"),
        ("pg.click(10, 20)", "not known to be pyautogui"),
        ("from mine import click\nclick(10, 20)", "not known to be pyautogui"),
        ("sys.modules['pyautogui'].moveTo(1, 2)", "not known to be pyautogui"),
        ("from pynput.mouse import Controller", "pynput"),
        ("import importlib", "importlib"),
        ("f'{pyautogui.click(1, 2)}'", "f-string"),
    ],
)
def test_what_cannot_be_mapped_is_refused_with_a_reason(code, reason):
    with pytest.raises(ActionError, match=rf"line \d+, column \d+: .*{reason}.*; "):
        HALF.code_to_screen(code)


def test_the_place_counts_characters_and_leading_lines():
    with pytest.raises(
        ActionError, match=r"^line 3, column 16: pyautogui.click\(...\): x = nope cannot be mapped"
    ):
        HALF.code_to_screen("\n\r\n   write('é'); pyautogui.click(nope, 1)")
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


def test_growing_constants_are_bounded():
    doubling = (
        "a = (1, 2)\n"
        + "".join(f"a = (*a, *a)  # {i}\n" for i in range(60))
        + "pyautogui.click(*a)"
    )
    nesting = "a = (1, 2)\n" + "a = (a, a)\n" * 200 + "pyautogui.click(a)"
    text = "s = 'ab'\n" + "s = s + s\n" * 60 + "pyautogui.click(s, 1)"
    for code in (doubling, nesting, text, "x = 0x" + "f" * 9000 + "\npyautogui.click(x, 1)"):
        with pytest.raises(ActionError):
            HALF.code_to_screen(code)
    assert HALF.code_to_screen(doubling.replace("click(*a)", "click(10, 20)")).endswith(
        "click(20, 40)"
    )


def test_code_must_be_text():
    with pytest.raises(ParameterTypeError, match="must be a string"):
        HALF.code_to_screen(b"pyautogui.click(1, 2)")


def test_size_is_that_of_the_space_the_code_was_written_for():
    code = "w, h = pyautogui.size(); pyautogui.click(w // 4, h // 4)"
    assert HALF.code_to_screen(code).endswith("click(480, 270)")
    assert HALF.code_to_observation(code).endswith("click(240, 135)")


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
    for pixels in (
        "pyautogui.click(100, 200)",
        "pyautogui.click(-0.2, 0)",
        "pyautogui.click(pyautogui.size()[0], 0)",
    ):
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
