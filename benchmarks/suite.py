"""The oracle over all tasks of the suite, clean: success, minutes, seconds a step, set-up, length.

Root, `hijack desktop install --profile all` and an hour are needed. `--write` also writes the tasks
that were played into `measured.yaml`. A run that was made before is read with `--runs FOLDER`;
several folders are tables of 1, 2, 4 ... desktops.
"""

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml
from common import machine, table

from online_env.results import records
from online_env.results.scores import task_name
from online_env.tasks import suite

FOLDER = Path(suite.__file__).parent
MEASURED = FOLDER / "measured.yaml"
HEAD = "# What the oracle needed on two cores: medians over seeds; made by `python benchmarks/suite.py --write`.\n"


def play(desktops: int, seeds: int, tasks: str, out: Path) -> float:
    """Run the oracle over a set of tasks; return the seconds that it took."""
    options = ["--agent", "oracle", "--corruptions", "clean", "--seeds", str(seeds)]
    placed = ["--desktops", str(desktops), "--out", str(out)]
    command = [sys.executable, "-m", "hijack_data.cli", "bench", tasks, *options, *placed]
    start = time.monotonic()
    subprocess.run(command, check=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return time.monotonic() - start


def by_task(records: Sequence[Mapping[str, Any]]) -> dict[str, list[Mapping[str, Any]]]:
    """Return the scored episodes of each task."""
    tasks: dict[str, list[Mapping[str, Any]]] = {}
    for record in records:
        if record["status"] == "ok" and record["corruption"] == "clean":
            name = task_name(record["task"], record["task_seed"])
            tasks.setdefault(name, []).append(record)
    return tasks


def measured(tasks: Mapping[str, Sequence[Mapping[str, Any]]]) -> dict[str, dict[str, float]]:
    """Return the medians of each task that the oracle solved."""
    entries: dict[str, dict[str, float]] = {}
    for name, episodes in sorted(tasks.items()):
        solved = [record for record in episodes if record["score"] == 1.0]
        if solved:
            entries[name] = {
                "actions": int(statistics.median_low(record["steps"] - 1 for record in solved)),
                "setup": round(statistics.median(r["setup_seconds"] for r in solved), 2),
                "seconds": round(statistics.median(r["seconds"] for r in solved), 1),
            }
    return entries


def write(figures: Mapping[str, Mapping[str, float]]) -> None:
    """Write `measured.yaml`; a task that was not played keeps what was measured before."""
    value = yaml.safe_load(MEASURED.read_text()) | dict(figures)
    figures = {name: value[name] for name in sorted(value) if name in suite.class_references()}
    lines = [
        f"{name}: {{actions: {m['actions']}, setup: {m['setup']}, seconds: {m['seconds']}}}\n"
        for name, m in figures.items()
    ]
    text = HEAD + "".join(lines)
    yaml.safe_load(text)
    MEASURED.write_text(text)


def main() -> None:
    """Print the tables."""
    options = argparse.ArgumentParser()
    options.add_argument("--desktops", default="2", help="such as 1,2,4")
    options.add_argument("--seeds", type=int, default=3)
    options.add_argument("--suite", default="embedded", help="the set of tasks")
    options.add_argument("--runs", type=Path, help="a run that was made before")
    options.add_argument("--write", action="store_true")
    args = options.parse_args()
    print(machine())
    with tempfile.TemporaryDirectory() as scratch:
        folders: dict[str, Path] = {}
        rows: list[list[str]] = []
        if args.runs is not None:
            folders["as run"] = args.runs
        else:
            for count in map(int, args.desktops.split(",")):
                folder = Path(scratch) / str(count)
                seconds = play(count, args.seeds, args.suite, folder)
                folders[str(count)] = folder
                episodes = len(records.read(folder).records)
                rate = 3600 * episodes / seconds
                rows.append([str(count), str(episodes), f"{seconds / 60:.1f}", f"{rate:.0f}"])
        first = records.read(next(iter(folders.values()))).records
        tasks = by_task(first)
        if rows:
            print(table(["desktops", "episodes", "minutes", "episodes an hour"], rows), "\n")
        print(summary(tasks))
        if args.write:
            write(measured(tasks))


def summary(tasks: Mapping[str, Sequence[Mapping[str, Any]]]) -> str:
    """Return what a reader wants to know of one run, in a table."""
    episodes = [record for group in tasks.values() for record in group]
    solved = sum(record["score"] == 1.0 for record in episodes)
    setups = {
        name: statistics.median(record["setup_seconds"] for record in group)
        for name, group in tasks.items()
    }
    slowest = max(setups, key=lambda name: setups[name])
    per_step = [(r["seconds"] - r["setup_seconds"]) / max(1, r["steps"]) for r in episodes]
    actions = [m["actions"] for m in measured(tasks).values()]
    lines = [len(path.read_text().splitlines()) for path in FOLDER.glob("*/[a-z]*.py")]
    over_8 = sum(count > 8 for count in actions)
    rows = [
        ["tasks", str(len(tasks)), ""],
        ["oracle, success", f"{solved} of {len(episodes)}", "all"],
        ["seconds a step, settling and looking", f"{statistics.median(per_step):.2f}", ""],
        ["set-up, s", f"{statistics.median(setups.values()):.1f} median", ""],
        ["slowest set-up, s", f"{setups[slowest]:.1f} ({slowest})", ""],
        ["oracle actions", f"{min(actions)} to {max(actions)}", "2 to 25"],
        ["tasks of more than 8 actions", f"{over_8} of {len(actions)}", "a third"],
        ["lines a task", f"{statistics.median(lines):g} median", "<= 50"],
    ]
    return table(["what", "measured", "goal"], rows)


if __name__ == "__main__":
    main()
