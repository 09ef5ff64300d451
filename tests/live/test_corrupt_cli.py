"""`hijack desktop corrupt`: by hand, from one process, and taken back from another."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from support import needs

pytest.importorskip("lxml", reason=needs.ONLINE)

import hijack_data as hj
from hijack_data.picture_io import load_image
from online_env.corrupting.ledger import LEDGER_FILE, Ledger
from online_env.desktops.commands import launch
from online_env.effects.app_minimization import DESKTOP_WINDOW_TYPES
from online_env.effects.descriptions import in_words, undone_in_words
from online_env.embedded.runtime import registry

from support.effects import reach, windows
from support.waiting import until as wait


@pytest.fixture(scope="module")
def desktop(embedded_machine):
    """A desktop with an editor, under a name of its own."""
    from online_env.embedded.desktop import EmbeddedDesktop

    with EmbeddedDesktop.up(name=f"tc{os.getpid()}", apps=("editor",)) as result:
        yield result


@pytest.fixture
def corrupt(desktop, tmp_path):
    """Runs the command on that desktop, in a folder of its own."""

    def run(*words, on=desktop.id):
        argv = [
            sys.executable,
            "-m",
            "hijack_data.cli",
            "desktop",
            "corrupt",
            *map(str, words),
            "--on",
            on,
        ]
        return subprocess.run(
            argv, capture_output=True, text=True, timeout=120, check=False, cwd=tmp_path
        )

    return run


def window_titles(desktop):
    return [w["title"] for w in windows(desktop) if w["mapped"] and w["type"] == "normal"]


def with_editor(desktop):
    if not window_titles(desktop):
        launch(desktop, "mousepad")
        wait(lambda: window_titles(desktop))
        wait(lambda: "push-button" in desktop.accessibility())


def recorded(desktop):
    return [entry["corruption"] for entry in Ledger(registry.folder(desktop.id)).entries()]


def test_a_corruption_of_the_picture_is_saved_and_leaves_the_machine(desktop, corrupt, tmp_path):
    before = window_titles(desktop)
    result = corrupt("resolution")
    assert result.returncode == 0, result.stderr
    assert "960x540 of the screen's 1920x1080" in result.stdout
    assert load_image(tmp_path / "resolution.png")[0].shape == (540, 960, 3)
    output = json.loads(
        corrupt("marks", "--set", "number=3", "--seed", 5, "-o", "m.png", "--json").stdout
    )
    assert (output["ok"], output["effects"], output["picture"]) == (True, [], "m.png")
    scene = hj.Scene(desktop.size)
    assert output["digest"] == hj.Marks(number=3).plan(scene, seed=5, sample="by hand").digest()
    assert (np.all(load_image(tmp_path / "m.png")[0] == (255, 0, 0), -1)).sum() > 100
    assert (window_titles(desktop), recorded(desktop)) == (before, [])
    refused = corrupt("--undo", "marks")
    assert (refused.returncode, "nothing to undo" in refused.stderr) == (2, True)


def test_windows_vanish_and_come_back_from_another_process(desktop, corrupt, tmp_path):
    before = window_titles(desktop)
    result = corrupt("app_minimization", "-o", "seen.png")
    assert result.returncode == 0, result.stderr
    assert (
        f"app_minimization on {desktop.id}: no window is on the screen, {len(before)} went to the"
        " panel" in result.stdout
    )
    assert f"hijack desktop corrupt --undo app_minimization --on {desktop.id}" in result.stdout
    assert load_image(tmp_path / "seen.png")[0].shape == (1080, 1920, 3)
    assert (window_titles(desktop), recorded(desktop)) == ([], ["app_minimization"])
    undone = corrupt("--undo")
    assert (undone.returncode, undone.stdout) == (
        0,
        f"app_minimization on {desktop.id}: {len(before)} windows are back\n",
    )
    assert (window_titles(desktop), recorded(desktop)) == (before, [])


def test_applied_twice_is_refused_while_it_holds(desktop, corrupt):
    assert corrupt("network_error").returncode == 0
    try:
        assert not reach(desktop)
        again = corrupt("network_error")
        assert again.returncode == 2
        assert "is on" in again.stderr
        assert (
            "still holds; take it back first: hijack desktop corrupt --undo network_error"
            in again.stderr
        )
        assert recorded(desktop) == ["network_error"]
    finally:
        undone = corrupt("--undo", "network_error", "--json")
    assert json.loads(undone.stdout)["undone"][0]["effect"] == "firewall"
    assert reach(desktop)
    # Undone behind its back, it may come again.
    assert corrupt("network_error").returncode == 0
    subprocess.run(
        [
            "nsenter",
            f"--net={desktop.namespace}",
            "nft",
            "delete",
            "table",
            "inet",
            "agenthijack_offline",
        ],
        check=True,
    )
    assert corrupt("network_error").returncode == 0
    assert recorded(desktop) == ["network_error"] * 2
    assert corrupt("--undo").returncode == 0
    assert (reach(desktop), recorded(desktop)) == (True, [])


def test_a_probe_that_is_false_is_exit_code_1(desktop, corrupt):
    table = (
        "add table inet other; add chain inet other out { type filter hook output priority 0;"
        " policy drop; }; "
    )
    table += (
        "add rule inet other out ct state established accept; add rule inet other out oifname"
        ' "ctl0" accept'
    )
    inside = ["nsenter", f"--net={desktop.namespace}", "nft"]
    subprocess.run([*inside, table], check=True)
    try:
        result = corrupt("network_error")
    finally:
        subprocess.run([*inside, "delete table inet other"], check=True)
    assert result.returncode == 1, result.stdout + result.stderr
    assert "the probe is FALSE: " in result.stdout
    assert "already down before" in result.stdout
    assert corrupt("--undo").returncode == 0


def test_a_click_may_come_again_and_cannot_be_taken_back(desktop, corrupt):
    for seed in (1, 2):
        with_editor(desktop)  # the first click closes it
        result = corrupt("accidental_touch", "--seed", seed)
        assert result.returncode == 0, result.stdout + result.stderr
        assert "the click reached the " in result.stdout
        assert "take it back" not in result.stdout
        desktop.run("pyautogui.press('esc')")
        wait(
            lambda: (
                not any(
                    w["mapped"] and w["type"] not in ("normal", *DESKTOP_WINDOW_TYPES)
                    for w in windows(desktop)
                )
            )
        )
    undone = corrupt("--undo")
    assert (undone.returncode, undone.stdout.count("a click cannot be taken back")) == (0, 2)
    with_editor(desktop)


def test_undo_of_what_nobody_recorded(desktop, corrupt):
    nothing = corrupt("--undo")
    assert (nothing.returncode, "nothing was applied" in nothing.stderr) == (2, True)
    for name, output in {
        "verification": "it is not locked",
        "network_error": "our rules are gone",
        "app_minimization": "0 windows are back",
        "multi_apps": "nothing is known",
    }.items():
        value = corrupt("--undo", name)
        assert value.returncode == 0, value.stdout + value.stderr
        assert "no record of" in value.stdout
        assert output in value.stdout


def test_a_lost_record_is_no_obstacle(desktop, corrupt):
    assert corrupt("verification").returncode == 0
    (registry.folder(desktop.id) / LEDGER_FILE).write_text('{"broken')
    undone = corrupt("--undo", "verification")
    assert undone.returncode == 0, undone.stdout + undone.stderr
    assert "unlocked, by password" in undone.stdout
    (registry.folder(desktop.id) / LEDGER_FILE).unlink()


def test_a_locker_that_crashed_is_told_of(desktop, corrupt):
    assert corrupt("verification").returncode == 0
    desktop.execute("pkill -KILL -f mate-screensaver")
    # It is started again, unlocked.
    wait(lambda: desktop.execute("mate-screensaver-command -q | grep -q inactive").ok)
    undone = corrupt("--undo")
    assert undone.returncode == 0, undone.stdout + undone.stderr
    assert (
        "it is not locked: it never was, somebody unlocked it, or the locker ended" in undone.stdout
    )
    assert recorded(desktop) == []


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["verificaton"], "did you mean 'verification'?"),
        (["marks", "--set", "nubmer=3"], "did you mean 'number'?"),
        (["accidental_touch", "--step", "5"], "add --set step=5"),
        ([], "give the NAME of a corruption"),
    ],
)
def test_bad_usage(words, said, corrupt):
    result = corrupt(*words)
    assert (result.returncode, "Traceback" in result.stderr) == (2, False)
    assert said in result.stderr


def test_an_unknown_desktop(corrupt):
    result = corrupt("marks", on="nowhere")
    assert (result.returncode, "there are: " in result.stderr) == (2, True)


# Without a desktop


@pytest.mark.parametrize("content", ["", "{", "[1, null]", '[{"corruption": "x"}]', "[" * 100_000])
def test_a_damaged_ledger_is_an_empty_one(content, tmp_path):
    (tmp_path / LEDGER_FILE).write_text(content)
    ledger = Ledger(tmp_path)
    assert ledger.entries() == []
    ledger.add("marks", [])
    ledger.add("subtitle", [])
    first, second = ledger.entries()
    ledger.drop(first)
    assert ledger.entries() == [second]


def test_facts_of_effects_nobody_described_are_shown_as_they_are():
    assert in_words("mute", {"muted": True}) == '{"muted": true}'
    assert in_words("mute", {"muted": True}, "it is loud") == "it is loud"
    assert undone_in_words("mute", {}) == "{}"
