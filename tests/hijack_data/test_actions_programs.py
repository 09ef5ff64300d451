"""Generated programs, run against a recorder before and after the mapping: an oracle that knows
nothing of it."""

import contextlib

from hypothesis import event, given, settings
from hypothesis import strategies as st

from hijack_data.coords import CoordMap
from hijack_data.errors import ActionError

from support.pointer import RELATIVE, Recorder, judge

HALF = CoordMap((540, 960), (1080, 1920))
ODD = CoordMap((601, 799), (1080, 1920))


ABSOLUTE = (
    "click",
    "moveTo",
    "dragTo",
    "doubleClick",
    "rightClick",
    "mouseDown",
    "mouseUp",
    "tripleClick",
)
VALUES = st.one_of(
    st.integers(-50, 2500), st.floats(-50, 2500, allow_nan=False).map(lambda v: round(v, 3))
)


@st.composite
def spelled(draw, value):
    """An expression that is `value`."""
    forms = [
        repr(value),
        f"({value!r})",
        f"{value!r} + 0",
        f"2 * {value!r} - {value!r}",
        f"+({value!r})",
    ]
    return draw(st.sampled_from(forms))


@st.composite
def calls(draw, index):
    """Statements that hold one pointer call, in one of many spellings."""
    x, y = draw(VALUES), draw(VALUES)
    kind = draw(st.sampled_from(("absolute", "relative", "scroll")))
    name = draw(
        st.sampled_from(
            {"absolute": ABSOLUTE, "relative": RELATIVE, "scroll": ("scroll", "hscroll")}[kind]
        )
    )
    kx, ky = ("xOffset", "yOffset") if kind == "relative" else ("x", "y")
    ex, ey = draw(spelled(x)), draw(spelled(y))
    first = "-3, " if kind == "scroll" else ""
    setups_and_arguments = [
        ("", f"{ex}, {ey}"),
        ("", f"{kx}={ex}, {ky}={ey}"),
        ("", f"{ky}={ey},{kx}={ex}"),
        ("", f"{ex}, {ky}={ey}"),
        ("", f"({ex}, {ey})"),
        ("", f"[{ex},{ey}]"),
        ("", f"{kx}=({ex}, {ey})"),
        ("", f"*({ex}, {ey})"),
        (f"a{index}, b = {ex}, {ey}; ", f"a{index}, b"),
        (f"p{index} = {ex}, {ey}\n", f"*p{index}"),
        (f"p{index} = ({ex}, {ey})\n", f"p{index}"),
        (f"q = [{ex}, {ey}]; ", "q[0], q[1]"),
        ("", f"{ex}"),
        ("w = 10; ", f"{ex}, {ey} + w - 10"),
        ("", f"{ex}, None"),
        ("", ""),
    ]
    setup, arguments = draw(st.sampled_from(setups_and_arguments))
    if first and arguments.startswith(kx):
        first, arguments = "", f"clicks=-3, {arguments}"
    elif first and not arguments:
        first = "-3"
    tail = draw(st.sampled_from(("", "  # click(1, 2)", "; pyautogui.write('é click(3, 4) \"→')")))
    return f"{setup}pyautogui.{name}({first}{arguments}){tail}"


@st.composite
def programs(draw):
    lines = [draw(calls(i)) for i in range(draw(st.integers(1, 4)))]
    if draw(st.booleans()):
        body = "\n".join(lines).split("\n")
        return "for _ in range(2):\n" + "\n".join(f"    {line}" for line in body)
    return "\n".join(lines)


def record(code, size):
    recorder = Recorder(size)
    exec(code, {"pyautogui": recorder})
    return recorder.calls


@settings(max_examples=150, deadline=None)
@given(programs(), st.sampled_from([HALF, HALF.inverse(), ODD, ODD.inverse()]))
def test_the_mapped_program_does_what_mapping_the_numbers_says(code, coords):
    mapped = coords.code_to_screen(code)
    before, after = record(code, coords.observation), record(mapped, coords.screen)
    assert len(before) == len(after)
    for (name, (x, y), rest, kwargs), (name2, pair, rest2, kwargs2) in zip(
        before, after, strict=True
    ):
        assert (name, rest, kwargs) == (name2, rest2, kwargs2)
        to = coords.vector_to_screen if name in RELATIVE else lambda a, b: coords.to_screen((a, b))
        expected = to(x or 0, y or 0)
        assert [v is None for v in pair] == [x is None, y is None]
        assert all(
            type(got) is int and got == want
            for got, want in zip(pair, expected, strict=True)
            if got is not None
        )


@given(programs())
def test_the_identity_changes_nothing(code):
    assert CoordMap.identity((1080, 1920)).code_to_screen(code) == code


# Programs with control flow: whatever is mapped at all must do what mapping the numbers says.

CLICK = "pyautogui.click({0}, 7)"
SIMPLE = [
    "a = 30",
    "b = a",
    "a += 5",
    "a, b = b, a",
    "p = [a, b]",
    "p[0] = 9",
    "q = p",
    "a = p[0]",
    "p.append(1)",
    "f()",
    "del_a()",
]


