"""What the runner of benchmarks costs: a step, the first episode, the disk; and a whole run's time.

`hijack desktop install` is needed, except with `--simulate` alone.

* `--overhead`: the time of a step beside the agent, its action and the settling of the screen.
* `--first`: seconds from the command to the first record on the disk.
* `--rate 1,2,4`: episodes an hour with so many desktops. It needs a quiet machine.
* `--simulate`: when 3,690 episodes would end on n machines, from the suite's measured figures.
"""

import argparse
import itertools
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from common import machine, spread, table

from online_env.bench.estimates import makespan
from online_env.results import records
from online_env.tasks import task_sets

HIJACK = (sys.executable, "-m", "hijack_data.cli", "bench", "embedded_small")
GOAL_STEP = 100.0  # ms
GOAL_FIRST = 10.0  # s
GOAL_RATE = 400  # episodes an hour with four desktops
TASKS = 3690  # the 369 of OSWorld under ten conditions
MACHINES = (1, 2, 4, 8, 16, 32, 64)
QUICK = ("count_errors", "find_mention", "find_big_folder", "rename_file")


class Stopwatch:
    """Waits, and notes when it is asked and when it has answered."""

    steps = 12

    def __init__(self) -> None:
        self.asked: list[float] = []
        self.answered: list[float] = []

    def predict(self, instruction: str, obs: Mapping[str, Any]) -> tuple[str, list[str]]:
        """Wait, and at last be done."""
        self.asked.append(time.monotonic())
        output = "DONE" if len(self.asked) > self.steps else "WAIT"
        self.answered.append(time.monotonic())
        return output, [output]


def overheads(episodes: int, corruption: str) -> list[float]:
    """Return what each step took beside agent, action and settling, in milliseconds."""
    import hijack_data as hj
    from online_env.bench.episodes import play
    from online_env.bench.jobs import Job
    from online_env.embedded.desktop import EmbeddedDesktop
    from online_env.environment import CorruptedEnv, EvalSettings, SmallTasks

    items: list[float] = []
    planner = None if corruption == "clean" else hj.make_corruption(corruption)
    with tempfile.TemporaryDirectory() as scratch, EmbeddedDesktop.up(standby=True) as desktop:
        settings = EvalSettings(max_steps=60, log=Path(scratch), agent="stopwatch")
        env = CorruptedEnv(SmallTasks(desktop), settings=settings)
        for seed in range(episodes):
            agent = Stopwatch()
            job = Job("stopwatch", "count_errors", corruption, seed)
            record = play(env, agent, job, 0, planner)
            path = Path(scratch, "episodes", record["id"], "steps.jsonl")
            lines = [json.loads(line)["seconds"] for line in path.read_text().splitlines()]
            items += between(agent, lines)
    return items


def between(agent: Stopwatch, lines: Sequence[Mapping[str, float]]) -> list[float]:
    """Return the milliseconds of each step that are neither the agent's, nor waiting.

    Step k lies between the agent's answer k and question k + 1. Its action is written on line k,
    the settling after it on line k + 1.
    """
    items: list[float] = []
    for k in range(len(agent.asked) - 1):
        step_seconds = agent.asked[k + 1] - agent.answered[k]
        waited = lines[k].get("action", 0.0)
        waited += lines[k + 1].get("settle", 0.0) + lines[k + 1].get("effects", 0.0)
        items.append((step_seconds - waited) * 1e3)
    return items


def overhead_table(episodes: int) -> str:
    """Return a table of the overhead a step, clean and under two corruptions of the picture."""
    rows: list[list[str]] = []
    for corruption in ("clean", "marks", "pop_ups"):
        result = overheads(episodes, corruption)
        met = "yes" if statistics.median(result) <= GOAL_STEP else "no"
        rows.append([corruption, str(len(result)), spread(result, 1), met])
    head = ["condition", "steps", "ms, min / median / max", f"goal <= {GOAL_STEP:g} ms"]
    return table(head, rows)


