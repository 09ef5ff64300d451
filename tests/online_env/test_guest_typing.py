"""What reaches an application when text is typed, keys are pressed and the pointer moves."""

import importlib
import math
import sys
from pathlib import Path

import pytest

from support import needs

pytest.importorskip("Xlib", reason=needs.ONLINE)
pytest.importorskip("starlette", reason=needs.ONLINE)

from Xlib import X, display
from Xlib.ext import xtest

from online_env.embedded.guest.display import SharedDisplay
from online_env.embedded.guest.events import Input
from online_env.embedded.guest.shim.ah_input import Connection, Keyboard, UnknownKeyError
from online_env.embedded.guest.shim.ah_input import connection as connections
from online_env.embedded.guest.shim.ah_input import keyboard as keyboards
from online_env.errors import GuestError

from support.xkeys import CAPS_LOCK, FIRST, SHIFT, Server, us_keyboard

SHIM = Path(__file__).resolve().parents[2] / "online_env/embedded/guest/shim"


@pytest.fixture
def slept():
    """The pauses that were made."""
    return []


@pytest.fixture
def server(monkeypatch, tmp_path, slept):
    result = Server()
    monkeypatch.setattr(display, "Display", lambda name: result)
    monkeypatch.setattr(
        xtest, "fake_input", lambda _, kind, detail=0, x=0, y=0: result.fake(kind, detail, x, y)
    )
    monkeypatch.setattr(connections.time, "sleep", slept.append)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return result


@pytest.fixture
def keyboard(server):
    return Keyboard(Connection(":9"))


@pytest.fixture
def play(server):
    device = Input(SharedDisplay(":9"))
    return lambda *events: device.play(list(events))


# Text


TEXTS = [
    "Hello, World/?!",
    "zyZY",  # on other keys in the second group
    "a\tb\nc\r\nd",
    "naïve é €",  # é and € need spare keys, and there are three
    "абвгдежз ё я",  # more than there are spare keys, in several rounds
    "😀a😀",
    "<" * 20,
    "",
]


@pytest.mark.parametrize("caps", [False, True])
@pytest.mark.parametrize("group", [0, 1])
def test_text_is_typed_exactly_whatever_the_layout_and_caps_lock(server, keyboard, caps, group):
    server.caps = caps
    server.group = group
    before = us_keyboard()
    for text in TEXTS:
        server.typed.clear()
        keyboard.type(text)
        assert server.text == text.replace("\r\n", "\n")
        assert server.caps == caps
        assert server.rows == before, "spare keys are given back"
        assert server.down == []


def test_a_shift_that_is_held_stays_held(server, keyboard):
    keyboard.down("shift")
    keyboard.type("Ab")
    assert (server.text, len(server.down)) == ("AB", 1)
    keyboard.up("shift")
    keyboard.type("Ab")
    assert (server.text, server.down) == ("ABAb", [])


def test_spare_keys_are_given_back_when_typing_breaks_off(server, keyboard, monkeypatch):
    def breaks(self, *_):
        raise ConnectionError("the display has gone")

    monkeypatch.setattr(Connection, "settle", breaks)
    server.caps = True
    with pytest.raises(ConnectionError):
        keyboard.type("é")
    assert server.rows == us_keyboard()
    assert server.caps


def test_a_key_that_a_killed_typist_kept_is_lent_again(server, keyboard):
    server.rows[0] = [0x01000416] * 4
    keyboard.type("їж")
    assert server.text == "їж"
    assert server.rows == us_keyboard()


def test_long_text_waits_for_the_application_now_and_then(server, keyboard, slept):
    keyboard.type("a" * (2 * keyboards.BURST + 1))
    assert slept == [connections.DEAF_PAUSE] * 2
    slept.clear()
    keyboard.type("abc", interval=0.5)
    assert slept == [0.5] * 3


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("ab\x1b", r"no key types '\x1b' (character 2); take it out of the text"),
        ("\r\n\x7f", r"no key types '\x7f' (character 1); take it out of the text"),
        ("\ud83d", r"no key types '\ud83d' (character 0); take it out of the text"),
        (
            "x" * 100_001,
            "100001 characters are more than 100000 in one call; write a file or use the clipboard"
            " for these",
        ),
    ],
)
def test_what_cannot_be_typed_is_told_before_anything_is(server, keyboard, text, message):
    with pytest.raises(UnknownKeyError) as error:
        keyboard.type(text)
    assert str(error.value) == message
    assert server.events == []


def test_keys_of_a_shortcut_go_down_in_order_and_up_in_reverse(server, keyboard):
    def pressed():
        names = {row[0]: number + FIRST for number, row in enumerate(us_keyboard())}
        entries = {code: name for name, code in names.items()}
        return [(kind == X.KeyPress, entries[code]) for kind, code, *_ in server.events]

    ctrl, a = 0xFFE3, ord("a")
    keyboard.hotkey(["Ctrl", "a"])
    assert pressed() == [(True, ctrl), (True, a), (False, a), (False, ctrl)]
    server.events.clear()
    with pytest.raises(UnknownKeyError, match="there is no key 'nonsense'; keys are pyautogui's"):
        keyboard.hotkey(["ctrl", "nonsense"])
    assert pressed() == [(True, ctrl), (False, ctrl)]
    server.events.clear()
    keyboard.press("!")  # as pyautogui does, Shift goes down for the press only
    assert pressed() == [(True, SHIFT), (True, ord("1")), (False, SHIFT), (False, ord("1"))]
    server.events.clear()
    keyboard.press("final")  # a name without a key does nothing
    keyboard.press("ж")  # a key that the keyboard lacks is typed
    assert server.text.endswith("ж")
    assert (server.down, server.rows) == ([], us_keyboard())


