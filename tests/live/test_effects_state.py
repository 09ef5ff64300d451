"""Firewall and lock on a real desktop: applied, proved, undone; sabotaged, the probe says so."""

from dataclasses import replace

import numpy as np
import pytest

from hijack_data.plan import Effect
from online_env.desktops.lockers import LOCKERS, Locker
from online_env.effects import EffectError, perform, resume, undo
from online_env.effects import network_error as firewall_module
from online_env.effects.guest import Guest

from support.effects import WithSudo, applied, boxes, browser_to_front, open_apps, reach, refused
from support.waiting import until as wait

pytestmark = pytest.mark.usefixtures("browser_machine")


@pytest.fixture(scope="module")
def desktop(embedded_desktop):
    return open_apps(embedded_desktop)


def rules(desktop):
    return Guest(desktop, "", None).root("nft list ruleset").output


def test_firewall_cuts_the_sites_and_nothing_else(desktop):
    from online_env.embedded.desktop import EmbeddedDesktop

    desktop.execute("(python3 -m http.server 5999 --bind 127.0.0.1 >/dev/null 2>&1 &)")
    wait(lambda: reach(desktop, "127.0.0.1", 5999))
    before = rules(desktop)
    result = perform(Effect("firewall", {"allow": []}), desktop)
    value = result.probe()
    assert value.ok, value
    assert {target["kind"] for target in value.facts["before"]} == {"tcp", "dns"}
    assert value.facts["dropped"] >= 2
    assert not reach(desktop)
    assert reach(desktop, "127.0.0.1", 5999), "loopback must stay"
    with EmbeddedDesktop.attach(desktop.id) as second_desktop:  # a connection of its own
        assert second_desktop.execute(["true"]).ok
    assert result.undo().ok
    assert reach(desktop)
    assert rules(desktop) == before, "the fence of the desktop must stay as it was"
    assert result.undo().ok, "undone twice"


def test_firewall_shows_chromium_its_own_error_page(desktop):
    browser_to_front(desktop)
    with applied(Effect("firewall"), desktop):
        desktop.run(
            "pyautogui.hotkey('ctrl', 'l'); pyautogui.write('news.test'); pyautogui.press('enter')"
        )
        wait(lambda: "news.test - Network error" in desktop.accessibility())
    desktop.run("pyautogui.press('f5')")
    wait(lambda: "Morning Ledger" in desktop.execute(["wmctrl", "-l"]).output)


def test_firewall_twice(desktop):
    with (
        applied(Effect("firewall"), desktop) as first,
        applied(Effect("firewall"), desktop) as second,
    ):
        assert second.record["did"]["already"]
        assert second.probe().ok
        assert first.probe().ok
    assert reach(desktop)


def test_sabotaged_firewall_is_found_out(desktop, monkeypatch):
    nothing = {"nft": replace(firewall_module._TOOLS["nft"], close=lambda *_: "true")}
    monkeypatch.setattr(firewall_module, "_TOOLS", nothing)
    with applied(Effect("firewall"), desktop) as result:
        value = result.probe()
    assert not value.ok
    assert "still reachable: tcp 10.77.0.1, dns 10.77.0.1" in value.problem
    assert "not in force" in value.problem


def test_firewall_rules_that_are_refused_are_told(desktop, monkeypatch):
    wrong = {"nft": replace(firewall_module._TOOLS["nft"], close=lambda *_: "nft add nonsense")}
    monkeypatch.setattr(firewall_module, "_TOOLS", wrong)
    with applied(Effect("firewall"), desktop) as result:
        assert "the rules were refused: " in result.probe().problem


def test_network_that_was_down_before_is_not_our_doing(desktop):
    root = Guest(desktop, "", None).root
    assert root("ip link set eth0 down").ok
    try:
        result = perform(Effect("firewall", {"sites": [["10.77.0.1", 80]]}), desktop)
        value = result.probe()
        assert not value.ok
        assert "already down before" in value.problem
        assert result.undo().ok
    finally:
        assert root("ip link set eth0 up && ip route add default via 10.77.0.1").ok
    assert reach(desktop)


@pytest.mark.parametrize("tool", ["nft", "iptables"])
def test_firewall_through_sudo(desktop, tool, tmp_path):
    """As in a virtual machine; with iptables where there is no nft."""
    guest = WithSudo(desktop, tmp_path)
    guest.give(tool)
    before = rules(desktop)
    result = perform(Effect("firewall"), guest)
    assert result.record["did"]["tool"] == tool
    value = result.probe()
    assert value.ok, value
    assert not reach(desktop)
    assert result.undo().ok
    assert reach(desktop)
    assert undo("firewall", guest).ok, "nothing is left to undo"
    assert "AGENTHIJACK" not in rules(desktop)
    assert before in rules(desktop) or "agenthijack_offline" not in rules(desktop)


