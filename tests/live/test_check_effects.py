"""`hijack check` on files that register live effects: what it finds wrong, without a desktop and on
a real one."""

import contextlib
import subprocess
import sys
import types
from pathlib import Path

import pytest

from online_env.desktops.protocol import RunResult
from online_env.effects import base, conformance
from online_env.errors import DesktopError, MissingCapabilityError

PLUGIN = '''
"""An effect as a plug-in: a note on the desktop's disk."""
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import hijack_data as hj
from hijack_data import plugin
from hijack_data.plugin import Corruption, Draft, Effect, param
from online_env.effects import LiveEffect, Probe, Undone, register

PLACE = "note-of-a-plug-in"


@register
class Note(LiveEffect):
    """Leaves a note in the user's home."""

    kind: ClassVar[str] = "note"
    needs: ClassVar[frozenset] = frozenset({"files"})

    def apply(self, guest, params: Mapping[str, Any]):
        there = guest.shell('test -f "$1"', PLACE).ok
        guest.shell('printf %s "$2" >"$1"', PLACE, params["text"])
        return {"text": params["text"], "there": there}

    def probe(self, guest, record):
        found = guest.shell('cat "$1"', PLACE).output
        ok = found == record["text"]
        return Probe(ok, {"found": found}, "" if ok else f"the note says {found!r}")

    def undo(self, guest, record):
        guest.shell('rm -f "$1"', PLACE)
        return Undone(True)
'''
CORRUPTION = '''

@plugin.register
@dataclass(frozen=True)
class Noted(Corruption):
    """Leaves a note."""

    name: ClassVar[str] = "noted"
    category: ClassVar[str] = "environment_error"
    scope: ClassVar[str] = "state"
    effects: ClassVar[tuple[str, ...]] = ("note",)
    step: int = param(-1, "When", kind="steps", low=-1)

    def make_plan(self, scene, stream, step):
        return Draft(effects=(Effect("note", {"text": "hello"}),))
'''
LIES = {
    "sabotage": ('ok = found == record["text"]', "ok = True"),
    "undo": ("""guest.shell('rm -f "$1"', PLACE)""", "pass"),
    "record": (
        'return {"text": params["text"], "there": there}',
        'return {"text": params["text"], "t": (1, 2)}',
    ),
    "apply_and_probe": ("""guest.shell('printf %s "$2" >"$1"', PLACE, params["text"])""", "pass"),
    "undo_without_apply": ("return Undone(True)", 'return Undone(bool(record["text"]))'),
}


class Folder:
    """A desktop of which only the shell is real: it runs in a new folder."""

    capabilities = frozenset({"files"})

    def __init__(self, path):
        self.path = path

    def execute(self, argv, timeout=60):
        process = subprocess.run(
            argv, capture_output=True, text=True, cwd=self.path, timeout=timeout, check=False
        )
        return RunResult("success", process.stdout, process.stderr, process.returncode)


@pytest.fixture
def fresh(tmp_path):
    """Starts folders as desktops."""
    items = []

    @contextlib.contextmanager
    def start():
        path = tmp_path / f"desktop{len(items)}"
        path.mkdir()
        items.append(path)
        yield Folder(path)

    return start


@pytest.fixture
def registered(monkeypatch):
    """Registers the effect of a source text, and forgets it after the test."""
    monkeypatch.setattr(base.EFFECTS, "entries", dict(base.EFFECTS.entries))

    def load(text):
        module = types.ModuleType("note_plugin")
        exec(compile(text, "note_plugin", "exec"), vars(module))
        return module

    return load


def problems(start, params):
    items = [conformance.run_declared("note"), *conformance.run_live("note", params, start)]
    return {result.check: result.problem for result in items if not result.ok}


def test_a_good_effect_passes_every_check(registered, fresh):
    registered(PLUGIN)
    assert problems(fresh, {"text": "hello"}) == {}


@pytest.mark.parametrize("lie", LIES)
def test_each_lie_is_found(lie, registered, fresh):
    good, bad = LIES[lie]
    assert good in PLUGIN
    registered(PLUGIN.replace(good, bad))
    result = problems(fresh, {"text": "hello"})
    assert lie in result, result
    assert result[lie]
    if lie == "sabotage":
        assert "must look at the machine itself" in result[lie]


