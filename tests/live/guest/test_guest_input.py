"""Mouse and keyboard on a real desktop: exact text in real applications, and nothing left
pressed."""

import numpy as np
import pytest

from support import needs
from support.waiting import still

MIXED = 'Hello wörld — naïve £5 €10 {}[]|~`@#$%^&*()_+ "quoted" \\ 你好 Привет 😀 ñ<>ß'
ASCII = "".join(chr(code) for code in range(32, 127))
# The keyboard has 19 spare keys, so these take several rounds.
MANY = (
    "".join(chr(code) for code in range(0x430, 0x450))
    + "ĀāĂ㌠㌡㌢"
    + "".join(chr(c) for c in range(0x1F600, 0x1F620))
)


@pytest.fixture(scope="module")
def editor(session, eventually):
    """Mousepad with the focus in its text."""
    session.launch("mousepad", title="Mousepad")
    session.click_on("//application[@name='mousepad']//text")
    eventually(
        "the focus",
        lambda: session.shown("//application[@name='mousepad']//text[@*[local-name()='focused']]"),
    )
    return session


def content(session):
    return session.tree().xpath("//application[@name='mousepad']//text")[0].text or ""


def frame(session):
    """The screen's bytes as they are now."""
    return np.frombuffer(session.client.get("/ah/frame").content, np.uint8)


def clear(session):
    session.input({"type": "hotkey", "keys": ["ctrl", "a"]}, {"type": "key", "key": "delete"})


@pytest.mark.parametrize(
    "text", [ASCII, MIXED, MANY, "a\tb\nc\r\nd", "<" * 50, "x" * 700 + "é" + "y" * 700]
)
def test_text_is_typed_exactly(editor, eventually, text):
    clear(editor)
    eventually("an empty text", lambda: content(editor) == "")
    editor.input({"type": "type", "text": text})
    eventually(repr(text[:80]), lambda: content(editor) == text.replace("\r\n", "\n"))


def test_caps_lock_changes_nothing_and_stays_on(editor, eventually):
    clear(editor)
    editor.input(
        {"type": "key", "key": "capslock"},
        {"type": "type", "text": "Abc é 1!"},
        {"type": "key", "key": "z"},
    )
    eventually("exact text and then a capital", lambda: content(editor) == "Abc é 1!Z")
    editor.input({"type": "key", "key": "capslock"}, {"type": "key", "key": "z"})
    eventually("a small letter", lambda: content(editor) == "Abc é 1!Zz")


def test_other_layout_types_the_same(editor, eventually):
    needs.apps("setxkbmap")
    clear(editor)
    try:
        assert editor.execute(["setxkbmap", "de"])["returncode"] == 0
        editor.input({"type": "type", "text": "zyäß<>@{}€ ö"})
        eventually("the same text on a German keyboard", lambda: content(editor) == "zyäß<>@{}€ ö")
    finally:
        editor.execute(["setxkbmap", "us"])


def test_spare_keys_are_given_back(editor):
    needs.apps("xmodmap")
    before = editor.execute("xmodmap -pke")
    editor.input({"type": "type", "text": MIXED})
    assert editor.execute("xmodmap -pke")["output"] == before["output"]


def test_held_shift_stays_held(editor, eventually):
    clear(editor)
    editor.input(
        {"type": "type", "text": "abc"},
        {"type": "key_down", "key": "shift"},
        {"type": "key", "key": "left"},
        {"type": "key", "key": "left"},
        {"type": "key_up", "key": "shift"},
        {"type": "type", "text": "X"},
    )
    eventually("the selection replaced", lambda: content(editor) == "aX")


@pytest.mark.parametrize(
    ("events", "message"),
    [
        ([{"type": "type", "text": "x" * 10_000_000}], "more than 100000"),
        ([{"type": "type", "text": "a\x00"}], r"no key types '\x00'"),
        ([{"type": "type", "text": "\ud800"}], "no key types"),
        ([{"type": "type", "text": 5}], "must be a text"),
        ([{"type": "key", "key": "entr"}], "no key 'entr'"),
        ([{"type": "move", "x": 1}], "y must be a number"),
        ([{"type": "move", "x": float("nan"), "y": 1}], "x must be a number"),
        ([{"type": "click", "button": "fourth"}], "no mouse button 'fourth'"),
        ([{"type": "scroll", "amount": 1e9}], "amount"),
        ([{"type": "dance"}], "type must be one of move, click"),
        (["click"], "type must be one of"),
        ({"type": "click"}, "must be a list"),
        ([{"type": "move", "x": 1, "y": 1}] * 1001, "at most 1000"),
    ],
)
def test_bad_events_are_refused(editor, events, message):
    import json

    headers = {"Content-Type": "application/json"}
    answer = editor.client.post(
        "/ah/input", content=json.dumps({"events": events}), headers=headers
    )
    assert answer.status_code == 400
    assert message in answer.json()["message"]


