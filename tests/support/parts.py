"""The parts of the test suite: the core, which `make test` runs, and three thirds of the rest.

The core has every test function of the files that are not in `TAIL`, but of a function with many
cases only `CASES`, drawn by a seed that the summary prints. All other cases are the tail. CI runs
the core and one third of the tail, which the commit chooses, so three landings run everything.
"""

import random
import subprocess
import zlib
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

import pytest

PARTS = ("all", "core", "tail-1", "tail-2", "tail-3")
THIRDS = 3
CASES = 3  # of each test function, in the core

# Files whose promise a quicker file of the core shows, too, for fewer inputs or on one path.
TAIL = frozenset(
    {
        "conformance/test_bad_plugins.py",
        "conformance/test_mutants.py",
        "conformance/test_optimised.py",
    }
)


def default_seed(root: Path) -> int:
    """Return the number of the commit, so that the next one draws other cases; 0 without git."""
    command = ["git", "-C", str(root), "rev-parse", "--short=8", "HEAD"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return 0
    return int(done.stdout, 16)


def is_ignored(file: str, part: str) -> bool:
    """Whether no test of a file (its path below `tests`) belongs to a part, without importing it."""
    if file not in TAIL or part == "all":
        return False
    return part != f"tail-{_third(file)}"


def select(items: Iterable[pytest.Item], part: str, seed: int) -> set[str]:
    """Return the ids of the tests that belong to a part.

    Args:
        items: all tests that were collected.
        part: one of `PARTS`.
        seed: decides which cases of a function are in the core.
    """
    functions: defaultdict[str, list[str]] = defaultdict(list)
    for item in items:
        functions[item.nodeid.partition("[")[0]].append(item.nodeid)
    if part == "all":
        return {case for cases in functions.values() for case in cases}
    selected: set[str] = set()
    for function, cases in functions.items():
        file = function.partition("::")[0].removeprefix("tests/")
        core = set() if file in TAIL else _draw(function, cases, seed)
        if part == "core":
            selected |= core
        else:
            rest = (case for case in cases if case not in core)
            selected |= {case for case in rest if part == f"tail-{_third(file, case)}"}
    return selected


def _draw(function: str, cases: list[str], seed: int) -> set[str]:
    if len(cases) <= CASES:
        return set(cases)
    return set(random.Random(f"{seed} {function}").sample(cases, CASES))


def _third(file: str, case: str = "") -> int:
    """Return 1, 2 or 3: of a file of the tail as a whole, of a core file for each case."""
    key = file if file in TAIL else case
    return 1 + zlib.crc32(key.encode()) % THIRDS
