"""`hijack check` finds the same under `python -O` and `-OO`, without assertions and docstrings."""

import subprocess
import sys

import pytest

from support import lean
from support.bad_plugins import catalogue
from support.plugins import write

BAD = (
    "deterministic: Python's generator",
    "plan_is_data: a set",
    "scenes: the first box",
    "scope: state that draws",
    "untouched: sorted boxes",
    "kept: one recipe",
    "elements: a box",
    "visible: nothing",
    "processes: hash() of a text",
    "parameters: no ranges",
)


def python(level, *words):
    command = [sys.executable, level, *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300)


@pytest.mark.parametrize(
    ("level", "code"), [("-O", lean.CODE), ("-OO", lean.WHOLE)], ids=["-O", "-OO"]
)
def test_a_good_one_passes(level, code, tmp_path):
    """With the frameworks at one level: Python compiles all of a framework for each."""
    result = python(level, "-c", code, "check", write(tmp_path))
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.parametrize("level", ["-O", "-OO"])
def test_bad_ones_are_caught(level, tmp_path):
    """Each in the check that names its fault; in one process, which starts with a file of each."""
    for number, kind in enumerate(BAD):
        slots = {**catalogue()[kind][2], "name": f'name: ClassVar[str] = "bad{number}"'}
        write(tmp_path, f"bad{number}", **slots)
    code = (
        "import sys\n"
        "from hijack_data import conformance, corruption, loading\n"
        "checks = {check.__name__[6:]: check for check in conformance.CHECKS}\n"
        "for file, check in zip(sys.argv[1::2], sys.argv[2::2]):\n"
        "    cls = corruption.find_corruption(loading.load_file(file).corruptions[0])\n"
        "    if conformance.run_check(checks[check], cls).ok:\n"
        "        print(file, check, 'passes')\n"
    )
    words: list[object] = []
    for number, kind in enumerate(BAD):
        words += [tmp_path / f"bad{number}.py", kind.partition(":")[0]]
    result = python(level, "-c", code, *words)
    assert result.returncode == 0, result.stderr
    assert result.stdout == ""