def test_nothing_stays_pressed_after_an_error(editor, eventually):
    clear(editor)
    events = [
        {"type": "key_down", "key": "shift"},
        {"type": "down", "button": "left"},
        {"type": "key", "key": "nonsense"},
    ]
    answer = editor.client.post("/ah/input", json={"events": events})
    assert answer.json()["message"].startswith("events[2]: there is no key 'nonsense'")
    editor.click_on("//application[@name='mousepad']//text")
    editor.input({"type": "key", "key": "a"})
    eventually("a small letter", lambda: content(editor) == "a")


def test_hotkey_with_a_wrong_key_releases_the_others(editor, eventually):
    clear(editor)
    answer = editor.client.post(
        "/ah/input", json={"events": [{"type": "hotkey", "keys": ["ctrl", "alt", "nonsense"]}]}
    )
    assert answer.status_code == 400
    editor.input({"type": "key", "key": "b"})
    eventually("a plain letter", lambda: content(editor) == "b")


def test_clicks_drags_and_scrolls_reach_the_application(editor, eventually):
    clear(editor)
    editor.input({"type": "type", "text": "one two three"}, {"type": "key", "key": "home"})
    eventually("the words", lambda: content(editor) == "one two three")
    still(lambda: frame(editor))  # and they are drawn: before that a click finds no word
    node = editor.shown("//application[@name='mousepad']//text")[0]
    x, y = (
        int(v)
        for v in node.get("{https://accessibility.ubuntu.example.org/ns/component}screencoord")[
            1:-1
        ].split(",")
    )
    editor.input(
        {"type": "click", "x": x + 12, "y": y + 10, "clicks": 2}, {"type": "type", "text": "1"}
    )
    eventually(
        "the first word replaced by a double click", lambda: content(editor) == "1 two three"
    )
    editor.input(
        {"type": "drag", "x": x + 2, "y": y + 10, "x2": x + 400, "y2": y + 10},
        {"type": "key", "key": "delete"},
    )
    eventually("all dragged over and deleted", lambda: content(editor) == "")
    editor.input(
        {"type": "type", "text": "\n".join(str(i) for i in range(120))},
        {"type": "scroll", "x": x + 9, "y": y + 9, "amount": -5},
    )
    bars = "//application[@name='mousepad']//scroll-bar[@*[local-name()='vertical']]"
    value = "{https://accessibility.ubuntu.example.org/ns/value}value"
    bottom = float(eventually("a scroll bar", lambda: editor.shown(bars))[0].get(value))
    editor.input({"type": "scroll", "x": x + 9, "y": y + 9, "amount": 10})
    eventually("scrolled up", lambda: float(editor.shown(bars)[0].get(value)) < bottom)


def test_points_beside_the_screen_are_moved_onto_it(session):
    width, _ = session.screen
    session.input({"type": "move", "x": 99_999, "y": -5})
    assert session.client.get("/cursor_position").json() == [width - 1, 0]


# pyautogui in the desktop


def code(session, text):
    return session.execute(
        ["python", "-c", f"import pyautogui; import time; pyautogui.FAILSAFE = False; {text}"]
    )


def test_pyautogui_types_what_the_real_one_does_not(editor, eventually):
    clear(editor)
    result = code(
        editor,
        f"pyautogui.PAUSE = 0; pyautogui.write({MIXED!r}); pyautogui.press('enter');"
        " pyautogui.press(['a', '<', 'é'])",
    )
    assert result["returncode"] == 0, result
    eventually("the text", lambda: content(editor) == MIXED + "\na<é")


def test_pyautogui_hotkeys_and_hold(editor, eventually):
    clear(editor)
    result = code(
        editor,
        "pyautogui.PAUSE = 0; pyautogui.write('abc'); pyautogui.hotkey('ctrl', 'a');"
        " pyautogui.hotkey(['ctrl', 'c']);pyautogui.press('right'); pyautogui.hotkey('Ctrl', 'v');"
        " pyautogui.typewrite(['left', 'backspace', 'X'])",
    )
    assert result["returncode"] == 0, result
    eventually("copied and pasted", lambda: content(editor) == "abcaXc")
    text = (
        "\nwith pyautogui.hold('shift'):\n    pyautogui.press(['left',"
        " 'left'])\npyautogui.press('z')"
    )
    assert code(editor, text)["returncode"] == 0
    eventually("two letters replaced", lambda: content(editor) == "abczc")