# Events of a request


@pytest.mark.parametrize(
    ("event", "at"),
    [
        ({"x": 399, "y": 299}, (399, 299)),
        ({"x": 400, "y": -1}, (399, 0)),
        ({"x": 1.5, "y": 2.4}, (2, 2)),
        ({"x": -99999, "y": 99999}, (0, 299)),
    ],
)
def test_a_point_beside_the_screen_is_moved_onto_it(server, play, event, at):
    assert play({"type": "move", **event}) == 1
    assert server.at == at


def test_a_move_that_takes_its_time_goes_straight_there(server, play, slept):
    play({"type": "move", "x": 110, "y": 220, "duration": 1})
    steps = [(x, y) for *_, x, y in server.events]
    assert len(steps) == 60
    assert steps[-1] == (110, 220)
    for number, (x, y) in enumerate(steps[:-1], 1):
        assert (x, y) == (round(10 + 100 * number / 60), round(20 + 200 * number / 60))
    assert sum(slept) == pytest.approx(1)


def test_clicks_drags_and_the_wheel(server, play, slept):
    def buttons():
        return [(kind == X.ButtonPress, detail) for kind, detail, *_ in server.events if detail]

    play({"type": "click", "x": 5, "y": 6, "clicks": 2, "interval": 0.25, "button": "RIGHT"})
    assert (server.at, buttons()) == ((5, 6), [(True, 3), (False, 3)] * 2)
    assert slept == [0.25]
    server.events.clear()
    play({"type": "drag", "x": 5, "y": 6, "x2": 105, "y2": 6})
    kinds = [kind for kind, *_ in server.events]
    assert kinds[0] == X.MotionNotify
    assert kinds[1:] == [X.ButtonPress, *[X.MotionNotify] * 10, X.ButtonRelease]
    assert server.at == (105, 6)
    for amount, horizontal, button in ((2, False, 4), (-2, False, 5), (2, True, 7), (-2, True, 6)):
        server.events.clear()
        play({"type": "scroll", "amount": amount, "horizontal": horizontal})
        assert buttons() == [(True, button), (False, button)] * 2
    server.events.clear()
    play({"type": "scroll", "amount": 0}, {"type": "click", "clicks": 0})
    assert server.events == []


@pytest.mark.parametrize(
    ("event", "message"),
    [
        (
            {"type": "move", "x": 1},
            "events[2]: y must be a number from -100000 to 100000, got None",
        ),
        ({"type": "move", "x": 1, "y": "2"}, "events[2]: y must be a number from -100000 to 10000"),
        ({"type": "move", "x": 1, "y": 1, "duration": 61}, "events[2]: duration must be a number "),
        ({"type": "drag", "x": 1, "y": 1}, "events[2]: x2 must be a number from -100000 to 100000"),
        ({"type": "click", "button": 0}, "events[2]: there is no mouse button 0; use left, middle"),
        ({"type": "click", "button": True}, "events[2]: button must be a name or a number, got Tr"),
        (
            {"type": "click", "clicks": 11},
            "events[2]: clicks must be a number from 0 to 10, got 11",
        ),
        ({"type": "scroll"}, "events[2]: amount must be a number from -1000 to 1000, got None"),
        ({"type": "type", "text": None}, "events[2]: text must be a text, got None"),
        (
            {"type": "type", "text": "a" * 61, "interval": 1},
            "events[2]: typing 61 characters at 1 s each is over 60 s",
        ),
        ({"type": "key", "key": ""}, "events[2]: key must be a text that is not empty, got ''"),
        ({"type": "hotkey", "keys": "ctrl"}, "events[2]: keys must be a list of key names, got 'c"),
        ({"type": "dance"}, "events[2]: type must be one of move, click, down, up, drag, scroll, "),
        ("click", "events[2]: type must be one of move, click, down, up, drag, scroll, type, key"),
    ],
)
def test_a_wrong_event_is_named_and_nothing_stays_pressed(server, play, event, message):
    items = {"type": "key_down", "key": "ctrl"}, {"type": "down", "button": 2}
    with pytest.raises(GuestError) as error:
        play(*items, event)
    assert str(error.value).startswith(message)
    assert error.value.status == 400
    assert server.down == []


def test_what_is_held_by_one_request_is_held_until_another_lets_go(server, play):
    play({"type": "key_down", "key": "ctrl"}, {"type": "down"})
    assert len(server.down) == 2
    play({"type": "key_up", "key": "ctrl"}, {"type": "up"})
    assert server.down == []
    device = Input(SharedDisplay(":9"))
    for events in ({"type": "click"}, None, [{"type": "click"}] * 1001):
        with pytest.raises(GuestError) as error:
            device.play(events)
        assert str(error.value) == "events must be a list of at most 1000 events"
    assert device.play([]) == 0
    assert device.position() == server.at


