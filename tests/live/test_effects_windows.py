"""Minimise and launch_app on a real desktop: applied, proved, undone; sabotaged, the probe says
so."""

import json

import pytest

from hijack_data.plan import Effect
from online_env.effects import EffectError, perform, resume, undo
from online_env.effects import apps as apps_module
from online_env.effects import multi_apps as launch_module
from online_env.effects.guest import Guest

from support import needs
from support.effects import Liar, applied, boxes, open_apps, refused, windows
from support.waiting import until as wait

# the file manager is on every desktop
OTHER = Effect("launch_app", {"app": "thunar", "tile": True})
pytestmark = pytest.mark.usefixtures("browser_machine")


@pytest.fixture(scope="module")
def desktop(embedded_desktop):
    return open_apps(embedded_desktop)


def test_minimise_hides_all_and_brings_all_back(desktop):
    before, picture = boxes(desktop), desktop.screenshot()
    result = perform(Effect("minimise"), desktop)
    value = result.probe()
    assert value.ok, value
    assert (value.facts["hidden"], value.facts["on_screen"]) == (2, [])
    assert not any(mapped for _, mapped in boxes(desktop).values())
    assert result.undo().ok
    assert boxes(desktop) == before
    wait(lambda: (desktop.screenshot() == picture).mean() > 0.99)
    json.dumps(result.record, allow_nan=False)


def test_minimise_twice_and_undo_twice(desktop):
    before = boxes(desktop)
    first, second = perform(Effect("minimise"), desktop), perform(Effect("minimise"), desktop)
    assert second.probe().ok
    assert second.record["did"]["already"]
    assert second.undo().ok
    assert first.undo().ok
    assert first.undo().ok
    assert boxes(desktop) == before


def test_sabotaged_minimise_is_found_out(desktop):
    claim = {"managed": True, "hidden": [1], "active": 0, "by": "show_desktop", "already": False}
    result = perform(Effect("minimise"), Liar(desktop, minimise=claim)).probe()
    assert not result.ok
    assert "Mousepad" in result.problem


def test_minimise_undo_without_record_and_from_another_process(desktop):
    before = boxes(desktop)
    assert undo("minimise", desktop).ok
    assert boxes(desktop) == before
    record = perform(Effect("minimise"), desktop).record
    later = resume(json.loads(json.dumps(record)), desktop)
    assert later.probe().ok
    assert later.undo().ok
    assert boxes(desktop) == before
    perform(Effect("minimise"), desktop)
    assert undo("minimise", desktop).ok
    assert boxes(desktop) == before


def test_minimise_needs_a_window_manager(desktop):
    refused(Effect("minimise"), Liar(desktop, minimise={"managed": False}), "window manager")


def test_launch_tiles_two_windows_and_puts_the_first_back(desktop):
    before = {number: box for number, (box, _) in boxes(desktop).items()}
    result = perform(OTHER, desktop)
    value = result.probe()
    assert value.ok, value
    new = [w for w in windows(desktop) if w["type"] == "normal" and w["id"] not in before]
    assert len(new) == 1
    assert new[0]["frame"][0] >= 960 - 2
    attempt = value.facts["attempts"][0]
    assert (attempt["app"], attempt["argv"], attempt["stand_in"]) == ("thunar", ["thunar"], "")
    assert result.undo().ok
    wait(lambda: {number: box for number, (box, _) in boxes(desktop).items()} == before)
    assert result.undo().ok, "undone twice"


@needs.needs_apps("geany")
def test_geany_stands_in_for_the_code_editor_that_is_not_there(desktop):
    effect = Effect("launch_app", {"app": "vscode", "then": ["chrome"], "tile": True})
    with applied(effect, desktop) as result:
        value = result.probe()
        assert value.ok, value
        attempt = value.facts["attempts"][0]
        assert attempt["app"] == "vscode"
        assert ("Geany" in attempt["stand_in"]) == (attempt["argv"][0] == "geany")


def test_launch_that_was_sabotaged_or_closed_is_found_out(desktop, monkeypatch):
    with applied(OTHER, Liar(desktop, drawn={"drawn": True, "under": {}})) as result:
        assert "not at [0, 0, 960" in result.probe().problem
    result = perform(OTHER, desktop)
    Guest(desktop, "", None).x("close", 3.0, ids=[result.record["did"]["window"]["id"]])
    assert "gone" in result.probe().problem
    assert result.undo().ok
    monkeypatch.setattr(launch_module, "_START", "echo 0")
    monkeypatch.setattr(launch_module, "LAUNCH_TIMEOUT_S", 0.5)
    value = perform(OTHER, desktop).probe()
    assert not value.ok
    assert "no window came" in value.problem


def test_launch_takes_the_next_when_one_hangs_or_is_not_installed(desktop, monkeypatch):
    """One sleeps and never shows a window, one shows a window and never draws it, one is not
    there."""
    frozen = "from Xlib import X, display as d\nimport time\ns = d.Display()\nr = s.screen().root\n"
    frozen += (
        "w = r.create_window(0, 0, 400, 300, 0, X.CopyFromParent)\nw.set_wm_class('frozen',"
        " 'Frozen')\nw.map()\n"
    )
    frozen += "s.sync()\ntime.sleep(600)"
    commands = dict(apps_module.COMMANDS)
    commands["gimp"] = (apps_module.Command(("not-there",), ("x",)),)
    commands["vlc"] = (apps_module.Command(("sleep", "610"), ("sleep",)),)
    commands["thunderbird"] = (apps_module.Command(("python3", "-c", frozen), ("frozen",)),)
    commands["vscode"] = (apps_module.Command(("mousepad", "--disable-server"), ("mousepad",)),)
    monkeypatch.setattr(launch_module, "COMMANDS", commands)
    monkeypatch.setattr(launch_module, "LAUNCH_TIMEOUT_S", 10.0)
    monkeypatch.setattr(launch_module, "DRAW_TIMEOUT_S", 8.0)
    effect = Effect(
        "launch_app", {"app": "gimp", "then": ["vlc", "thunderbird", "VS Code"], "tile": True}
    )
    with applied(effect, desktop) as result:
        value = result.probe()
        assert value.ok, value
        attempts = [(a["app"], a["came"], a["drawn"]) for a in value.facts["attempts"]]
        assert attempts == [
            ("vlc", False, False),
            ("thunderbird", True, False),
            ("vscode", True, True),
        ]
    assert desktop.execute(["pgrep", "-f", "sleep 610"]).returncode == 1, "what hung still runs"
    assert desktop.execute(["pgrep", "-f", "frozen"]).returncode == 1


def test_launch_with_nothing_installed(desktop, monkeypatch):
    monkeypatch.setattr(launch_module, "FALLBACKS", {})
    refused(
        Effect("launch_app", {"app": "nothing-at-all", "then": ["nor-this"]}),
        desktop,
        "nothing_at_all, nor_this",
    )


def test_launch_falls_back_on_what_is_not_open(desktop, monkeypatch):
    monkeypatch.setattr(launch_module, "COMMANDS", {})
    with applied(Effect("launch_app", {"app": "no-such-program"}), desktop) as result:
        value = result.probe()
        assert value.ok, value
        assert value.facts["attempts"][0]["app"] == "thunar", "mousepad is open already"
        assert "nothing of the paper's list" in value.facts["attempts"][0]["stand_in"]


def test_launch_refuses_what_is_no_name(desktop):
    with pytest.raises(EffectError, match="must name applications"):
        perform(Effect("launch_app", {"then": []}), desktop)