def test_what_an_effect_keeps_in_itself_is_found(registered, fresh):
    text = PLUGIN.replace("        there = ", "        self.params = params\n        there = ")
    registered(text)
    assert "keeps something" in problems(fresh, {"text": "hello"})["record"]


def test_what_it_raises_is_a_problem_not_a_crash(registered, fresh):
    registered(PLUGIN)
    result = problems(fresh, {})
    assert result["apply_and_probe"] == "KeyError: 'text'"
    assert "see above" in result["sabotage"]
    registered(PLUGIN.replace("note-of-a-plug-in", "no/such/folder"))
    assert "apply_and_probe" in problems(fresh, {"text": "x"})


@pytest.mark.parametrize(
    ("good", "bad", "words"),
    [
        ('frozenset({"files"})', 'frozenset({"teleport"})', "needs names teleport"),
        ('frozenset({"files"})', '{"files"}', "must be a frozenset"),
        ('"""Leaves a note in the user\'s home."""', "", "needs a docstring"),
        (
            "    def undo(",
            "    def __init__(self):\n        self.seen = []\n\n    def undo(",
            "keeps seen in itself",
        ),
    ],
)
def test_a_wrong_declaration_is_found_without_a_desktop(good, bad, words, registered):
    assert good in PLUGIN
    registered(PLUGIN.replace(good, bad))
    assert words in conformance.run_declared("note").problem


def test_a_missing_capability_is_not_a_failure_of_the_effect(registered, fresh):
    registered(PLUGIN.replace('"files"', '"lock"'))
    with pytest.raises(MissingCapabilityError):
        problems(fresh, {"text": "hello"})


def test_without_a_desktop_it_says_what_was_not_checked(registered, monkeypatch):
    from online_env.effects import checking

    registered(PLUGIN)

    def none():
        raise DesktopError("root: you are not; sudo hijack")

    monkeypatch.setattr(checking, "starter", none)
    declarations, output = checking.check("note", {}, with_desktop=True)
    assert declarations.ok
    assert (
        output
        == "apply, probe and undo: no desktop on this machine: root: you are not; sudo hijack"
    )


def check(tmp_path: Path, text: str, *words: str):
    """Run the command on a file."""
    file = tmp_path / "plugin.py"
    file.write_text(text)
    argv = [sys.executable, "-m", "hijack_data.cli", "check", str(file), *words]
    return subprocess.run(argv, capture_output=True, text=True, timeout=300, check=False)


def test_the_command_without_a_desktop(tmp_path):
    result = check(tmp_path, PLUGIN, "--no-desktop")
    assert result.returncode == 0, result.stderr
    assert "effect note Leaves a note in the user's home." in result.stdout
    assert "not checked: apply, probe and undo" in result.stdout
    result = check(tmp_path, PLUGIN.replace('"files"', '"teleport"'), "--no-desktop")
    assert result.returncode == 1
    assert "needs names teleport" in result.stdout
    result = check(tmp_path, "import online_env.effects")
    assert result.returncode == 2
    assert "registers nothing" in result.stderr


def test_the_command_under_python_o(tmp_path):
    """Assertions are removed there; the checks are not."""
    file = tmp_path / "plugin.py"
    file.write_text(PLUGIN.replace('"files"', '"teleport"'))
    argv = [sys.executable, "-O", "-m", "hijack_data.cli", "check", str(file), "--no-desktop"]
    process = subprocess.run(argv, capture_output=True, text=True, timeout=300, check=False)
    assert process.returncode == 1, process.stderr
    assert "needs names teleport" in process.stdout


def test_the_command_on_a_real_desktop(tmp_path, embedded_machine):
    result = check(tmp_path, PLUGIN + CORRUPTION)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "noted-v1" in result.stdout
    for name in (
        "undo_without_apply",
        "apply_and_probe",
        "record",
        "apply_twice",
        "undo",
        "sabotage",
    ):
        assert f"ok   {name}: " in result.stdout
    result = check(tmp_path, PLUGIN.replace(*LIES["sabotage"]) + CORRUPTION)
    assert result.returncode == 1
    assert "FAIL sabotage: " in result.stdout
    assert "the probe believes the record" in result.stdout
