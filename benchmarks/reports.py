"""How long reports take: the published run, 33,210 episodes, and millions of rows of others.

`hijack report` runs in a process of its own, as a user runs it, so that the time holds the imports,
too. The scores are drawn; everything else of a record is as `hijack bench` writes it. Beside each
is what the same file takes pyarrow to read, or json where it has no columns, in the same run.

    python benchmarks/reports.py
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
from common import machine, table
from published import RESULTS
from pyarrow import parquet

from hijack_data.plan import CLEAN
from online_env.report.identity import NINE
from online_env.results import records
from online_env.results.reading import RECORDS

AGENTS = ("recovering", *(f"agent-{letter}" for letter in "abcdefgh"))
TASKS = 369
GOAL = 10.0  # seconds
FORMATS = ("terminal", "json", "html")
REPORT = (
    "import runpy\n"
    "try:\n    runpy.run_module('hijack_data.cli', run_name='__main__')\n"
    "except SystemExit:\n    pass\n"
)
# The peers: nothing but reading the file.
JSON_LINES = "import json\n[json.loads(line) for line in open(sys.argv[1], 'rb')]\n"
ARROW_JSON = "from pyarrow import json\njson.read_json(sys.argv[1])\n"
ARROW_PARQUET = "from pyarrow import parquet\nparquet.read_table(sys.argv[1])\n"
RUNS = 2


def synthetic(folder: Path, seeds: int = 1) -> int:
    """Write a run of drawn scores; returns how many episodes it has."""
    rng = np.random.default_rng(0)
    conditions = (CLEAN, *NINE)
    lines = [
        _record(agent, f"task_{task}", condition, seed, float(rng.random() < 0.9 - 0.07 * index))
        for index, agent in enumerate(AGENTS)
        for condition in conditions
        for task in range(TASKS)
        for seed in range(seeds)
    ]
    config = {
        "source": "synthetic",
        "desktop": {"provider": "embedded", "size": [1920, 1080]},
        "agents": list(AGENTS),
        "tasks": [f"task_{task}" for task in range(TASKS)],
        "corruptions": list(conditions),
        "seeds": list(range(seeds)),
        "recovery": "none",
        "max_steps": 15,
    }
    with records.create(folder, config):
        text = "".join(json.dumps(line) + "\n" for line in lines)
        (folder / RECORDS).write_text(text)
    return len(lines)


def _record(agent: str, task: str, condition: str, seed: int, score: float) -> dict[str, object]:
    return {
        "id": f"{task}-{seed}__{condition}__s{seed}__{agent}",
        "agent": agent,
        "task": f"{task}-{seed}",
        "task_seed": seed,
        "instruction": "Write a note that says what was agreed, and save it in the home folder.",
        "apps": ["mousepad"],
        "infeasible": False,
        "corruption": condition,
        "params": {},
        "seed": seed,
        "sample": f"{task}-{seed}",
        "status": "ok",
        "score": score,
        "reason": "",
        "problem": "",
        "ended": "agent",
        "effects": [{"step": 0, "kind": "none", "probes": [{"ok": True}] * 3}],
        "steps": 9,
        "seconds": 21.4,
        "setup_seconds": 3.2,
        "malformed": 0,
        "last_action": "DONE",
        "said": "That should do.",
        "usage": {"requests": 9, "input_tokens": 14_000, "output_tokens": 900, "usd": 0.05},
        "recovery": {"policy": "none", "requests": 0, "false_alarms": 0, "repaired": 0},
        "attempt": 0,
    }


def seconds_of(folder: Path, format: str) -> tuple[float, float]:
    """Run `hijack report` once; returns the seconds it took, and those it computed."""
    argv = [sys.executable, "-m", "hijack_data.cli", "report", str(folder), "--format", format]
    child_usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    begin = time.perf_counter()
    subprocess.run(
        [*argv, "-o", str(folder.parent / format)], check=True, stdout=subprocess.DEVNULL
    )
    wall_seconds = time.perf_counter() - begin
    now = resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall_seconds, now.ru_utime + now.ru_stime - child_usage.ru_utime - child_usage.ru_stime


def rows_of_others(path: Path) -> int:
    """Write a table of drawn scores in JSON Lines; returns how many rows it has."""
    rng = np.random.default_rng(0)
    conditions = (CLEAN, *NINE)
    count = 0
    with path.open("w") as file:
        for agent in range(4):
            for index, condition in enumerate(conditions):
                scores = (rng.random((5000, 5)) < 0.9 - 0.07 * index).astype(int).tolist()
                for task, repeats in enumerate(scores):
                    for seed, score in enumerate(repeats):
                        row = {"agent": f"agent-{agent}", "task": f"task {task}"}
                        row |= {"condition": condition, "seed": seed, "score": score}
                        file.write(json.dumps(row) + "\n")
                        count += 1
    return count


def ten_million_rows(path: Path) -> int:
    """Write a Parquet file of drawn scores; returns how many rows it has."""
    rng = np.random.default_rng(0)
    conditions = (CLEAN, *NINE)
    tasks = pa.array([f"task {task}" for task in range(50_000)])
    task = np.repeat(np.arange(50_000, dtype=np.int32), 5)
    seed = np.tile(np.arange(5), 50_000)
    count = 0
    writer = None
    for agent in range(4):
        for index, condition in enumerate(conditions):
            table = pa.table(
                {
                    "agent": pa.repeat(f"agent-{agent}", len(task)),
                    "task": pa.DictionaryArray.from_arrays(task, tasks).cast(pa.string()),
                    "condition": pa.repeat(condition, len(task)),
                    "seed": seed,
                    "score": (rng.random(len(task)) < 0.9 - 0.07 * index).astype(np.float64),
                }
            )
            writer = writer or parquet.ParquetWriter(path, table.schema)
            writer.write_table(table)
            count += len(task)
    assert writer is not None
    writer.close()
    return count


def goals(folder: Path, run_33210: Path) -> list[list[str]]:
    """Return what the reports with a goal of their own take, as rows of a table."""
    run = RESULTS / "reference_agents" / "run"
    remaining, many = folder / "others.jsonl", folder / "many.parquet"
    count, peak_memory = rows_of_others(remaining), ten_million_rows(many)
    rows: list[list[str]] = []
    for name, source, seconds, gib, peer in (
        ("4,320 episodes (docs/results/reference_agents)", run, 1.0, 1.0, JSON_LINES),
        ("33,210 episodes", run_33210, 5.0, 1.0, JSON_LINES),
        (f"{count:,} rows of a table in JSON Lines", remaining, 20.0, 1.0, ARROW_JSON),
        (f"{peak_memory:,} rows of a table in Parquet", many, 200.0, 2.0, ARROW_PARQUET),
    ):
        report = ["report", str(source)]
        measured = [measure_process(REPORT, report) for _ in range(RUNS)]
        wall_seconds, computed = min(item[:2] for item in measured)
        memory = max(item[2] for item in measured)
        file = source / RECORDS if source.is_dir() else source
        reading = min(measure_process(peer, [str(file)])[1] for _ in range(RUNS))
        is_met = "yes" if computed <= seconds and memory <= gib else "NO"
        goal = f"<= {seconds:g} s of the processor, {gib:g} GiB: {is_met}"
        ratio = f"{reading:.2f} ({computed / reading:.1f}x)"
        rows.append([name, f"{wall_seconds:.1f}", f"{computed:.2f}", f"{memory:.2f}", ratio, goal])
    return rows


def measure_process(work: str, arguments: list[str]) -> tuple[float, float, float]:
    """Run some code once; returns seconds, seconds of the processor, and GiB at most."""
    code = (
        f"import resource, sys\n{work}"
        "used = resource.getrusage(resource.RUSAGE_SELF)\n"
        "print(used.ru_utime + used.ru_stime, used.ru_maxrss / 2**20, file=sys.stderr)\n"
    )
    begin = time.perf_counter()
    process = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        check=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    wall_seconds = time.perf_counter() - begin
    computed, memory = map(float, process.stderr.split()[-2:])
    return wall_seconds, computed, memory


def main() -> None:
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "run"
        count = synthetic(folder)
        size = (folder / RECORDS).stat().st_size / 2**20
        rows = []
        for format in FORMATS:
            wall_seconds, computed = min(seconds_of(folder, format) for _ in range(RUNS))
            verdict = "yes" if wall_seconds <= GOAL else "NO"
            rows.append(
                [format, f"{wall_seconds:.1f}", f"{computed:.1f}", f"<= {GOAL:g} s: {verdict}"]
            )
        further = goals(Path(scratch), folder)
    print(machine())
    load = " ".join(f"{value:.1f}" for value in os.getloadavg())
    print(f"\n{count} episodes, {len(AGENTS)} agents, {size:.0f} MiB of records; load {load}.\n")
    print(table(("format", f"s, the best of {RUNS}", "s of the processor", "goal"), rows))
    print("\nOn the terminal:\n")
    print(table(("report of", "s", "s of the processor", "GiB", "read alone, s", "goal"), further))


if __name__ == "__main__":
    main()