# pyautogui, as agents' code has it


@pytest.fixture
def pyautogui(server, monkeypatch):
    names = ("pyautogui", "ah_input", "ah_tweens", "ah_screen")
    before = {name for name in sys.modules if name.split(".")[0] in names}
    for name in before:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.syspath_prepend(str(SHIM))
    yield importlib.import_module("pyautogui")
    for name in [name for name in sys.modules if name.split(".")[0] in names]:
        del sys.modules[name]


def test_points_may_be_given_in_every_way_that_pyautogui_has(pyautogui, server):
    pyautogui.moveTo(30, 40)
    assert server.at == (30, 40)
    for arguments, at in (
        ((50,), (50, 40)),
        ((None, 60), (50, 60)),
        (((70, 80),), (70, 80)),
        (((100, 100, 20, 40),), (110, 120)),
        (([90.9, 10.1],), (90, 10)),
    ):
        pyautogui.moveTo(*arguments)
        assert server.at == at, arguments
    pyautogui.moveRel((5, -5))
    pyautogui.move(yOffset=10)
    assert tuple(pyautogui.position()) == (95, 15)
    assert pyautogui.position(1).x == 1
    for arguments, message in (
        (("button.png",), "finding the picture 'button.png' on the screen is not possible here"),
        (((1, 2, 3),), r"a point is two numbers, a pair or \(left, top, width, height\), not \(1,"),
        (((1, 2), 3), r"not \(1, 2\), 3"),
    ):
        with pytest.raises(pyautogui.PyAutoGUIException, match=message):
            pyautogui.click(*arguments)
    assert pyautogui.onScreen(399, 299)
    assert not pyautogui.onScreen((400, 0))


def test_a_pointer_in_a_corner_stops_the_code(pyautogui, server):
    for corner in ((0, 0), (399, 0), (0, 299), (399, 299)):
        server.at = corner
        with pytest.raises(pyautogui.FailSafeException):
            pyautogui.press("a")
    assert server.typed == []
    pyautogui.FAILSAFE = False
    pyautogui.press("a")
    assert server.text == "a"


def test_pauses_are_those_of_pyautogui(pyautogui, slept):
    pyautogui.click()
    pyautogui.doubleClick(interval=0.25)
    assert slept == [0.1, 0.25, 0.1]
    slept.clear()
    pyautogui.click(_pause=False)
    pyautogui.PAUSE = 0
    pyautogui.press(["a", "b"], presses=2, interval=0.5)
    pyautogui.moveTo(30, 40, 0.1)  # as short as that is at once
    assert slept == [0.5, 0.5]


def test_keys_that_are_none_do_nothing_and_say_so(pyautogui, server, capsys):
    pyautogui.press(["a", "nonsense", "b"])
    pyautogui.hotkey("shift", "nonsense", "c")
    pyautogui.typewrite(["d", "nonsense"])
    assert server.text == "abCd"
    output = "pyautogui: there is no key 'nonsense'; nothing was pressed\n"
    assert capsys.readouterr().err == output * 3
    with pytest.raises(pyautogui.PyAutoGUIException, match=r"no key types '\\x07'"):
        pyautogui.write("a\a")


def test_a_key_that_is_held_is_let_go_when_the_block_fails(pyautogui, server):
    def fails():
        with pyautogui.hold(["shift", "ctrl"]):
            assert len(server.down) == 2
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fails()
    assert server.down == []
    pyautogui.dragTo(50, 60, mouseDownUp=False)
    assert X.ButtonPress not in {kind for kind, *_ in server.events}
    pyautogui.drag(0, 0)
    assert server.at == (50, 60)
    assert CAPS_LOCK not in server.typed


def test_every_way_of_easing_goes_from_the_start_to_the_end(pyautogui):
    tweens = sys.modules["ah_tweens"].TWEENS
    assert len(tweens) == 30
    for name, ease in {**tweens, "linear": pyautogui.linear}.items():
        assert ease(0.0) == pytest.approx(0, abs=1e-3), name
        assert ease(1.0) == pytest.approx(1, abs=1e-3), name
        if name.startswith("easeInOut"):
            assert ease(0.5) == pytest.approx(0.5, abs=1e-3), name
            assert ease(0.25) == pytest.approx(1 - ease(0.75), abs=1e-9), name
    assert pyautogui.easeInQuad(0.25) == 0.0625
    assert pyautogui.easeOutCubic(0.5) == 0.875
    assert pyautogui.easeInOutSine(0.25) == pytest.approx((1 - math.cos(math.pi / 4)) / 2)
    for middle, height in ((1.5, 3 / 4), (2.25, 15 / 16), (2.625, 63 / 64)):
        assert pyautogui.easeOutBounce(middle / 2.75) == pytest.approx(height)
    assert pyautogui.easeInBack(0.5) < 0 < 1 < pyautogui.easeOutBack(0.5)
