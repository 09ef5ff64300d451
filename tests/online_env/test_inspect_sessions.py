"""Episodes in Inspect one by one: the tool's actions and notes, pictures, free desktops."""

import base64
import io
from contextlib import contextmanager
from types import SimpleNamespace

import anyio
import numpy as np
import pytest
from PIL import Image

pytest.importorskip("gymnasium", reason="needs the extra [online]")
pytest.importorskip("lxml", reason="needs the extra [online]")
pytest.importorskip("inspect_ai", reason="needs the extra [inspect]")

from inspect_ai.model import ChatMessageAssistant, ChatMessageTool, ChatMessageUser
from inspect_ai.tool import ToolCall

from hijack_data.errors import HijackError
from online_env.bench.config import Bench
from online_env.errors import DesktopError
from online_env.inspect.scoring import gives_up, was_cut_off
from online_env.inspect.sessions import Session, Sessions
from online_env.inspect.tool import FWXGA, OVER, computer_tool, native_display_size

from support.squares import SIZE, SquareDesktop, register_square

pytestmark = [pytest.mark.usefixtures("no_waiting"), pytest.mark.filterwarnings("ignore")]
BENCH = Bench(
    provider="squares", size=SIZE, tasks=("square",), corruptions={"clean": None}, max_steps=3
)


@pytest.fixture
def session_desktops(monkeypatch):
    """The desktops that were started."""
    desktops = []

    @contextmanager
    def provider(size):
        desktops.append(SquareDesktop(size))
        yield desktops[-1]

    register_square(monkeypatch, provider)
    return desktops


@pytest.fixture
def session(session_desktops):
    result = Session(BENCH, "model", None)
    result.begin("square", "clean", 0)
    yield result
    result.close()


def use_computer(session, **call):
    """The notes and the picture that the tool returns."""
    tool = computer_tool(lambda: session, 3)

    async def take():
        return await tool(**call)

    *notes, image = anyio.run(take)
    return [note.text for note in notes], pixels(image.image)


def pixels(address):
    content = base64.b64decode(address.partition("base64,")[2])
    return np.asarray(Image.open(io.BytesIO(content)))


def ran(session_desktops):
    return [code.strip() for code in session_desktops[0].ran]


# The tool


def test_what_comes_after_the_end_of_an_episode_is_not_done_and_the_model_is_told(
    session, session_desktops
):
    calls = [{"action": "key", "text": name} for name in "abcde"]
    notes, picture = use_computer(session, actions=calls)
    assert ran(session_desktops) == [f"pyautogui.press('{name}')" for name in "abc"]
    assert notes == [OVER]
    assert picture.shape == (*SIZE, 3)
    notes, _ = use_computer(session, action="key", text="f")
    assert (len(session_desktops[0].ran), notes) == (3, [OVER])
    assert session.record["ended"] == "max_steps"


def test_an_action_that_is_not_understood_does_not_stop_the_others(session, session_desktops):
    calls = [
        {"action": "left_click", "coordinate": [5]},
        {"action": "zoom", "region": [1, 2, 3]},
        {"action": "key", "text": "b"},
    ]
    notes, _ = use_computer(session, actions=calls)
    assert ran(session_desktops) == ["pyautogui.press('b')"]
    assert len(notes) == 2
    assert all(note.startswith("This action was not understood: ") for note in notes)


@pytest.mark.parametrize(
    ("call", "code"),
    [
        ({"action": "key", "text": "Tab", "repeat": 3}, "\n".join(["pyautogui.press('tab')"] * 3)),
        ({"action": "type", "text": "a", "press_enter": True}, "pyautogui.write('a\\n')"),
        ({"action": "forward_click"}, "pyautogui.hotkey('alt', 'right')"),
        (
            {
                "action": "scroll",
                "coordinate": [3, 4],
                "scroll_direction": "up",
                "scroll_amount": 2,
            },
            "pyautogui.scroll(2, 3, 4)",
        ),
    ],
)
def test_what_the_tool_takes_beside_place_and_text(session, session_desktops, call, code):
    notes, _ = use_computer(session, **call)
    assert (ran(session_desktops), notes) == ([code], [])


def test_looking_is_no_step(session, session_desktops):
    session_desktops[0].place = (0, 0)
    before = pixels(session.picture())
    notes, zoomed = use_computer(
        session, action="zoom", region=[-50, -50, 2 * SIZE[1], 2 * SIZE[0]]
    )
    assert notes == []
    assert np.array_equal(zoomed, before), "what is outside the screen is left away"
    assert session.record is None
    assert session_desktops[0].ran == []


