"""A folder of the user's with the name of one of our packages: one line that says which, never a
traceback."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from hijack_data.shadowed import find_shadow

ROOT = Path(__file__).resolve().parent.parent
NAMES = ("pipelines", "online_env")
START = "import sys; sys.argv[0] = 'hijack'; from hijack_data.cli import main; main()"
# A command that needs the package.
USES = {"pipelines": ["stats", "x"], "online_env": ["desktop", "list"]}


def python(folder: Path, code: str, *words: str) -> "subprocess.CompletedProcess[str]":
    """Run code where `folder` comes before everything of ours."""
    environment = {**os.environ, "PYTHONPATH": f"{folder}:{ROOT}"}
    command = [sys.executable, "-c", code, *words]
    return subprocess.run(
        command, capture_output=True, text=True, env=environment, cwd=folder, timeout=120
    )


@pytest.fixture(params=["package", "module"])
def make_environment(request: pytest.FixtureRequest, tmp_path: Path):
    """Makes something of the user's, and says where it is."""

    def make(name: str) -> Path:
        if request.param == "module":
            value = tmp_path / f"{name}.py"
            value.touch()
            return value
        value = tmp_path / name
        value.mkdir()
        (value / "__init__.py").touch()
        return value

    return make


def refused(done: "subprocess.CompletedProcess[str]", make_environment: Path) -> None:
    """One line names the place and what to do."""
    assert done.returncode == 2, done.stdout + done.stderr
    line, page = done.stderr.splitlines()
    assert page.startswith("hijack: explained in docs/troubleshooting.md#is-imported")
    assert line.startswith(
        f"hijack: error: {make_environment} is imported instead of AgentHijack's own"
    )
    assert "rename it" in line


@pytest.mark.parametrize("name", NAMES)
def test_a_command_says_what_stands_in_its_way(name: str, make_environment, tmp_path: Path) -> None:
    environment = make_environment(name)
    refused(python(tmp_path, START, *USES[name]), environment)
    assert python(tmp_path, START, "--help").returncode == 0  # it imports no package


@pytest.mark.parametrize("name", NAMES)
def test_the_module_form_says_so_too(name: str, make_environment, tmp_path: Path) -> None:
    environment = make_environment(name)
    code = "import runpy, sys; sys.argv[0] = '-m'; runpy.run_module('hijack_data')"
    refused(python(tmp_path, code, *USES[name]), environment)


def test_what_does_not_need_the_package_goes_on(make_environment, tmp_path: Path) -> None:
    make_environment("pipelines")
    result = python(tmp_path, START, "show", "marks")
    assert (result.returncode, result.stderr) == (0, "")


@pytest.mark.parametrize("name", NAMES)
def test_a_folder_that_is_no_package_is_in_nobodys_way(name: str, tmp_path: Path) -> None:
    (tmp_path / name).mkdir()  # ours, which has an __init__.py, comes before it
    result = python(tmp_path, START, *USES[name])
    assert "in the place" not in result.stderr, result.stderr


@pytest.mark.parametrize("name", NAMES)
def test_an_import_of_the_core_warns(name: str, make_environment, tmp_path: Path) -> None:
    environment = make_environment(name)
    value = python(tmp_path, "import hijack_data")
    assert value.returncode == 0
    assert f"HijackWarning: {environment} is imported instead of AgentHijack's" in value.stderr
    assert "<string>:1:" in value.stderr  # the line of the user's import
    quiet = python(tmp_path, "import warnings; warnings.simplefilter('ignore'); import hijack_data")
    assert quiet.stderr == ""


def test_the_doctor_lists_it(make_environment, tmp_path: Path) -> None:
    environment = make_environment("online_env")
    value = python(tmp_path, START, "doctor", "--json")
    rows = {row["what"]: row for row in json.loads(value.stdout)["found"]}
    assert not rows["online_env"]["ok"]
    assert rows["online_env"]["found"].startswith(f"{environment} is imported instead of")


def test_nothing_is_in_the_way_here() -> None:
    assert find_shadow("hijack_data", *NAMES) == ""
    assert find_shadow("no_such_package") == ""
