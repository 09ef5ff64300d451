"""The effects on a machine with GNOME, as OSWorld's virtual machine has it, over OSWorld's routes
alone: each applied, proved and undone, or refused before anything changes."""

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from support import needs
from support.waiting import until

pytest.importorskip("lxml", reason=needs.ONLINE)

from hijack_data.plan import Effect
from hijack_data.rng import Stream
from online_env.desktops.http import HttpDesktop
from online_env.effects import perform
from online_env.errors import MissingCapabilityError

from support import gnome_machine

SIZE = (1080, 1920)
EFFECTS = {
    "launch_app": {"app": "gedit", "then": []},
    "touch": {},
    "minimise": {},
    "firewall": {},
    "lock": {},
}
PLAYED = {
    "multi_apps": "launch_app",
    "accidental_touch": "touch",
    "app_minimization": "minimise",
    "network_error": "firewall",
    "verification": "lock",
}
# What takes a capability away from the machine, and what the refusal then says.
SUDO = "echo password | sudo -S -p '' "
LOCKDOWN = "gsettings set org.gnome.desktop.lockdown disable-lock-screen"
BUS = "export DBUS_SESSION_BUS_ADDRESS=unix:path=/run/user/1000/bus; "
LACKS = {
    "no GDM": ("lock", f"{SUDO} systemctl stop gdm", f"{SUDO} systemctl start gdm", "gdm3 must"),
    "locking is forbidden": (
        "lock",
        f"{BUS}{LOCKDOWN} true",
        f"{BUS}{LOCKDOWN} false",
        "disable-lock-screen false",
    ),
    "no wmctrl": (
        "minimise",
        f"{SUDO} mv /usr/bin/wmctrl /usr/bin/gone",
        f"{SUDO} mv /usr/bin/gone /usr/bin/wmctrl",
        "apt-get install wmctrl",
    ),
    "another password": (
        "firewall",
        f"{SUDO} sh -c 'echo user:other | chpasswd'",
        "echo other | sudo -S -p '' sh -c 'echo user:password | chpasswd'",
        "sudo must take the password",
    ),
}


@pytest.fixture(scope="module")
def gnome() -> None:
    """Skips where there is no GNOME."""
    needs.gnome()


def test_a_task_is_played_under_all_nine_and_verified(gnome: None, tmp_path: Path) -> None:
    support = Path(gnome_machine.__file__).parent
    config = tmp_path / "gnome.yaml"
    config.write_text(
        f"desktop: {{provider: '{support}/gnome_machine.py:gnome', size: [1920, 1080]}}\n"
        f"agents: [oracle]\ntasks: ['{support}/gnome_task.py:RenameInTerminal']\n"
        "corruptions: all\nseeds: [0]\nmax_steps: 20\nrecovery: none\nretries: 1\n"
    )
    run = tmp_path / "run"
    hijack = [sys.executable, "-m", "hijack_data.cli"]
    for words in (["bench", config, "--desktops", 1, "--out", run], ["verify", run]):
        process = subprocess.run(
            [*hijack, *map(str, words)], capture_output=True, text=True, timeout=500, check=False
        )
        assert process.returncode == 0, process.stdout + process.stderr
    records = [json.loads(line) for line in (run / "records.jsonl").read_text().splitlines()]
    assert len(records) == 10
    assert {record["status"] for record in records} == {"ok"}
    effects = {
        record["corruption"]: [effect["record"] for effect in record["effects"]]
        for record in records
    }
    assert {label: effect[0]["effect"] for label, effect in effects.items() if effect} == PLAYED
    for (effect,) in filter(None, effects.values()):
        assert effect["probes"][0]["ok"]
        assert effect["undone"][-1]["ok"]
    scores = {record["corruption"]: record["score"] for record in records}
    assert scores["clean"] == scores["marks"] == 1.0
    assert scores["verification"] == 0.0, "an oracle types into the lock screen"


@pytest.fixture(scope="module")
def desktop(gnome: None) -> Iterator[Any]:
    """One machine for what follows; the run above has machines of its own, one at a time."""
    with gnome_machine.gnome() as desktop:
        desktop.launch(["gnome-terminal"])
        until(lambda: "user@" in desktop.execute("wmctrl -l").output, "a terminal")
        yield desktop


def test_it_is_gnome_behind_osworlds_routes(desktop: Any) -> None:
    assert not desktop.is_ours
    assert desktop.size == SIZE
    assert desktop.screenshot().shape == (*SIZE, 3)
    assert "GNOME Shell" in desktop.execute("wmctrl -m").output
    assert desktop.capabilities == {"accessibility", "apps", "files", "firewall", "lock", "windows"}


@pytest.mark.parametrize("kind", EFFECTS)
def test_an_effect_is_proved_and_undone(desktop: Any, kind: str) -> None:
    before = desktop.screenshot()
    applied = perform(Effect(kind, EFFECTS[kind]), desktop, Stream(0, f"{kind}-v1"))
    probe = applied.probe()
    result = desktop.screenshot()
    undone = applied.undo()
    assert probe.ok, probe.problem
    assert undone.ok, undone.problem
    if kind != "firewall":
        assert np.mean((before != result).any(axis=2)) > 0.001, "the picture shows nothing of it"
    if kind != "touch":  # a click is no state
        again = applied.probe()
        assert not again.ok
        assert again.problem


def test_the_firewall_needs_iptables_alone(desktop: Any) -> None:
    assert desktop.execute(f"{SUDO} mv /usr/sbin/nft /usr/sbin/gone").ok
    try:
        applied = perform(Effect("firewall", {}), desktop)
        probe, undone = applied.probe(), applied.undo()
        assert applied.record["did"]["tool"] == "iptables"
        assert probe.ok, probe.problem
        assert undone.ok, undone.problem
    finally:
        desktop.execute(f"{SUDO} mv /usr/sbin/gone /usr/sbin/nft")


@pytest.mark.parametrize("lack", LACKS)
def test_what_the_machine_lacks_is_refused_with_the_remedy(desktop: Any, lack: str) -> None:
    kind, take, give_back, remedy = LACKS[lack]
    assert desktop.execute(take).ok
    try:
        with (
            HttpDesktop(desktop.url) as poorer,
            pytest.raises(MissingCapabilityError, match=remedy),
        ):
            perform(Effect(kind, {}), poorer)
    finally:
        assert desktop.execute(give_back).ok
