"""From an empty folder to a first picture and a first dataset; what starting costs; the site.

It makes a copy of what git tracks in a temporary folder, with an environment of its own, so that
nothing of this clone is used. Downloads depend on the network and on pip's cache, which is used.
"""

import os
import re
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from common import machine, table

ROOT = Path(__file__).resolve().parent.parent
RUNS = 5
GOAL = "<= 20 s together, on a quiet machine"


@dataclass
class Cost:
    """Seconds on the clock, and of processors."""

    wall: float
    cpu: float

    def __add__(self, other: "Cost") -> "Cost":
        return Cost(self.wall + other.wall, self.cpu + other.cpu)

    def __str__(self) -> str:
        return f"{self.wall:.0f} s (CPU {self.cpu:.0f} s)"


def cost(command: list[str], folder: Path) -> tuple[Cost, str]:
    """What a command costs, with its children, and what it prints; ends if it fails."""
    clean = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    process = subprocess.run(
        command, cwd=folder, env=clean, capture_output=True, text=True, check=False
    )
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    if process.returncode:
        sys.exit(f"{command} failed:\n{process.stdout[-2000:]}{process.stderr[-2000:]}")
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Cost(wall, cpu), process.stdout


def least(command: list[str], folder: Path) -> float:
    """Least milliseconds of processors of some runs."""
    return 1000 * min(cost(command, folder)[0].cpu for _ in range(RUNS))


def size(folder: Path) -> str:
    """MB that the files of a folder take."""
    total = sum(path.lstat().st_size for path in folder.rglob("*") if path.is_file())
    return f"{total / 1e6:.0f} MB"


def first_steps(clone: Path) -> list[list[str]]:
    """Rows from the environment to the dataset."""
    installed, _ = cost(["make", f"PYTHON={sys.executable}", "light"], clone)
    python = str(clone / ".venv/bin/python")
    hijack = [python, "-m", "hijack_data"]
    picture = "examples/recordings/images/notes-04.png"
    value, _ = cost([*hijack, "apply", picture, "pop_ups", "-o", "first.png"], clone)
    demo, _ = cost([*hijack, "demo", "--no-desktop"], clone)
    environment = size(clone / ".venv")
    return [
        ["environment of `make demo` (core, vision, pyarrow)", str(installed), environment, ""],
        ["to the first picture", str(installed + value), "", ""],
        ["to gallery and dataset (`make demo`)", str(installed + demo), size(clone / "demo"), GOAL],
    ]


COMMANDS = ("list", *(f"{name} --help" for name in ("build", "bench", "report", "gate", "osworld")))


def starting(clone: Path) -> str:
    """Return a table of what every start costs, beside what NumPy costs."""
    python = str(clone / ".venv/bin/python")
    calls = {
        "`import numpy`": ["-c", "import numpy"],
        "`python -c pass`": ["-c", "pass"],
        "`import hijack_data`": ["-c", "import hijack_data"],
        "`import pipelines`": ["-c", "import pipelines"],
        "`import hijack_data; hijack_data.Marks`": ["-c", "import hijack_data as h; h.Marks"],
        "`hijack --help`": ["-m", "hijack_data", "--help"],
        **{f"`hijack {words}`": ["-m", "hijack_data", *words.split()] for words in COMMANDS},
    }
    spent = {value: least([python, *words], clone) for value, words in calls.items()}
    unit = spent["`import numpy`"]
    rows = [[value, f"{ms:.0f}", f"{ms / unit:.2f}x"] for value, ms in spent.items()]
    return table(["start", f"ms of CPU, least of {RUNS}", "to NumPy's"], rows)


def release(clone: Path) -> list[list[str]]:
    """Rows on the wheel and on the site."""
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    package, _ = cost([".ci/package", version], clone)
    (wheel,) = (clone / "build/dist").glob("*.whl")
    docs, output = cost(["make", "docs"], clone)
    result = re.search(r"(\d+) pages, no broken link", output)
    pages = f"{result[1]} pages, 0 broken links" if result else output[-80:]
    mebi = f"{wheel.stat().st_size / 1e6:.1f} MB"
    return [
        ["sdist and wheel, built and tried with the core alone", str(package), mebi, ""],
        [f"site: {pages}", str(docs), size(clone / "build/site"), "0 broken links"],
    ]


def main() -> None:
    """Print the table."""
    load = " ".join(f"{value:.1f}" for value in os.getloadavg())
    with tempfile.TemporaryDirectory() as folder:
        clone = Path(folder)
        archive = clone / "tree.tar"
        cost(["git", "archive", "-o", str(archive), "HEAD"], ROOT)
        cost(["tar", "-xf", str(archive)], clone)
        archive.unlink()
        rows: list[list[str]] = []
        for part in (first_steps, release):
            rows += part(clone)
            print(rows, file=sys.stderr, flush=True)
        starts = starting(clone)
    print(machine(), end="\n\n")
    print(f"Load before: {load}. On a busy machine only the CPU seconds say something.\n")
    print(table(["what", "seconds", "size", "goal"], rows))
    print(f"\n{starts}")


if __name__ == "__main__":
    main()
