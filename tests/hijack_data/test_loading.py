"""Corruptions from a file: --load, AGENTHIJACK_LOAD, and processes that are started from there."""

import json
import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import hijack_data as hj
from hijack_data import corruption as registry
from hijack_data import loading
from hijack_data.errors import PluginError
from hijack_data.file_io import write_atomic
from hijack_data.picture_io import encode_png

from support import lean
from support.plugins import write

ROOT = Path(__file__).resolve().parents[2]
NAME = 'name: ClassVar[str] = "{}"'


def run(*words, code=0, env=None, cwd=ROOT):
    command = [*lean.HIJACK, *map(str, words)]
    environment = {key: value for key, value in os.environ.items() if key != loading.VARIABLE}
    env = {**environment, **(env or {})}
    process = subprocess.run(command, capture_output=True, text=True, cwd=cwd, env=env, timeout=300)
    assert process.returncode == code, (process.returncode, process.stdout, process.stderr)
    assert "Traceback" not in process.stderr
    return process


@pytest.fixture
def screen(tmp_path):
    path = tmp_path / "screen.png"
    write_atomic(path, encode_png(np.full((540, 960, 3), 200, np.uint8)))
    return path


@pytest.fixture
def fresh(tmp_path, monkeypatch):
    """What is loaded in this process is forgotten after the test."""
    registry.corruption_names()
    monkeypatch.setenv(loading.VARIABLE, "")
    monkeypatch.setattr(registry.CORRUPTIONS, "entries", dict(registry.CORRUPTIONS.entries))
    monkeypatch.setattr(loading, "_files", {})
    monkeypatch.setattr(loading, "_listed", set())
    return tmp_path


def test_every_command_knows_it(tmp_path, screen):
    load = ("--load", write(tmp_path))
    assert json.loads(run(*load, "list", "--json").stdout)[9]["name"] == "bar"
    assert "Radius in pixels" in run(*load, "show", "bar").stdout
    out = tmp_path / "o.png"
    words = ("apply", screen, "bar", "-o", out, "--set", "half=20", "--json")
    assert json.loads(run(*load, *words).stdout)["corruption"] == "bar-v1"
    assert out.read_bytes() != screen.read_bytes()
    page = tmp_path / "g.html"
    run(*load, "gallery", screen, "-o", page, "--corruptions", "bar", "--detect", "none")
    assert "bar" in page.read_text()
    words = ("bench", "embedded_small", "--dry-run", "--corruptions", "clean,bar")
    assert "bar" in run(*load, *words).stdout
    assert "did you mean 'bar'" in run(*load, "show", "barr", code=2).stderr
    assert "unknown corruption 'bar'" in run("show", "bar", code=2).stderr


def test_the_variable_lists_several(tmp_path):
    result = write(tmp_path, "one", name=NAME.format("one"))
    two = write(tmp_path, "two", name=NAME.format("two"))
    three = write(tmp_path, "three", name=NAME.format("three"))
    env = {loading.VARIABLE: f"{result}{os.pathsep}{os.pathsep}{two}"}
    rows = json.loads(run("--load", three, "list", "--json", env=env).stdout)
    assert {row["name"] for row in rows[9:12]} == {"one", "two", "three"}
    assert run("show", "two", env=env).stdout.startswith("two  (two-v1; plug-in)")


def test_the_same_file_twice_is_fine(tmp_path):
    file = write(tmp_path)
    link = tmp_path / "link.py"
    link.symlink_to(file)
    env = {loading.VARIABLE: os.path.relpath(file, ROOT)}
    words = ("--load", file, "--load", link, "--load", file, "list", "--json")
    assert len(json.loads(run(*words, env=env).stdout)) == 9 + 1 + len(
        hj.corruption_names("everyday")
    )
    assert "FAIL" not in run("--load", file, "check", file, env=env).stdout


def test_a_path_may_be_relative(tmp_path):
    """Other processes, such as those of check, work in other folders."""
    write(tmp_path)
    env = {loading.VARIABLE: "bar.py", "PYTHONPATH": str(ROOT)}
    assert "FAIL" not in run("check", "bar.py", env=env, cwd=tmp_path).stdout
    assert "FAIL" not in run("--load", "bar.py", "check", "bar.py", env=env, cwd=tmp_path).stdout


def test_two_files_with_one_name_are_an_error(tmp_path):
    result, two = write(tmp_path, "one"), write(tmp_path, "two")
    output = run("--load", result, "--load", two, "list", code=2).stderr
    assert f"{two}: cannot be imported (line " in output
    assert f"'bar' is taken by {result}; choose another name" in output
    output = run("--load", two, "list", code=2, env={loading.VARIABLE: str(result)}).stderr
    assert f"'bar' is taken by {result}" in output
    marks = write(tmp_path, "marks", name=NAME.format("marks"))
    output = run("--load", marks, "list", code=2).stderr
    assert "'marks' is taken by hijack_data.corruptions.marks" in output


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("x = 1\n", "registers nothing; decorate a class with @hijack_data.plugin.register"),
        ("import sys; sys.exit(3)\n", "cannot be imported (line 1): SystemExit: 3"),
        ("x = 1\nraise RuntimeError('boom')\n", "cannot be imported (line 2): RuntimeError: boom"),
        ("def\n", "cannot be imported: SyntaxError"),
        ("import nothing_of_this_name\n", "cannot be imported (line 1): ModuleNotFoundError: "),
    ],
)
def test_a_file_that_cannot_be_loaded_is_an_error(tmp_path, text, reason):
    file = tmp_path / "bad.py"
    file.write_text(text)
    assert f"error: {file}: {reason}" in run("--load", file, "list", code=2).stderr
    output = run("list", code=2, env={loading.VARIABLE: str(file)}).stderr
    assert f"error: {file}: {reason}" in output
    assert "(listed in AGENTHIJACK_LOAD)" in output


