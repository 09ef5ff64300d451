"""The pytest plug-in without a desktop: its cost, its mark, and what it refuses or skips."""

import subprocess
import sys

import pytest

pytest.importorskip("gymnasium", reason="needs the extra [online]")

pytest_plugins = ["pytester"]
PLUGIN = ("-p", "online_env.pytest_plugin", "--strict-markers")
# Of the library, all that a run of pytest loads that has no such test.
CHEAP = {"online_env", "online_env.gymnasium_registration", "online_env.pytest_plugin"}


@pytest.fixture(autouse=True)
def not_installed(monkeypatch):
    """Load the plug-in by `-p` alone, whether or not the package is installed with it."""
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")


def test_it_imports_next_to_nothing():
    code = (
        "import sys, pytest, importlib.util; before = set(sys.modules);"
        "import online_env.pytest_plugin; print(*(set(sys.modules) - before))"
    )
    process = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    module_names = set(process.stdout.split())
    assert {
        name for name in module_names if name.startswith(("online_env", "hijack_data"))
    } == CHEAP
    assert not module_names & {"numpy", "yaml", "click", "PIL", "gymnasium"}


def test_others_tests_run_as_before_and_the_mark_is_declared(pytester):
    pytester.makepyfile("def test_of_others(tmp_path): assert tmp_path.is_dir()")
    pytester.runpytest(*PLUGIN).assert_outcomes(passed=1)
    pytester.runpytest(*PLUGIN, "--markers").stdout.fnmatch_lines(["@pytest.mark.robust(suite,*"])


@pytest.mark.parametrize(
    ("mark", "agent", "said"),
    [
        (
            "suite='embedded_small', retentoin=1",
            "'oracle'",
            "no argument 'retentoin'; did you mean",
        ),
        ("retention=1", "'oracle'", "name a suite"),
        ("suite='embedded_small'", "'oracle'", "say what is required"),
        ("suite='embedded_smal', retention=1", "'oracle'", "embedded_smal"),
        ("suite='embedded_small', retention=80", "'oracle'", "from 0 to 1 (80 % is 0.8)"),
        ("suite='embedded_small', gates='success=1'", "'oracle'", "gates is a list"),
        ("suite='embedded_small', gates=['success.mark=1']", "'oracle'", "did you mean 'marks'"),
        ("suite='embedded_small', retention=1, machines=['vm']", "3", "name or class, not 3"),
        (
            "suite='embedded_small', retention=1, machines=['vm']",
            "type('Inner', (), {'__qualname__': 'test.Inner'})",
            "move the class to the top",
        ),
    ],
)
def test_a_wrong_mark_or_agent_is_named_before_anything_is_played(pytester, mark, agent, said):
    pytester.makepyfile(
        f"import pytest\n@pytest.mark.robust({mark})\ndef test_agent():\n    return {agent}"
    )
    result = pytester.runpytest(*PLUGIN)
    result.assert_outcomes(failed=1)
    assert said in result.stdout.str()
    assert "Traceback" not in result.stdout.str()


def test_it_skips_with_the_reason_where_no_desktop_can_run(pytester, monkeypatch):
    monkeypatch.setenv("PATH", "/nowhere")
    pytester.makepyfile(
        "import pytest\n"
        "@pytest.mark.robust(suite='embedded_small', retention=0.8)\n"
        "def test_agent():\n    raise AssertionError('called')"
    )
    result = pytester.runpytest(*PLUGIN, "-rs")
    result.assert_outcomes(skipped=1)
    result.stdout.fnmatch_lines(["*no desktop can run here: *hijack desktop install*"])
    pytester.runpytest(*PLUGIN, "--robust-required").assert_outcomes(failed=1)