def test_pyautogui_mouse(session):
    printed = code(
        session,
        "pyautogui.PAUSE = 0; pyautogui.moveTo(100, 120); pyautogui.moveRel(5, -5);"
        " print(tuple(pyautogui.position()));pyautogui.moveTo((30, 40), duration=0.3,"
        " tween=pyautogui.easeInOutQuad); print(pyautogui.position().x);pyautogui.move(10, 0);"
        " pyautogui.dragTo(60, 70, button='left'); pyautogui.drag(1, 1,"
        " 0.2);print(tuple(pyautogui.position()), tuple(pyautogui.size()), pyautogui.onScreen(5,"
        " 5),pyautogui.onScreen(-1, 5));pyautogui.scroll(3); pyautogui.hscroll(-2, 50, 50);"
        " pyautogui.rightClick(700, 500); pyautogui.press('esc');pyautogui.mouseDown(x=9, y=9);"
        " pyautogui.mouseUp(); pyautogui.middleClick();pyautogui.tripleClick(x=640, y=300)",
    )
    assert printed["error"] == ""
    width, height = session.screen
    assert printed["output"].splitlines() == [
        "(105, 115)",
        "30",
        f"(61, 71) ({width}, {height}) True False",
    ]
    assert session.client.get("/cursor_position").json() == [640, 300]


def test_pyautogui_says_what_it_lacks(session):
    missing = code(session, "pyautogui.locateOnScreen('button.png')")
    assert missing["returncode"] == 1
    assert "AttributeError: this desktop's pyautogui has no 'locateOnScreen'" in missing["error"]
    unknown = code(session, "pyautogui.press('nonsense')")
    assert unknown["returncode"] == 0
    assert "there is no key 'nonsense'" in unknown["error"]
    wrong = code(session, "pyautogui.click(1, 1, button='fourth')")
    assert "PyAutoGUIException: there is no mouse button 'fourth'" in wrong["error"]
    safe = session.execute(
        ["python", "-c", "import pyautogui; pyautogui.moveTo(0, 0); pyautogui.click()"]
    )
    assert "FailSafeException" in safe["error"]


def test_pyautogui_has_the_names_agents_use(session):
    names = (
        "click doubleClick tripleClick rightClick middleClick leftClick moveTo moveRel move dragTo"
        " dragRel drag mouseUp mouseDown scroll hscroll vscroll write typewrite press keyDown keyUp"
        " hotkey shortcut hold size resolution position onScreen screenshot sleep PAUSE FAILSAFE"
        " FAILSAFE_POINTS KEYBOARD_KEYS KEY_NAMES MINIMUM_DURATION MINIMUM_SLEEP linear easeInQuad"
        " easeOutQuad easeInOutBounce easeOutElastic PyAutoGUIException FailSafeException"
        " ImageNotFoundException isValidKey LEFT PRIMARY Point Size failSafeCheck"
    )
    printed = session.execute(
        [
            "python",
            "-c",
            (
                f"import pyautogui\nprint([n for n in {names.split()!r} if not hasattr(pyautogui,"
                " n)])\nprint(len(pyautogui.KEYBOARD_KEYS), [k for k in pyautogui.KEYBOARD_KEYS if"
                " not isinstance(k, str)])\nimport inspect;"
                " print(inspect.signature(pyautogui.click))"
            ),
        ]
    )
    lines = printed["output"].splitlines()
    assert lines[0] == "[]"
    assert lines[1].startswith("194 ")
    assert lines[2].startswith(
        "(x=None, y=None, clicks=1, interval=0.0, button='primary', duration=0.0"
    )


def test_wrappers_work_from_a_shell_too(session):
    result = session.execute(
        "for p in python python3 google-chrome; do command -v $p; done;"
        "python3 -c 'import pyautogui; print(pyautogui.__file__)'"
    )
    tools = session.folder / "tools"
    assert result["output"].splitlines()[:3] == [
        str(tools / "bin" / name) for name in ("python", "python3", "google-chrome")
    ]
    assert result["output"].splitlines()[3].endswith("shim/pyautogui.py")
