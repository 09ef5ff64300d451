"""Corrupting a desktop by hand, on one that is none: what is recorded, refused and undone."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

import hijack_data as hj
from hijack_data.errors import ParameterError
from hijack_data.plan import Effect
from online_env.corrupting.desktop_corruption import (
    corrupt_desktop,
    refuse_twice,
    undo_recorded,
    undo_unrecorded,
)
from online_env.corrupting.ledger import LEDGER_FILE, Ledger
from online_env.errors import DesktopError

from support.live import FakeDesktop, Marking

ROOT = Path(__file__).resolve().parents[2]


class ByHand(Marking):
    """A corruption of the machine, which acts without a step."""

    name = "marking"

    def __init__(self, **params):
        super().__init__(None, 3, **params)

    def is_due(self, step):
        return step in self.steps


@pytest.fixture
def ledger(tmp_path):
    return Ledger(tmp_path)


def corrupted(desktop, ledger):
    """The desktop after `marking`, as the command leaves it."""
    spec = ByHand()
    return corrupt_desktop(desktop, spec, note=lambda records: ledger.add(spec.name, records))


def test_a_corruption_of_the_machine_is_applied_probed_and_recorded(ledger):
    desktop = FakeDesktop()
    result = corrupted(desktop, ledger)
    assert result.ok
    assert desktop.state == {"marked"}
    assert (result.after != result.before).any()
    assert "test_mark" in json.dumps(result.records)
    (entry,) = ledger.entries()
    assert entry["corruption"] == "marking"
    assert [record["effect"] for record in entry["records"]] == ["test_mark"]


def test_an_effect_whose_probe_fails_is_not_ok(ledger):
    desktop = corrupt_desktop(FakeDesktop(), ByHand(sabotaged=True))
    assert not desktop.ok
    assert "nothing is marked" in desktop.saw


class Twice(ByHand):
    """Its second effect breaks off."""

    def plan(self, scene, **given):
        plan = super().plan(scene, **given)
        breaks = Effect("test_mark", {"raises": "desktop", "says": "no answer"})
        return replace(plan, effects=(*plan.effects, breaks))


def test_what_was_applied_before_an_effect_that_fails_is_recorded_and_can_be_undone(ledger):
    desktop = FakeDesktop()
    with pytest.raises(DesktopError, match="no answer"):
        corrupt_desktop(desktop, Twice(), note=lambda records: ledger.add("marking", records))
    assert desktop.state == {"marked"}
    ((_, kind, undone),) = undo_recorded(desktop, "marking", ledger)
    assert (kind, undone.ok) == ("test_mark", True)
    assert desktop.state == set()


def test_a_corruption_of_the_picture_leaves_the_machine_alone(ledger):
    desktop = FakeDesktop()
    result = corrupt_desktop(desktop, hj.Subtitle(font_size=12))
    assert result.saw.endswith(
        "of the pixels that the agent sees are changed; the machine is as it was"
    )
    assert (result.after != result.before).any()
    smaller = corrupt_desktop(desktop, hj.Resolution(scale=0.5))
    assert smaller.after.shape == (180, 320, 3)
    assert "of the screen's" in smaller.saw
    assert desktop.state == set()
    assert ledger.entries() == []


def test_a_step_at_which_it_does_not_act_is_refused():
    desktop = FakeDesktop()
    with pytest.raises(ParameterError, match=r"does not act at step 2 .*--set step=2"):
        corrupt_desktop(desktop, hj.AppMinimization(step=5), step=2)
    assert desktop.state == set()


def test_what_still_holds_is_not_applied_again(ledger):
    desktop = FakeDesktop()
    refuse_twice(desktop, ByHand(), ledger, "d1")
    corrupted(desktop, ledger)
    with pytest.raises(DesktopError, match=r"on d1 already.*--undo marking --on d1"):
        refuse_twice(desktop, ByHand(), ledger, "d1")
    desktop.state.clear()  # somebody lifted it
    refuse_twice(desktop, ByHand(), ledger, "d1")


def test_what_was_recorded_is_undone_by_another_process(ledger, tmp_path):
    desktop = FakeDesktop()
    corrupted(desktop, ledger)
    assert undo_recorded(desktop, "subtitle", Ledger(tmp_path)) == []
    ((name, kind, undone),) = undo_recorded(desktop, "marking", Ledger(tmp_path))
    assert (name, kind, undone.ok) == ("marking", "test_mark", True)
    assert desktop.state == set()
    assert ledger.entries() == []
    assert undo_recorded(desktop, None, ledger) == []


def test_what_cannot_be_undone_stays_recorded(ledger):
    desktop = FakeDesktop()
    corrupted(desktop, ledger)
    desktop.dead = True
    with pytest.raises(DesktopError, match="is gone"):
        undo_recorded(desktop, None, ledger)
    assert len(ledger.entries()) == 1
    desktop.dead = False
    assert undo_recorded(desktop, None, ledger)[0][2].ok


def test_without_a_record_the_machine_is_asked():
    desktop = FakeDesktop()
    desktop.state.add("marked")
    ((_, kind, undone),) = undo_unrecorded(desktop, ByHand())
    assert (kind, undone.ok) == ("test_mark", True)
    assert desktop.state == set()
    with pytest.raises(ParameterError, match="nothing to undo"):
        undo_unrecorded(desktop, hj.Subtitle(font_size=12))


ENTRY = {"corruption": "marking", "at": 1.0, "records": [{"effect": "test_mark"}]}
DAMAGES = (
    {"at": "yesterday"},
    {"corruption": 3},
    {"records": 3},
    {"records": ["x"]},
    {"records": [{}]},
)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "{}",
        "[1, {}]",
        '[{"corruption": "x"}]',
        "[" * 5000,
        *(json.dumps([ENTRY | damage]) for damage in DAMAGES),
    ],
)
def test_a_damaged_ledger_counts_as_empty(ledger, tmp_path, text):
    (tmp_path / LEDGER_FILE).write_text(text)
    assert ledger.entries() == []
    refuse_twice(FakeDesktop(), ByHand(), ledger, "d1")
    ledger.add("marking", [])
    assert [entry["corruption"] for entry in ledger.entries()] == ["marking"]


def test_two_processes_do_not_lose_what_the_other_applied(ledger, tmp_path):
    code = (
        "import sys; from pathlib import Path; from online_env.corrupting.ledger import Ledger\n"
        "ledger = Ledger(Path(sys.argv[1])); print('ready', flush=True); input()\n"
        "for n in range(60): ledger.add(f'{sys.argv[2]}{n}', [])"
    )
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    command = [sys.executable, "-c", code, str(tmp_path)]
    running = [subprocess.Popen([*command, name], cwd=ROOT, **pipes) for name in "ab"]
    for process in running:
        assert process.stdout.readline() == "ready\n"
    for process in running:
        process.stdin.write("\n")
        process.stdin.flush()
    for process in running:
        process.communicate()
        assert process.returncode == 0
    names = {entry["corruption"] for entry in ledger.entries()}
    assert names == {f"{name}{n}" for name in "ab" for n in range(60)}