@st.composite
def flows(draw, depth=0):
    lines = []
    for _ in range(draw(st.integers(1, 4))):
        kind = draw(st.integers(0, 12 if depth < 2 else 5))
        if kind < 3:
            lines.append(draw(st.sampled_from(SIMPLE)))
        elif kind < 6:
            lines.append(
                CLICK.format(draw(st.sampled_from(["a", "b", "p[0]", "q[0]", "a + b", "50"])))
            )
        else:
            head, tail = draw(
                st.sampled_from(
                    [
                        ("if flag:", ""),
                        ("if flag:", "else:\n    b = 3"),
                        ("for a in (1, 2):", ""),
                        ("for i in (1, 2):", ""),
                        ("while next(turns):", ""),
                        ("try:", "except ZeroDivisionError:\n    a = 3"),
                        ("def f():", ""),
                        ("try:\n    1 / 0\nexcept ZeroDivisionError:", ""),
                        ("with closing:", ""),
                        ("def f(a=4):", ""),
                        ("match flag:\n  case b:", ""),
                        ("class C:", ""),
                    ]
                )
            )
            body = "\n".join("    " + line for line in draw(flows(depth + 1)).split("\n"))
            lines += [head, body, *([tail] if tail else [])]
    return "\n".join(lines)


PRELUDE = """
a, b, p, q = 10, 20, [40, 50], [60]
def f(): pass
def del_a():
    global {name}
    {name} = 77
"""


def trace(code, size, flag):
    recorder, closing = Recorder(size), contextlib.nullcontext()
    turns = iter([True, True] + [False] * 200)
    scope = {"pyautogui": recorder, "flag": flag, "turns": turns, "closing": closing}
    outcome = None
    try:
        exec(code, scope)
    except (NameError, RecursionError, StopIteration, TypeError) as error:
        outcome = type(error)
    return outcome, [pair for _, pair, _, _ in recorder.calls]


@settings(max_examples=250, deadline=None)
@given(flows(), st.sampled_from(["a", "c"]), st.booleans())
def test_what_is_mapped_through_control_flow_is_mapped_rightly(body, name, flag):
    code = PRELUDE.format(name=name) + body
    try:
        mapped = ODD.code_to_screen(code)
    except ActionError:
        event("refused")
        return
    event("mapped")
    outcome, before = trace(code, ODD.observation, flag)
    assert trace(mapped, ODD.screen, flag) == (
        outcome,
        [list(ODD.to_screen(tuple(pair))) for pair in before],
    )


# Programs that hide what they do: other names for pyautogui, values that change unseen, odd places.

HOSTILE = [
    "import pyautogui as g",
    "import time as g",
    "g = pyautogui",
    "from pyautogui import moveTo as h",
    "h = pyautogui.moveTo",
    "import mouse as g",
    "from page import move as h",
    "g.click(a, 7)",
    "g.move(p[0], 5)",
    "h(a, 7)",
    "h(*p)",
    "k.click(a, 7)",
    "k = [g, h][0]",
    "k = globals()['pyautogui']",
    "vars(k)['click'](a, 7)",
    "getattr(g, 'click')(a, 7)",
    "sys.modules['pyautogui'].click(a, 7)",
    "page.mouse.move(a, 7)",
    "exec('a = 77')",
    "globals()['b'] = 77",
    "q = p",
    "q[0] = 77",
    "operator.setitem(p, 0, 77)",
    "heapq.heapify(q)",
    "f = lambda: pyautogui.click(a, 7)",
    "f = (pyautogui.click(b, 7) for _ in 'ab')",
    "list(f)",
    "x: pyautogui.click(a, 7) = 5",
    "print(f'{pyautogui.click(a, 7)}')",
    "pyautogui.screenshot('a.png', (a, 7, 5, 5))",
    "subprocess.run('xdotool mousemove 5 5')",
]
HEADS = [
    "if flag:",
    "for a in (1, 2):",
    "for p[0] in (1, 2):",
    "class K:",
    "def f(a=pyautogui.click(b, 7)):",
    "def f():",
    "with closing as a:",
    "try:",
    "while next(turns):",
    "match flag:\n  case b:",
]


@st.composite
def hostile_programs(draw, depth=0):
    lines = []
    for _ in range(draw(st.integers(1, 5))):
        kind = draw(st.integers(0, 10 if depth < 2 else 7))
        if kind < 1:
            lines.append(draw(st.sampled_from(HOSTILE)))
        elif kind < 4:
            lines.append(draw(st.sampled_from(SIMPLE)))
        elif kind < 8:
            lines.append(CLICK.format(draw(st.sampled_from(["a", "b", "p[0]", "q[0]", "a + b"]))))
        else:
            head = draw(st.sampled_from(HEADS))
            body = draw(hostile_programs(depth + 1)).split("\n")
            lines += [head, *("    " + line for line in body)]
            lines += ["finally:\n    b = 3"] if head == "try:" else []
    return "\n".join(lines)


def around():
    turns = iter([True, True] + [False] * 200)
    return {"flag": True, "turns": turns, "closing": contextlib.nullcontext(55)}


@settings(max_examples=400, deadline=None)
@given(hostile_programs())
def test_what_is_hidden_is_refused_or_mapped_rightly(body):
    verdict, _ = judge(f"a, b, p, q = 10, 20, [40, 50], [60]\n{body}", HALF, around)
    event(verdict)
    assert verdict in ("refused", "right")