def test_what_is_no_file_is_an_error(tmp_path):
    (tmp_path / "folder.py").mkdir()
    (tmp_path / "bar.txt").write_text("")
    for name in ("missing.py", "folder.py", "bar.txt"):
        assert f"{name}: not a Python file" in run("--load", tmp_path / name, "list", code=2).stderr
    (tmp_path / "a:b").mkdir()
    output = run("--load", write(tmp_path / "a:b"), "list", code=2).stderr
    assert "its path holds ':'" in output


def test_a_file_that_fails_leaves_nothing_behind(fresh):
    file = write(fresh)
    file.write_text(file.read_text() + "\nraise RuntimeError('boom')\n")
    before = hj.corruption_names()
    for _ in range(2):
        with pytest.raises(PluginError, match=r"\(line \d+\): RuntimeError: boom"):
            loading.load_file(file)
    assert hj.corruption_names() == before
    assert not os.environ[loading.VARIABLE]
    assert loading.load_file(write(fresh)).corruptions == ("bar",)


def test_the_bytes_that_run_are_those_that_are_hashed(fresh):
    """Not those of a cache that Python keeps by time and length."""
    file = write(fresh, "cached", code="x = 111")
    stat = file.stat()
    sys.dont_write_bytecode, previous_flag = False, sys.dont_write_bytecode
    try:
        subprocess.run([sys.executable, "-m", "compileall", "-q", str(file)], check=True)
    finally:
        sys.dont_write_bytecode = previous_flag
    write(fresh, "cached", code="x = 222")
    os.utime(file, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    loading.load_file(file)
    ((x, _),) = hj.make_corruption("bar").plan(hj.Scene((540, 960)), seed=0).ops[0].at
    assert x == 222


def test_a_file_that_changes_is_refused(fresh):
    file = write(fresh)
    first = loading.load_file(file)
    assert loading.load_file(file) == first
    write(fresh, code="x = 5")
    with pytest.raises(PluginError, match="was changed since this process loaded it; start again"):
        loading.load_file(file)


def test_a_plugin_of_that_very_file_is_not_loaded_again(tmp_path):
    """While a package is developed, its file is checked beside the installed package."""
    module = write(tmp_path, "scratch_module")
    code = (
        "import sys, hijack_data as hj, scratch_module\n"
        "from hijack_data.loading import load_file\n"
        "file = load_file(sys.argv[1])\n"
        "assert file.module == 'scratch_module' and file.corruptions == ('bar',), file\n"
    )
    env = {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{tmp_path}"}
    subprocess.run([sys.executable, "-c", code, str(module)], env=env, check=True, timeout=60)


CHILD = """
import pickle, sys
spec, scene = pickle.load(sys.stdin.buffer)
print(spec.plan(scene, seed=3).digest())
"""
SCENE = hj.Scene((540, 960))


def plan_elsewhere(spec, **env):
    """The digest in a process that knows nothing of the file but what the pickle says."""
    environment = {key: value for key, value in os.environ.items() if key != loading.VARIABLE}
    process = subprocess.run(
        [sys.executable, "-c", CHILD],
        input=pickle.dumps((spec, SCENE)),
        capture_output=True,
        env={**environment, "PYTHONPATH": str(ROOT), **env},
        timeout=60,
    )
    return process.stdout.decode().strip() or process.stderr.decode().splitlines()[-1]


def test_corruptions_of_a_file_can_be_sent_to_other_processes(fresh):
    file = write(fresh)
    loading.load_file(file)
    spec = hj.make_corruption("bar", half=17)
    assert pickle.loads(pickle.dumps(spec)) == spec
    expected = spec.plan(SCENE, seed=3).digest()
    assert plan_elsewhere(spec) == expected
    assert plan_elsewhere(spec, AGENTHIJACK_LOAD=str(file)) == expected
    several = hj.OneOf([spec, hj.Marks()])
    assert plan_elsewhere(several) == several.plan(SCENE, seed=3).digest()


def test_another_process_needs_the_same_file(fresh):
    file = write(fresh)
    sha256 = loading.load_file(file).sha256
    spec = hj.make_corruption("bar")
    write(fresh, code="x = 5")
    output = plan_elsewhere(spec)
    assert f"{file}: another file" in output
    assert sha256[:12] in output
    file.unlink()
    assert f"{file}: not a Python file that can be read" in plan_elsewhere(spec)


def test_processes_that_are_started_know_it(fresh):
    file = write(fresh)
    loading.load_file(os.path.relpath(file))
    assert os.environ[loading.VARIABLE] == str(file)
    code = "import hijack_data as hj; print(hj.corruption_names()[9])"
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", code]
    for folder in (ROOT, "/"):
        process = subprocess.run(command, capture_output=True, text=True, env=env, cwd=folder)
        assert process.stdout == "bar\n", process.stderr


def test_doctor_lists_it(tmp_path):
    file = write(tmp_path)
    env = {"COLUMNS": "2000"}
    out = "".join(run("--load", file, "doctor", env=env).stdout.split())  # a long path is wrapped
    assert f"okfilebar{file}" in out
    out = " ".join(run("doctor", env={**env, loading.VARIABLE: "gone.py"}).stdout.split())
    assert "broken file AGENTHIJACK_LOAD gone.py: not a Python file that can be read" in out


def test_a_file_whose_name_is_not_utf_8(tmp_path):
    path = os.path.join(os.fsencode(tmp_path), b"\xff.py")
    try:
        with open(path, "w"):
            pass
    except OSError:
        pytest.skip("this file system has no such names")
    with pytest.raises(PluginError, match=r"its path is not UTF-8; rename the file"):
        loading.load_file(os.fsdecode(path))