def test_a_region_of_another_form_keeps_its_form(session):
    wide = pixels(session.picture((0, 0, SIZE[1], SIZE[0] // 4)))
    assert wide.shape == (*SIZE, 3)
    quarter = SIZE[0] // 4
    assert wide[:quarter].any(axis=-1).all()
    assert not wide[quarter:].any(), "the rest of the room is black"


# Episodes


def test_what_is_called_before_the_episode_says_so(session_desktops):
    result = Session(BENCH, "model", None)
    for call in (
        lambda: result.act("DONE"),
        lambda: result.record_message("x"),
        lambda: result.cut_off("x"),
    ):
        with pytest.raises(HijackError, match=r"^the episode has not begun: call begin first$"):
            call()
    assert result.record is None
    result.close()
    assert session_desktops == []


def test_a_desktop_is_free_again_when_its_episode_could_not_begin(session_desktops):
    sessions = Sessions(1)
    order = []

    def begins(name, fails):
        def begin():
            order.append(name)
            value = open_sessions[name]
            value.begin("square", "clean", 0)
            if fails:
                raise DesktopError("no luck")

        return begin

    open_sessions = {name: Session(BENCH, "model", None) for name in "ab"}

    async def go():
        with anyio.fail_after(20):
            with pytest.raises(DesktopError, match="no luck"):
                await sessions.open("a", open_sessions["a"], begins("a", True))
            await sessions.open("b", open_sessions["b"], begins("b", False))
            assert sessions["b"] is open_sessions["b"]
            await sessions.close("b")
            await sessions.close("b")  # it has none any more
            await sessions.close("never opened")

    anyio.run(go)
    assert order == ["a", "b"]
    assert [desktop.closed for desktop in session_desktops] == [True, True]
    with pytest.raises(KeyError):
        sessions["a"]


def test_closing_more_often_than_opening_makes_no_more_desktops(session_desktops):
    sessions = Sessions(1)

    async def go():
        for _ in range(3):
            await sessions.close("nobody")
        await sessions.open("a", Session(BENCH, "model", None), lambda: None)
        with anyio.move_on_after(0.2) as scope:
            await sessions.open("b", Session(BENCH, "model", None), lambda: None)
        assert scope.cancelled_caught, "the only desktop is taken"

    anyio.run(go)


CALL = ToolCall(id="1", function="computer", arguments={})
SUBMIT = ToolCall(id="2", function="submit", arguments={})


@pytest.mark.parametrize(
    ("last", "cut"),
    [
        (None, True),
        (ChatMessageUser(content="go on"), True),
        (ChatMessageTool(content="", function="computer"), True),
        (ChatMessageTool(content="DONE", function="submit"), False),
        (ChatMessageAssistant(content="", tool_calls=[CALL]), True),
        (ChatMessageAssistant(content="", tool_calls=[SUBMIT, CALL]), True),
        (ChatMessageAssistant(content="", tool_calls=[SUBMIT]), False),
        (ChatMessageAssistant(content="It is done."), False),
    ],
)
def test_a_model_was_cut_off_if_the_last_message_is_no_answer(last, cut):
    messages = [ChatMessageUser(content="do it")] * (last is not None)
    state = SimpleNamespace(messages=[*messages, last] if last is not None else [])
    assert was_cut_off(state) is cut


@pytest.mark.parametrize(
    ("toolset", "name", "size"),
    [
        (lambda: True, "claude-opus-5-5", None),
        (lambda: False, "claude-opus-4-6", FWXGA),
        (None, "gemini-2.5-computer-use-preview-10-2025", FWXGA),
        (None, "google/gemini-3-flash-preview", FWXGA),
        (None, "gemini-2.5-pro", None),
        (None, "gpt-5.4", None),
    ],
)
def test_only_models_that_are_told_a_display_see_pictures_of_its_size(toolset, name, size):
    assert native_display_size(SimpleNamespace(computer_use_toolset=toolset), name) == size


@pytest.mark.parametrize(
    ("answer", "does"),
    [
        ("FAIL", True),
        ("**FAIL**", True),
        ("`FAIL`: no such square", True),
        (" fail.\n", True),
        ("Fail: there is no such file", True),
        ("Failing tests are fixed now", False),
        ("Fail-safe mode is on", False),
        ("Done, nothing failed", False),
        ("", False),
    ],
)
def test_only_the_word_fail_gives_up(answer, does):
    assert gives_up(answer) == does