def test_firewall_says_what_is_missing(desktop, tmp_path):
    refused(
        Effect("firewall"), WithSudo(desktop, tmp_path), "neither nft nor iptables works as root"
    )
    (tmp_path / "wrong").mkdir()
    secret = WithSudo(desktop, tmp_path / "wrong", password="another")
    secret.give("nft")
    refused(Effect("firewall"), secret, "neither nft nor iptables")
    assert reach(desktop)


@pytest.mark.parametrize(
    "params", [{"allow": ["not-an-address"]}, {"allow": 7}, {"sites": [["x"]]}, {"sites": 3}]
)
def test_firewall_refuses_wrong_parameters(desktop, params):
    with pytest.raises(EffectError, match="firewall: "):
        perform(Effect("firewall", params), desktop)
    assert reach(desktop)


def test_lock_takes_screen_and_keyboard_until_the_password(desktop):
    picture = desktop.screenshot()
    result = perform(Effect("lock"), desktop)
    value = result.probe()
    assert value.ok, value
    assert (value.facts["active"], value.facts["covers"], value.facts["typed_reaches"]) == (
        True,
        True,
        False,
    )
    assert result.record["did"]["drawn"], "the lock screen is black"
    # The dialog comes a moment after the picture behind it.
    wait(
        lambda: (desktop.screenshot()[330:760, 740:1180].min(2) > 245).sum() > 5000,
        "the white password box",
    )
    middle = desktop.screenshot()[330:760, 740:1180].min(2)
    assert ((middle > 180) & (middle < 230)).sum() > 50_000, "no dialog"
    undone = result.undo()
    assert undone.ok
    assert undone.facts["by"] == "password"
    assert (desktop.screenshot() == picture).mean() > 0.99
    assert result.undo().ok, "undone twice"
    assert undo("lock", desktop).ok, "undone without a record"


def test_lock_screen_that_went_black_is_woken(desktop):
    with applied(Effect("lock"), desktop) as result:
        desktop.run("pyautogui.press('esc')")
        wait(lambda: len(np.unique(desktop.screenshot()[::8, ::8].reshape(-1, 3), axis=0)) == 1)
        result.refresh()
        assert len(np.unique(desktop.screenshot()[::8, ::8].reshape(-1, 3), axis=0)) > 100
        assert result.probe().ok
    picture = desktop.screenshot()
    result.refresh()
    assert (desktop.screenshot() == picture).mean() > 0.99


def test_locked_already_and_locked_twice(desktop):
    with applied(Effect("lock"), desktop) as first:
        second = perform(Effect("lock"), desktop)
        assert second.record["did"]["already"]
        assert second.probe().ok
        assert first.probe().ok


def test_lock_with_a_password_that_is_not_known_is_forced_open(desktop):
    result = perform(Effect("lock"), desktop, password="not this one")
    assert result.probe().ok
    undone = result.undo()
    assert (undone.ok, undone.facts["by"]) == (True, "force")


def test_sabotaged_lock_is_found_out(desktop, monkeypatch):
    value = LOCKERS[0]
    deaf = Locker(value.name, value.query, value.on, value.off, "true", value.force)
    for module in ("effects.verification", "desktops.lockers"):
        monkeypatch.setattr(f"online_env.{module}.BY_NAME", {value.name: deaf})
    monkeypatch.setattr("online_env.effects.verification.LOCK_TIMEOUT_S", 0.3)
    result = perform(Effect("lock"), desktop).probe()
    assert not result.ok
    assert "not locked" in result.problem


def test_probe_of_the_lock_believes_no_locker_that_only_says_so(desktop, monkeypatch):
    """A locker that claims to be active, on a screen that anybody can use."""
    liar = Locker("true", "echo it is active", " is active", " is inactive", "true", "true")
    monkeypatch.setattr("online_env.effects.verification.BY_NAME", {"true": liar})
    record = {"effect": "lock", "params": {}, "did": {"locker": "true"}, "probes": [], "undone": []}
    result = resume(record, desktop).probe()
    assert not result.ok
    assert "keyboard is free" in result.problem
    assert "reached another client" in result.problem


def test_locker_that_crashes_is_noticed_and_comes_back(desktop):
    result = perform(Effect("lock"), desktop)
    assert result.probe().ok
    desktop.execute(["pkill", "-9", "-x", "mate-screensave"])
    wait(lambda: not result.probe().ok)
    assert result.undo().ok
    with applied(Effect("lock"), desktop) as again:
        assert again.probe().ok


def test_guest_without_a_locker(desktop, monkeypatch):
    monkeypatch.setattr("online_env.effects.verification._ASK_ALL", "true")
    refused(Effect("lock"), desktop, "it has no locker")
    monkeypatch.setattr("online_env.effects.verification._ASK_ALL", "echo loginctl nobody")
    monkeypatch.setattr("online_env.effects.verification.LOCK_TIMEOUT_S", 0.2)
    before = boxes(desktop)
    # nothing lacks: it fails now
    with pytest.raises(EffectError, match="installed, but no locker answers"):
        perform(Effect("lock"), desktop)
    assert boxes(desktop) == before
