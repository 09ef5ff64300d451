"""Touch on a real desktop: the plan's element, launchers left out, elements that move, nothing to
touch, sabotage."""

import pytest

from hijack_data.errors import PlanError
from hijack_data.plan import Effect
from hijack_data.rng import Stream
from online_env.effects import EffectError, accidental_touch, perform
from online_env.effects import guest as guest_module

from support.effects import Liar, Meddler, Plain, applied, browser_to_front, open_apps
from support.waiting import still
from support.waiting import until as wait

LAUNCHERS = {"File Manager", "Web Browser", "Terminal", "Text Editor"}  # of the panel
pytestmark = pytest.mark.usefixtures("browser_machine")


@pytest.fixture(scope="module")
def desktop(embedded_desktop):
    return open_apps(embedded_desktop)


@pytest.fixture
def stream():
    return Stream(7, "effects-tests")


def home_page(desktop):
    browser_to_front(desktop)
    desktop.run("pyautogui.press('esc'); pyautogui.hotkey('ctrl', 'l')")
    desktop.run("pyautogui.write('search.test'); pyautogui.press('enter')")
    wait(lambda: "Encyclopedia" in desktop.accessibility())
    still(desktop.screenshot)


def test_touch_clicks_what_the_plan_says(desktop, stream):
    from hijack_data.elements import boxes_from_tree

    home_page(desktop)
    result = boxes_from_tree(desktop.accessibility(), desktop.size)
    box = next(
        b
        for b, name in zip(result.boxes.tolist(), result.names, strict=True)
        if name == "Encyclopedia"
    )
    value = perform(
        Effect("touch", {"boxes": [[3, 3, 4, 4], box], "without_app": True}), desktop, stream
    )
    probe = value.probe()
    assert probe.ok, probe
    clicked = value.record["did"]["clicked"]
    assert clicked["element"]["app"] == "Google Chrome"
    assert (
        clicked["point"]
        == [(box[0] + box[2]) // 2, (box[1] + box[3]) // 2]
        == probe.facts["pointer"]
    )
    wait(lambda: "Openfolio" in desktop.execute(["wmctrl", "-l"]).output)
    assert value.undo().facts == {"undone": False, "why": "a click cannot be taken back"}


def test_touch_draws_from_the_stream_alike_and_leaves_launchers_out(desktop, monkeypatch):
    monkeypatch.setattr("online_env.effects.accidental_touch.MAX_CLICKS", 1)
    home_page(desktop)
    # A click that is only claimed, so that the page stays as it is.
    idle = Liar(desktop, click={"moved": False, "pointer": [0, 0], "delivered": True})
    element_names = [
        perform(Effect("touch", {}), idle, Stream(seed, "t")).record["did"]["attempts"]
        for seed in (3, 3, 5, 8)
    ]
    names = [attempts[0]["element"]["name"] for attempts in element_names]
    assert names[0] == names[1]
    assert len(set(names)) > 1
    assert not {a["element"]["name"] for attempts in element_names for a in attempts} & LAUNCHERS


def test_touch_may_take_launchers(desktop, stream):
    home_page(desktop)
    from hijack_data.elements import boxes_from_tree

    result = boxes_from_tree(desktop.accessibility(), desktop.size)
    box = next(
        b
        for b, name in zip(result.boxes.tolist(), result.names, strict=True)
        if name == "Text Editor"
    )
    left_out = perform(
        Effect("touch", {"boxes": [box], "without_app": True}), desktop, stream
    ).record["did"]
    assert all(attempt["element"]["name"] not in LAUNCHERS for attempt in left_out["attempts"])
    desktop.run("pyautogui.press('esc'); pyautogui.press('esc')")
    value = perform(Effect("touch", {"boxes": [box], "without_app": False}), desktop, stream)
    assert value.probe().ok
    assert value.record["did"]["clicked"]["element"]["name"] == "Text Editor"


def test_sabotaged_touch_is_found_out(desktop, stream, monkeypatch):
    monkeypatch.setattr("online_env.effects.accidental_touch.MAX_CLICKS", 2)
    home_page(desktop)
    desktop.run("pyautogui.moveTo(1500, 700)")
    # The pointer never goes to the element: the click is somewhere else.
    result = perform(Effect("touch", {}), Liar(desktop, move={"pointer": [0, 0]}), stream).probe()
    assert not result.ok
    assert "the pointer is at [1500, 700]" in result.problem
    # The button is never pressed.
    source = guest_module._source("xtool")
    idle = source.replace("xtest.fake_input(screen.display, kind, 1)", "pass")
    assert idle != source
    monkeypatch.setattr(guest_module, "_source", lambda name: idle)
    result = perform(Effect("touch", {}), Plain(desktop), stream).probe()
    assert not result.ok
    assert "did not see the button" in result.problem


def test_touch_notices_an_element_that_moves(desktop, stream, monkeypatch):
    monkeypatch.setattr("online_env.effects.accidental_touch.MAX_CLICKS", 3)
    home_page(desktop)
    desktop.execute(
        "xdotool search --class mousepad windowminimize %@; wmctrl -a Chromium; sleep 0.3"
    )
    desktop.execute("wmctrl -r Chromium -b remove,maximized_vert,maximized_horz; sleep 0.5")
    step = iter(range(100))

    def shift(real):
        real.execute(f"wmctrl -r Chromium -e 0,{40 + 30 * next(step)},60,1200,800; sleep 0.3")

    try:
        result = perform(Effect("touch", {}), Meddler(desktop, shift), stream)
        attempts = result.record["did"]["attempts"]
        assert [attempt["moved"] for attempt in attempts] == [True] * 3 + [False]
        # What is clicked is the place of the last one, and no element is claimed to be reached.
        assert (attempts[3]["point"], attempts[3]["element"]) == (attempts[2]["point"], None)
        assert result.probe().ok
    finally:
        desktop.execute(
            "wmctrl -r Chromium -b add,maximized_vert,maximized_horz; wmctrl -a Mousepad"
        )


def test_on_a_bare_desktop_a_touch_reaches_what_launches_nothing(desktop):
    for seed in range(4):
        with applied(Effect("minimise"), desktop):
            still(desktop.screenshot)
            result = perform(Effect("touch"), desktop, Stream(seed, "t"))
            probe = result.probe()
            assert probe.ok, probe
            element = result.record["did"]["clicked"]["element"]
            # A menu of the panel, the clock or the button of a window.
            assert element["app"] == "xfce4-panel"
            assert element["name"] not in LAUNCHERS
            desktop.run("pyautogui.press('esc'); pyautogui.press('esc')")


def test_where_only_launchers_are_left_one_is_touched(desktop, stream, monkeypatch):
    real = accidental_touch.live_elements
    monkeypatch.setattr(
        accidental_touch,
        "live_elements",
        lambda *given: [e for e in real(*given) if e.name == "Text Editor"],
    )
    still(desktop.screenshot)
    result = perform(Effect("touch"), desktop, stream)
    assert result.probe().ok
    names = [(attempt["element"] or {}).get("name") for attempt in result.record["did"]["attempts"]]
    assert names == ["Text Editor"], result.record


def test_a_screen_without_any_element_is_touched_somewhere(desktop, monkeypatch):
    monkeypatch.setattr(accidental_touch, "live_elements", lambda *given: [])
    points = set()
    for seed in (1, 1, 2):
        result = perform(Effect("touch"), desktop, Stream(seed, "t"))
        assert result.probe().ok
        assert result.record["did"]["clicked"]["element"] is None
        points.add(tuple(result.record["did"]["clicked"]["point"]))
    assert len(points) == 2


@pytest.mark.parametrize("bad", [[[1, 2, 3]], "x", [[5, 5, 1, 1]]])
def test_touch_refuses_boxes_that_are_none(desktop, bad):
    with pytest.raises(EffectError, match="touch: "):
        perform(Effect("touch", {"boxes": bad}), desktop)


def test_an_effect_holds_numbers_that_json_has():
    with pytest.raises(PlanError, match=r"boxes\[0\]\[0\] is nan"):
        Effect("touch", {"boxes": [[float("nan")] * 4]})
