"""Generated programs, run against a recorder before and after the mapping: an oracle that knows
nothing of it."""

from hypothesis import event, given, settings
from hypothesis import strategies as st

from hijack_data.coords import CoordMap

from support.pointer import RELATIVE, Recorder, judge

HALF = CoordMap((540, 960), (1080, 1920))
ODD = CoordMap((601, 799), (1080, 1920))
ABSOLUTE = ("click", "moveTo", "dragTo", "doubleClick", "mouseDown", "mouseUp", "tripleClick")
VALUES = st.one_of(
    st.integers(-50, 2500), st.floats(-50, 2500, allow_nan=False).map(lambda v: round(v, 3))
)


@st.composite
def spelled(draw, value):
    """An expression that is `value`."""
    forms = [f"{value!r}", f"({value!r})", f"{value!r} + 0", f"2 * {value!r} - {value!r}"]
    return draw(st.sampled_from([*forms, f"+({value!r})"]))


@st.composite
def calls(draw, index):
    """Statements that hold one pointer call, in one of many spellings."""
    functions = {"absolute": ABSOLUTE, "relative": RELATIVE, "scroll": ("scroll", "hscroll")}
    kind = draw(st.sampled_from(sorted(functions)))
    name = draw(st.sampled_from(functions[kind]))
    kx, ky = ("xOffset", "yOffset") if kind == "relative" else ("x", "y")
    ex, ey = draw(spelled(draw(VALUES))), draw(spelled(draw(VALUES)))
    first = "-3, " if kind == "scroll" else ""
    setup, arguments = draw(
        st.sampled_from(
            [
                ("", f"{ex}, {ey}"),
                ("", f"{kx}={ex}, {ky}={ey}"),
                ("", f"{ky}={ey},{kx}={ex}"),
                ("", f"{ex}, {ky}={ey}"),
                ("", f"({ex}, {ey})"),
                ("", f"[{ex},{ey}]"),
                ("", f"{kx}=({ex}, {ey})"),
                (f"a{index}, b = {ex}, {ey}; ", f"a{index}, b"),
                (f"p{index} = ({ex}, {ey})\n", f"p{index}"),
                (f"q = [{ex}, {ey}]; ", "q"),
                ("", f"{ex}"),
                ("w = 10; ", f"{ex}, {ey} + w - 10"),
                ("", f"{ex}, None"),
                ("", ""),
            ]
        )
    )
    if first and arguments.startswith(kx):
        first, arguments = "", f"clicks=-3, {arguments}"
    elif first and not arguments:
        first = "-3"
    tail = draw(st.sampled_from(("", "  # click(1, 2)", "; pyautogui.write('é click(3, 4) \"→')")))
    return f"{setup}pyautogui.{name}({first}{arguments}){tail}"


@st.composite
def programs(draw):
    return "\n".join(draw(calls(i)) for i in range(draw(st.integers(1, 4))))


def record(code, size):
    recorder = Recorder(size)
    exec(code, {"pyautogui": recorder})
    return recorder.calls


@settings(max_examples=100, deadline=None)
@given(programs(), st.sampled_from([HALF, HALF.inverse(), ODD, ODD.inverse()]))
def test_the_mapped_program_does_what_mapping_the_numbers_says(code, coords):
    before = record(code, coords.observation)
    after = record(coords.code_to_screen(code), coords.screen)
    assert len(before) == len(after)
    for (name, (x, y), *arguments), (name2, pair, *rest2) in zip(before, after, strict=True):
        assert (name, arguments) == (name2, rest2)
        to = coords.vector_to_screen if name in RELATIVE else lambda a, b: coords.to_screen((a, b))
        expected = to(x or 0, y or 0)
        assert [v is None for v in pair] == [x is None, y is None]
        assert all(
            type(value) is int and value == want
            for value, want in zip(pair, expected, strict=True)
            if value is not None
        )


# Statements that hide what they do: other names for pyautogui, values that change unseen.
HOSTILE = [
    "import pyautogui as g",
    "import time as g",
    "g = pyautogui",
    "from pyautogui import moveTo as h",
    "h = pyautogui.moveTo",
    "h = 5",
    "import mouse as g",
    "from page import move as h",
    "g.click(a, 7)",
    "h(a, 7)",
    "h(*p)",
    "getattr(g, 'click')(a, 7)",
    "page.mouse.move(a, 7)",
    "exec('a = 77')",
    "q = p",
    "q[0] = 77",
    "heapq.heapify(q)",
    "a = 30",
    "b = a",
    "a, b = b, a",
    "p = [a, b]",
    "a, b = p",
    "x: pyautogui.click(a, 7) = 5",
    "print(f'{pyautogui.click(a, 7)}')",
    "pyautogui.screenshot('a.png', (a, 7, 5, 5))",
    "subprocess.run('xdotool mousemove 5 5')",
    "for a in (1, 2): pyautogui.click(a, 7)",
    "def f(a=pyautogui.click(b, 7)): pass",
    "pyautogui.click(a, 7)",
    "pyautogui.moveTo(b + 1, a)",
    "pyautogui.click(p)",
    "pyautogui.click(q)",
]


@settings(max_examples=300, deadline=None)
@given(st.lists(st.sampled_from(HOSTILE), min_size=1, max_size=6))
def test_what_is_hidden_is_refused_or_mapped_rightly(lines):
    code = "\n".join(["a, b = 10, 20", "p = [40, 50]", "q = [60, 70]", *lines])
    verdict, reached = judge(code, HALF)
    event(f"{verdict}, {reached}")
    assert verdict in ("refused", "right")
