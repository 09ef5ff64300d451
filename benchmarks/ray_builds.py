"""Builds on Ray: two workers against one, against the processes of the local engine.

Whole builds of real screenshots (clean and all four visual corruptions), in turn, so that a change
of the machine's speed touches all of them alike. Ray runs already, and its workers have loaded
everything, as those of a cluster have after the first shards; the start of Ray and of local
processes is timed apart.
"""

import json
import logging
import os
import shutil
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import ray
from common import SHARED, machine, spread, table

from pipelines import build
from pipelines.engines.ray_data import session

STEPS = 12  # of a trajectory, which is a shard
RUNS = 3
HEADER = ("engine", "workers", "seconds, min / median / max", "rows/s", "against Ray with 1")
CASES = (("ray", 1), ("ray", 2), ("local", 1), ("local", 2))


def main(trajectories: int = 40) -> None:
    """Print both tables."""
    memory = "/dev/shm" if os.path.isdir("/dev/shm") else None
    with tempfile.TemporaryDirectory(dir=memory) as name:
        folder = Path(name)
        _record(folder / "source", trajectories)
        _record(folder / "small", 2)
        start = time.perf_counter()
        with session(2):
            started = time.perf_counter() - start
            _timed(folder, "small", "ray", 2)
            first = time.perf_counter() - start
            spent, rows = _measure(folder)
            memory_before = _resident()
        start_local = _timed(folder, "small", "local", 2)[0]
    print(f"{rows} rows of 1920x1080 PNG screenshots, {trajectories} shards.\n")
    print(f"{machine()}, ray {ray.__version__}\n")
    print(_speeds(spent, rows))
    print(
        f"\nRay itself: started in {started:.1f} s, first small build of two shards done after"
        f" {first:.1f} s (local, two spawned processes: {start_local:.1f} s). Memory of its two"
        f" workers after all builds: {memory_before}."
    )


def _measure(folder: Path) -> tuple[dict[tuple[str, int], list[float]], int]:
    spent: dict[tuple[str, int], list[float]] = {case: [] for case in CASES}
    rows = 0
    for _ in range(RUNS):
        for engine, workers in CASES:
            seconds, rows = _timed(folder, "source", engine, workers)
            spent[engine, workers].append(seconds)
    return spent, rows


def _timed(folder: Path, source: str, engine: str, workers: int) -> tuple[float, int]:
    start = time.perf_counter()
    report = build(
        folder / source, folder / "out", engine=engine, workers=workers, rows_per_shard=1
    )
    spent = time.perf_counter() - start
    shutil.rmtree(folder / "out")
    return spent, report.total


def _speeds(spent: dict[tuple[str, int], list[float]], rows: int) -> str:
    base = statistics.median(spent["ray", 1])
    lines: list[list[str]] = []
    for (engine, workers), times in spent.items():
        middle = statistics.median(times)
        speed = f"{rows / middle:.0f}"
        lines.append([engine, str(workers), spread(times, 1), speed, f"{base / middle:.2f}x"])
    return table(HEADER, lines)


def _resident() -> str:
    @ray.remote(num_cpus=1)
    def peak() -> tuple[int, float]:
        time.sleep(0.5)  # so that each worker takes one
        status = Path("/proc/self/status").read_text().splitlines()
        highest = next(line for line in status if "VmHWM" in line)
        return os.getpid(), int(highest.split()[1]) / 1024

    entries: dict[int, float] = dict(ray.get([peak.remote() for _ in range(2)]))
    sizes = " and ".join(f"{value:.0f} MiB" for value in entries.values())
    return f"{sizes} (peak)"


def _record(folder: Path, trajectories: int) -> None:
    full_hd = (1920).to_bytes(4, "big") + (1080).to_bytes(4, "big")
    files = [file.read_bytes() for file in sorted(SHARED.glob("*.png"))]
    pictures = [data for data in files if data[16:24] == full_hd]
    if not pictures:
        sys.exit(f"the recorded screenshots are not here ({SHARED})")
    (folder / "images").mkdir(parents=True)
    for number, data in enumerate(pictures):
        (folder / "images" / f"{number}.png").write_bytes(data)
    lines: list[dict[str, Any]] = []
    for trajectory in range(trajectories):
        for step in range(STEPS):
            number = (trajectory + step) % len(pictures)
            line = {
                "trajectory_id": f"t{trajectory}",
                "step": step,
                "image": f"images/{number}.png",
                "instruction": "do it",
                "action": {"type": "click", "x": 700, "y": 500},
            }
            lines.append(line)
    text = "".join(json.dumps(line) + "\n" for line in lines)
    (folder / "trajectories.jsonl").write_text(text)


if __name__ == "__main__":
    logging.disable(logging.WARNING)
    main(*map(int, sys.argv[1:]))
