"""Tell what a fresh run of the benchmarks does worse than the tables of a commit.

`python benchmarks/compare.py [--against COMMIT] [--factor 1.3] [SECTION ...]` compares RESULTS.md as
it is now, after `make bench`, with that of the commit. A machine is never as fast as another, so it
looks at ratios, which both runs took within themselves: cells such as `1.49x` or `+17.6 %`, and
times (`min / median / max`: the least) over the time of the fixed work that the section names as
the speed of its run. Rows are matched by their section, their table, their first words and their
column. Exit code 1 if something got worse by the factor.
"""

import argparse
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

RESULTS = Path(__file__).parent / "RESULTS.md"
RATIO = re.compile(r"([0-9][0-9,]*(?:\.[0-9]+)?)x")
SHARE = re.compile(r"([+-][0-9]+(?:\.[0-9]+)?) ?%")
SPEED = re.compile(r"Speed of this run: ([0-9.]+) ms")
TIMES = re.compile(r"([0-9]+(?:\.[0-9]+)?) / [0-9.]+ / [0-9.]+(?: (m?s))?")
RATES = ("/s", "a second", "an hour")  # a column with this in its name holds no times
# Columns whose ratio is how much faster we are than a peer: there, less is worse.
MORE_IS_BETTER = ("peer / ours", "against Ray with 1", "ratio of rates")
PEER_TABLES = ("Full rebuild", "Largest free rectangle")
MIN_SHARE = 0.05  # of the time that is compared with: below it noise decides
# Rows of others: what they lose is not ours.
OTHERS = (
    "torch interpolate",
    "torchvision",
    "Pillow",
    "OpenCV",
    "Albumentations",
    "AugLy",
    "Kornia",
    "imgaug",
)


@dataclass(frozen=True)
class Ratio:
    """A ratio of a table: less is better.

    Attributes:
        place: the section, the words before the table, the row, the column, and how many had the
            same before.
        value: the ratio, above 0.
        text: the cell as it stands in the table.
    """

    place: tuple[str, ...]
    value: float
    text: str


def main() -> None:
    """Compare, print what got worse, and exit with 1 if anything did."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sections", nargs="*", metavar="SECTION", help="beginnings of titles")
    parser.add_argument("--against", default="HEAD", metavar="COMMIT")
    parser.add_argument("--factor", type=float, default=1.3)
    arguments = parser.parse_args()
    before = {ratio.place: ratio for ratio in numbered(committed(arguments.against))}
    sections = tuple(arguments.sections) or ("",)
    now = [r for r in numbered(RESULTS.read_text()) if r.place[0].startswith(sections)]
    if not now:
        sys.exit(f"no ratio in a section that begins with {' or '.join(sections)}")
    compared = [(before[r.place], r) for r in now if r.place in before]
    worse = [(old, new) for old, new in compared if new.value > old.value * arguments.factor]
    for old, new in worse:
        print(f"{' · '.join(filter(None, new.place))}: {old.text} -> {new.text}")
    lost_ratios = [r for r in before.values() if r.place[0].startswith(sections)]
    missing_places = {r.place for r in lost_ratios} - {r.place for r in now}
    print(
        f"{len(compared)} ratios compared, {len(worse)} worse by {arguments.factor:g}x or more;"
        f" {len(now) - len(compared)} new, {len(missing_places)} gone"
    )
    sys.exit(1 if worse else 0)


def committed(commit: str) -> str:
    """Return RESULTS.md as a commit has it."""
    command = ["git", "show", f"{commit}:./{RESULTS.name}"]
    try:
        process = subprocess.run(
            command, cwd=RESULTS.parent, capture_output=True, text=True, check=True
        )
    except subprocess.CalledProcessError as error:
        sys.exit(f"--against {commit}: {error.stderr.strip()}")
    return process.stdout


def numbered(text: str) -> Iterator[Ratio]:
    """Yield the ratios of all tables, no two with the same place."""
    counts: Counter[tuple[str, ...]] = Counter()
    for ratio in read_ratios(text):
        counts[ratio.place] += 1
        count = counts[ratio.place]
        yield replace(ratio, place=(*ratio.place, f"number {count}" if count > 1 else ""))


def read_ratios(text: str) -> Iterator[Ratio]:
    """Yield the ratios of all tables."""
    section = before = ""
    speed: float | None = None
    header: list[str] = []
    for line in text.splitlines():
        if line.startswith("## "):
            section, before, speed = line[3:], "", None
        if match := SPEED.match(line):
            speed = float(match[1])
        if not line.startswith("|"):
            if line.strip():
                before = re.split(r"[:.]", line)[0].strip("* `")
            header = []
            continue
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if not header:
            header = cells
        elif not set("".join(cells)) <= set("- :"):
            yield from _row(section, before, header, cells, speed)


def _row(
    section: str, before: str, header: list[str], cells: list[str], speed: float | None
) -> Iterator[Ratio]:
    """Yield the ratios of one row; its name is its cells up to the first with a number."""
    if any(cell.startswith(OTHERS) for cell in cells[:2]):
        return
    names: list[str] = []
    for cell in cells:
        if names and re.match(r"[+-]?[0-9]", cell):
            break
        names.append(cell)
    for column, cell in zip(header, cells, strict=False):
        value = _value(cell)
        if value is None and speed is not None and not any(rate in column for rate in RATES):
            value = _time(cell, speed)
        if value is None:
            continue
        is_peers = column in MORE_IS_BETTER or before.startswith(PEER_TABLES)
        if is_peers or section.startswith(PEER_TABLES):
            value = 1 / value
        yield Ratio((section, before, *names, column), value, cell)


def _time(cell: str, speed: float) -> float | None:
    """Return the least of the times of a cell over the speed of its run; `None` for other cells."""
    match = TIMES.fullmatch(cell)
    if match is None:
        return None
    milliseconds = float(match[1]) * (1000 if match[2] == "s" else 1)
    return max(milliseconds / speed, 1e-9)


def _value(cell: str) -> float | None:
    """Return a ratio or a share as a positive number; `None` for any other cell."""
    if match := RATIO.fullmatch(cell):
        return max(float(match[1].replace(",", "")), 1e-9)
    if match := SHARE.fullmatch(cell):
        return max(1 + float(match[1]) / 100, MIN_SHARE)
    return None


if __name__ == "__main__":
    main()
