"""Touch on a real desktop: the plan's element, launchers left out, elements that move, nothing to
touch, sabotage."""

import numpy as np
import pytest

from hijack_data.errors import PlanError
from hijack_data.plan import Effect
from hijack_data.rng import Stream
from online_env.effects import EffectError, perform
from online_env.effects import guest as guest_module

from support.effects import Liar, Meddler, Plain, applied, browser_to_front, open_apps
from support.waiting import still
from support.waiting import until as wait

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
    found = boxes_from_tree(desktop.accessibility(), desktop.size)
    box = next(
        b
        for b, name in zip(found.boxes.tolist(), found.names, strict=True)
        if name == "Encyclopedia"
    )
    done = perform(
        Effect("touch", {"boxes": [[3, 3, 4, 4], box], "without_app": True}), desktop, stream
    )
    probe = done.probe()
    assert probe.ok, probe
    clicked = done.record["did"]["clicked"]
    assert clicked["element"]["app"] == "Google Chrome"
    assert (
        clicked["point"]
        == [(box[0] + box[2]) // 2, (box[1] + box[3]) // 2]
        == probe.facts["pointer"]
    )
    wait(lambda: "Openfolio" in desktop.execute(["wmctrl", "-l"]).output)
    assert done.undo().facts == {"undone": False, "why": "a click cannot be taken back"}


def test_touch_draws_from_the_stream_alike_and_leaves_launchers_out(desktop, monkeypatch):
    monkeypatch.setattr("online_env.effects.accidental_touch.MAX_CLICKS", 1)
    home_page(desktop)
    # A click that is only claimed, so that the page stays as it is.
    idle = Liar(desktop, click={"moved": False, "pointer": [0, 0], "delivered": True})
    drawn = [
        perform(Effect("touch", {}), idle, Stream(seed, "t")).record["did"]["attempts"]
        for seed in (3, 3, 5, 8)
    ]
    names = [attempts[0]["element"]["name"] for attempts in drawn]
    assert names[0] == names[1]
    assert len(set(names)) > 1
    assert {a["element"]["app"] for attempts in drawn for a in attempts} == {"Google Chrome"}


def test_touch_may_take_launchers(desktop, stream):
    home_page(desktop)
    from hijack_data.elements import boxes_from_tree

    found = boxes_from_tree(desktop.accessibility(), desktop.size)
    box = next(
        b
        for b, name in zip(found.boxes.tolist(), found.names, strict=True)
        if name == "Applications"
    )
    done = perform(Effect("touch", {"boxes": [box], "without_app": False}), desktop, stream)
    assert done.probe().ok
    assert done.record["did"]["clicked"]["element"]["app"] == "xfce4-panel"
    desktop.run("pyautogui.press('esc')")
    left_out = perform(
        Effect("touch", {"boxes": [box], "without_app": True}), desktop, stream
    ).record["did"]
    assert all(attempt["element"]["app"] != "xfce4-panel" for attempt in left_out["attempts"])


def test_sabotaged_touch_is_found_out(desktop, stream, monkeypatch):
    monkeypatch.setattr("online_env.effects.accidental_touch.MAX_CLICKS", 2)
    home_page(desktop)
    desktop.run("pyautogui.moveTo(1500, 700)")
    # The pointer never goes to the element: the click is somewhere else.
    found = perform(Effect("touch", {}), Liar(desktop, move={"pointer": [0, 0]}), stream).probe()
    assert not found.ok
    assert "nothing changed" in found.problem or "the pointer is at [1500, 700]" in found.problem
    # The button is never pressed.
    source = guest_module._source("xtool")
    idle = source.replace("xtest.fake_input(screen.display, kind, 1)", "pass")
    assert idle != source
    monkeypatch.setattr(guest_module, "_source", lambda name: idle)
    found = perform(Effect("touch", {}), Plain(desktop), stream).probe()
    assert not found.ok
    assert "nothing changed" in found.problem or "did not see the button" in found.problem


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
        done = perform(Effect("touch", {}), Meddler(desktop, shift), stream)
        assert [attempt["moved"] for attempt in done.record["did"]["attempts"]] == [True] * 3
        assert not done.probe().ok
    finally:
        desktop.execute(
            "wmctrl -r Chromium -b add,maximized_vert,maximized_horz; wmctrl -a Mousepad"
        )


def test_touch_with_nothing_to_touch(desktop, stream):
    with applied(Effect("minimise"), desktop):
        before = desktop.screenshot()
        found = perform(Effect("touch", {"boxes": [[10, 10, 40, 40]]}), desktop, stream).probe()
        assert not found.ok
        assert "no interactive element" in found.problem
        assert np.array_equal(desktop.screenshot()[:1000], before[:1000])


@pytest.mark.parametrize("bad", [[[1, 2, 3]], "x", [[5, 5, 1, 1]]])
def test_touch_refuses_boxes_that_are_none(desktop, bad):
    with pytest.raises(EffectError, match="touch: "):
        perform(Effect("touch", {"boxes": bad}), desktop)


def test_an_effect_holds_numbers_that_json_has():
    with pytest.raises(PlanError, match=r"boxes\[0\]\[0\] is nan"):
        Effect("touch", {"boxes": [[float("nan")] * 4]})