def bench(
    out: Path, tasks: Sequence[str], desktops: int, corruptions: str = "clean"
) -> "subprocess.Popen[bytes]":
    """Start a run of the oracle."""
    options = ["--agent", "oracle", "--tasks", ",".join(tasks), "--corruptions", corruptions]
    return subprocess.Popen(
        [*HIJACK, *options, "--desktops", str(desktops), "--out", str(out)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def first_episode(runs: int) -> str:
    """Return a table of the time from nothing to the first record, with one and two desktops."""
    rows: list[list[str]] = []
    for desktops in (1, 2):
        items: list[float] = []
        for _ in range(runs):
            with tempfile.TemporaryDirectory() as scratch:
                items.append(_until_a_record(Path(scratch) / "run", desktops))
        met = "yes" if statistics.median(items) <= GOAL_FIRST else "no"
        rows.append([str(desktops), spread(items, 1), met])
    head = ["desktops", "s, min / median / max", f"goal <= {GOAL_FIRST:g} s"]
    return table(head, rows)


def _until_a_record(out: Path, desktops: int) -> float:
    start = time.monotonic()
    process = bench(out, QUICK[:2], desktops)
    path = out / "records.jsonl"
    while process.poll() is None and not (path.exists() and path.stat().st_size):
        time.sleep(0.02)
    passed = time.monotonic() - start
    process.wait()
    return passed


def disk_and_rate(desktops: Sequence[int]) -> str:
    """Return a table of episodes an hour and of the disk that an episode takes."""
    rows: list[list[str]] = []
    for count in desktops:
        with tempfile.TemporaryDirectory() as scratch:
            out = Path(scratch) / "run"
            start = time.monotonic()
            bench(out, task_sets.members("small"), count, "clean,marks").wait()
            hours = (time.monotonic() - start) / 3600
            value = records.read(out).records
            rows.append([str(count), str(len(value)), f"{len(value) / hours:.0f}", disk(out)])
    head = ["desktops", "episodes", f"an hour (goal {GOAL_RATE} with 4)", "MB an episode"]
    return table(head, rows)


def disk(out: Path) -> str:
    """Return what the episodes of a run keep, in megabytes."""
    sizes: list[float] = []
    for folder in (out / "episodes").iterdir():
        total_bytes = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
        sizes.append(total_bytes / 1e6)
    return spread(sizes, 2)


def simulated(
    durations: Sequence[float], machines: Sequence[int], desktops: int = 2
) -> list[tuple[int, float, float]]:
    """Return hours and use of some numbers of machines, for jobs of known length.

    Args:
        durations: Seconds of each job, in the order of the run.
        machines: Numbers of machines.
        desktops: How many play side by side on each.

    Returns:
        For each number: itself, the hours until the last job ends, and the share of that time in
        which a desktop plays, 0 to 1.
    """
    items: list[tuple[int, float, float]] = []
    for count in machines:
        places = count * desktops
        end = makespan(durations, places)
        use = sum(durations) / (places * end) if end else 0.0
        items.append((count, end / 3600, use))
    return items


def simulation(desktops: int) -> str:
    """Return a table of how long 3,690 episodes take on n machines."""
    task_seconds = [figures.seconds for figures in task_sets.read_measurements().values()]
    durations = list(itertools.islice(itertools.cycle(task_seconds), TASKS))
    rows = [
        [str(count), f"{hours:.2f}", f"{100 * use:.0f} %"]
        for count, hours, use in simulated(durations, MACHINES, desktops)
    ]
    head = [f"machines with {desktops} desktops", "hours", "desktops in use"]
    mean = statistics.fmean(durations)
    note = (
        f"{TASKS} episodes of {mean:.1f} s on average, the suite's measured seconds of the oracle."
    )
    return f"{table(head, rows)}\n\n{note}"


def main() -> None:
    """Print the tables."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--overhead", type=int, metavar="EPISODES", help="episodes a condition")
    options.add_argument("--first", type=int, metavar="RUNS")
    options.add_argument("--rate", metavar="1,2,4", help="desktops; on a quiet machine")
    options.add_argument("--simulate", type=int, metavar="DESKTOPS", help="on each machine")
    args = options.parse_args()
    load = " ".join(f"{value:.1f}" for value in os.getloadavg())
    print(f"{machine()}; load {load}")
    if args.overhead:
        print(f"\nThe runner's own time of a step:\n\n{overhead_table(args.overhead)}")
    if args.first:
        print(f"\nFrom the command to the first record:\n\n{first_episode(args.first)}")
    if args.rate:
        counts = [int(count) for count in args.rate.split(",")]
        print(f"\nEpisodes an hour, and the disk:\n\n{disk_and_rate(counts)}")
    if args.simulate:
        print(f"\nA large run on n machines:\n\n{simulation(args.simulate)}")


if __name__ == "__main__":
    main()
