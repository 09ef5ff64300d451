"""Each kind of bad plug-in that we know of is caught by the check that names its fault."""

import importlib
from dataclasses import dataclass

import pytest

import hijack_data as hj
from hijack_data import conformance
from hijack_data.errors import HijackError, PluginError

from support.bad_plugins import catalogue
from support.plugins import write

CHECKS = {check.__name__.removeprefix("check_"): check for check in conformance.CHECKS}
KINDS = catalogue()


@pytest.mark.parametrize("kind", KINDS)
def test_it_is_caught(kind, load, monkeypatch):
    check, words, slots = KINDS[kind]
    monkeypatch.delenv("BAR_X", raising=False)
    if check == "load":
        with pytest.raises(PluginError) as refused:
            load(**slots)
        problem = str(refused.value)
    else:
        problem = conformance.run_check(CHECKS[check], load(**slots)).problem
    assert all(words.split("|"))
    assert any(word in problem for word in words.split("|")), problem


def test_there_are_as_many_kinds_as_were_ever_found():
    assert len(KINDS) >= 66 + 60


def notes(check, cls):
    result = conformance.run_check(CHECKS[check], cls)
    assert result.ok, result.problem
    return result.notes


def test_a_draw_that_decides_nothing_is_noted(load):
    (note,) = notes("seed", load(code="x = y = 50"))
    assert "32 seeds give one and the same plan" in note


def test_elements_that_are_asked_for_in_vain_are_noted(load):
    (note,) = notes("elements", load(methods="@property\ndef needs_elements(self): return True"))
    assert "plans are the same without boxes" in note


def test_screens_that_are_refused_are_noted(load):
    code = "if scene.target is None:\n    raise hj.errors.ParameterError('bar needs a target')"
    result = notes("scenes", load(top="import hijack_data.errors", code=code))
    assert "a screen without a target is refused: bar needs a target" in result


def test_a_class_that_no_other_process_finds_is_noted():
    @dataclass(frozen=True)
    class Local(hj.Marks):
        """Marks."""

    (note,) = notes("processes", Local)
    assert "put it at the top of a module" in note


def test_what_cannot_be_sent_to_workers_is_a_problem(tmp_path, monkeypatch):
    start = "def __post_init__(self):\n    object.__setattr__(self, 'draw', lambda: 0)"
    write(tmp_path, "unsendable", decorators="@dataclass(frozen=True)", methods=start)
    monkeypatch.syspath_prepend(tmp_path)
    cls = importlib.import_module("unsendable").Bar
    problem = conformance.run_check(CHECKS["processes"], cls).problem
    assert "it cannot be sent to worker processes" in problem


def test_a_plugin_that_only_this_process_has_is_a_problem(load, tmp_path, monkeypatch):
    write(tmp_path, "gone", decorators="@dataclass(frozen=True)")
    monkeypatch.syspath_prepend(tmp_path)
    cls = importlib.import_module("gone").Bar
    (tmp_path / "gone.py").unlink()
    problem = conformance.run_check(CHECKS["processes"], cls).problem
    assert "a fresh process cannot use it, so neither can workers: ModuleNotFoundError" in problem


def test_what_planning_raises_is_named(load):
    spec = load(code="1 // (width - 960)")()
    spec.plan(hj.Scene((540, 1000)), seed=0)
    with pytest.raises(HijackError) as raised:
        spec.plan(hj.Scene((540, 960)), seed=0)
    output = str(raised.value)
    assert output.startswith(
        "bar-v1: make_plan raised ZeroDivisionError: integer division or modulo"
    )
    assert "bar.py:" in output
    assert isinstance(raised.value.__cause__, ZeroDivisionError)
