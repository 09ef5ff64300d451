"""A package of broken plug-ins, really installed: it is named, and everything else goes on."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from support.installing import install

ROOT = Path(__file__).resolve().parent.parent
BROKEN = {
    "boom": "RuntimeError: boom: [the moon] is in the wrong house",
    "leaves": "SystemExit: no licence found",
    "lost": "ModuleNotFoundError: No module named 'a_package_that_is_not_there'",
    "refused": "cannot register Plain: the field 'thickness' is not declared with param",
    "unusable": "out_of_range.thickness must be int >= 1, got 0",
}
ALL_AND_ONE = 15  # the nine, the plug-in, and the set everyday
NO_CLASS = "wrong_shape"
# What is wrong with the plug-in of each other kind, and how its name is asked for.
BUILD = ("build", "RECORDINGS", "--out", "OUT")
BENCH = ("bench", "embedded_small", "--dry-run")
SHAPES = {
    "edits": ("it is not a subclass of pipelines.edits.Edit", ()),
    "readers": ("it has no detect(path); it has no read(source)", (*BUILD, "--format")),
    "exports": ("it has no shard(index, examples)", ("export", "none", "--out", "OUT", "--to")),
    "engines": ("an engine is a function of", (*BUILD, "--engine")),
    "providers": ("a provider is a function of (size)", ()),
    "tasks": ("it is not a subclass of online_env.tasks.Task", (*BENCH, "--tasks")),
    "agents": ("it has no predict(instruction, obs)", (*BENCH, "--agent")),
}
WORDS = {"readers": "format", "exports": "export format", "providers": "desktop provider"}


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    return install(Path(__file__).parent / "broken_package", tmp_path_factory)


@pytest.fixture(scope="module")
def screen():
    return str(sorted((ROOT / "examples" / "recordings" / "images").glob("*.png"))[0])


def hijack(env, *words, code=0, cwd=ROOT):
    command = [sys.executable, "-m", "hijack_data.cli", *map(str, words)]
    process = subprocess.run(command, capture_output=True, text=True, env=env, cwd=cwd, timeout=300)
    assert process.returncode == code, (process.returncode, process.stdout, process.stderr)
    assert "Traceback" not in process.stderr
    return process


def python(env, *words, code=0):
    """Run Python, which finds the tree before any installed one."""
    path = f"{ROOT}{os.pathsep}{env['PYTHONPATH']}"
    env = {**env, "PYTHONPATH": path}
    command = [sys.executable, *words]
    process = subprocess.run(command, capture_output=True, text=True, env=env, timeout=300)
    assert process.returncode == code, process.stderr
    return process


def test_each_is_named_once_with_the_cure(installed):
    output = hijack(installed, "list").stderr
    assert output.count("hijack: warning: ") == len(BROKEN) == output.count("\n")
    for name, reason in BROKEN.items():
        (line,) = [line for line in output.splitlines() if f"the plug-in {name!r} " in line]
        assert f"of hijack-broken 1.2.3 (broken_plugins.{name}) cannot be loaded" in line
        assert reason in line
        assert line.endswith("remove it: pip uninstall hijack-broken")


def test_list_shows_all_others(installed):
    rows = json.loads(hijack(installed, "list", "--json").stdout)
    assert len(rows) == ALL_AND_ONE
    assert rows[9]["name"] == "whole"
    assert json.loads(hijack(installed, "show", "whole", "--json").stdout)["id"] == "whole-v1"


def test_pictures_are_made(installed, screen, tmp_path):
    hijack(installed, "apply", screen, "whole", "-o", tmp_path / "o.png")
    hijack(installed, "apply", screen, "marks", "-o", tmp_path / "m.png")
    page = tmp_path / "g.html"
    hijack(installed, "gallery", screen, "-o", page, "--detect", "picture")
    assert "whole" in page.read_text()


def test_datasets_are_built(installed, tmp_path):
    source = ROOT / "examples" / "recordings"
    for number, names in enumerate(("marks", "marks,whole", "all-visual")):
        out = tmp_path / str(number)
        words = ("build", source, "--out", out, "--limit", 1, "--corruptions", names, "--json")
        report = json.loads(hijack(installed, *words).stdout)
        assert ("whole" in report["rows_by_corruption"]) == (number > 0)
    hijack(installed, "verify", out)


def test_workers_do_not_repeat_the_warnings(installed, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "import multiprocessing\n"
        "import hijack_data as hj\n"
        "if __name__ == '__main__':\n"
        "    with multiprocessing.get_context('spawn').Pool(1) as pool:\n"
        "        assert pool.apply(hj.corruption_names) == hj.corruption_names()\n"
    )
    result = python(installed, str(script))
    assert result.stderr.count("cannot be loaded and was left out") == len(BROKEN)


def test_an_effect_that_nobody_can_perform_may_be_that_of_a_broken_plugin(installed):
    code = "import online_env.effects as e; e.perform(e.base.Effect('hurtful'), None)"
    result = python(installed, "-c", code, code=1)
    assert "left out, as they cannot be loaded: the plug-in 'hurt'" in result.stderr
    result = python(installed, "-c", code.replace("hurtful", "hurt"), code=1)
    assert "the effect 'hurt' cannot be used: the plug-in 'hurt'" in result.stderr
    assert "OSError: [Errno 5] no such device" in result.stderr.splitlines()[-1]


@pytest.mark.parametrize("kinds", SHAPES)
def test_a_plugin_of_each_kind_may_be_broken(installed, kinds, tmp_path):
    reason, words = SHAPES[kinds]
    if words:
        places = {"RECORDINGS": ROOT / "examples" / "recordings", "OUT": tmp_path / "out"}
        command = [places.get(word, word) for word in words]
        output = hijack(installed, *command, NO_CLASS, code=2).stderr
    else:
        code = "import sys; from hijack_data.registry import find_registry as r; r(sys.argv[1])"
        output = python(installed, "-c", f"{code}.get('{NO_CLASS}')", kinds, code=1).stderr
    kind = WORDS.get(kinds, kinds.removesuffix("s"))
    assert (
        f"the {kind} {NO_CLASS!r} cannot be used: the plug-in {NO_CLASS!r} of hijack-bro" in output
    )
    assert reason in output.splitlines()[-1]


def test_a_name_of_ours_cannot_be_taken(installed):
    words = ("bench", "embedded_small", "--dry-run", "--agent", "oracle")
    result = hijack(installed, *words)
    assert "(broken_plugins.wrong) cannot be loaded and was left out: " in result.stderr
    assert "'oracle' is taken by online_env.agents.oracle; choose another name" in result.stderr
    assert "cannot register Polite of " in result.stderr
    assert "oracle  compare_ferries" in result.stdout


def test_the_benchmark_is_listed(installed):
    words = ("bench", "embedded_small", "--dry-run", "--corruptions")
    assert "whole" in hijack(installed, *words, "clean,whole").stdout
    output = hijack(installed, *words, "boom", code=2).stderr
    assert "hijack: error: the corruption 'boom' cannot be used" in output
    assert "did you mean 'marks'" in hijack(installed, *words, "marsk", code=2).stderr


@pytest.mark.parametrize("name", BROKEN)
def test_who_asks_for_it_is_told_the_reason(installed, name, screen, tmp_path):
    words = ("apply", screen, name, "-o", tmp_path / "o.png")
    output = hijack(installed, *words, code=2).stderr.splitlines()
    (error,) = [line for line in output if line.startswith("hijack: error: ")]
    assert f"the corruption {name!r} cannot be used" in error
    assert BROKEN[name] in error
    assert "pip uninstall hijack-broken" in error


def test_so_it_is_under_the_name_that_it_registered(installed):
    for name in ("half_done", "half_done-v1", "out_of_range"):
        output = hijack(installed, "show", name, code=2).stderr
        assert "hijack: error: the corruption" in output
        assert "cannot be used: the plug-in" in output


def test_a_configuration_that_names_it_says_where(installed, tmp_path):
    config = tmp_path / "c.yaml"
    config.write_text("corruptions:\n  - marks\n  - boom\n")
    words = ("build", ROOT / "examples" / "recordings", "--out", tmp_path / "d", "--config", config)
    output = hijack(installed, *words, code=2).stderr
    assert "c.yaml:3:5: the corruption 'boom' cannot be used" in output
    assert BROKEN["boom"] in output


def test_other_mistakes_are_still_told(installed):
    output = hijack(installed, "show", "marsk", code=2).stderr
    assert "unknown corruption 'marsk'; did you mean 'marks'?" in output
    # Nobody knows that the plug-in refused would have registered this one.
    output = hijack(installed, "show", "plain_line", code=2).stderr
    assert "unknown corruption 'plain_line'" in output
    assert BROKEN["refused"] in output.splitlines()[-1]


def test_doctor_lists_them(installed):
    wide = {**installed, "COLUMNS": "400"}
    out = " ".join(hijack(wide, "doctor").stdout.split())
    for name, reason in BROKEN.items():
        assert f"broken corruptions {name} hijack-broken 1.2.3" in out
        assert reason in out
    assert "ok corruptions whole hijack-broken 1.2.3 whole" in out
    for kinds, (reason, _) in SHAPES.items():
        assert f"broken {kinds} {NO_CLASS} hijack-broken 1.2.3" in out
        assert reason in out
    assert "broken effects hurt hijack-broken 1.2.3 OSError: [Errno 5] no such device" in out
    assert "pip uninstall hijack-broken" in out
    assert hijack(wide, "doctor").stderr == ""


def test_python_is_warned(installed):
    code = (
        "import warnings, hijack_data as hj\n"
        "from hijack_data.errors import HijackError, PluginError, PluginWarning\n"
        "with warnings.catch_warnings(record=True) as said:\n"
        "    warnings.simplefilter('always')\n"
        "    assert hj.corruption_names()[9:] == hj.corruption_names()[9:] == ['whole']\n"
        f"assert [w.category for w in said] == [PluginWarning] * {len(BROKEN)}\n"
        "assert 'half_done' not in hj.corruption_names()\n"
        "try:\n"
        "    hj.make_corruption('boom')\n"
        "except PluginError as error:\n"
        "    assert isinstance(error, HijackError) and 'wrong house' in str(error)\n"
        "else:\n"
        "    raise SystemExit('no error')\n"
    )
    python(installed, "-c", code)


def test_warnings_as_errors_leave_the_command_line_alone(installed):
    strict = {**installed, "PYTHONWARNINGS": "error::UserWarning"}
    assert len(json.loads(hijack(strict, "list", "--json").stdout)) == ALL_AND_ONE
