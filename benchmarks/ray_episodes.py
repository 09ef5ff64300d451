"""Episodes on a desktop of Ray against one of a local process: what the engine adds to an episode.

Real episodes on one embedded desktop, with each engine in turn. The time that an engine adds is that
from its beginning, when the desktop is free, until the record is here with all files, less the
seconds of the episode itself.
"""

import os
import tempfile
import time
from pathlib import Path

import ray
from common import machine, spread, table

from hijack_data import make_corruption
from online_env.bench.config import Bench
from online_env.bench.jobs import Job, jobs
from online_env.bench.pools import LOCAL, RAY, open_pool
from online_env.bench.runner import run_jobs
from online_env.bench.workers import WorkerSetup
from online_env.results import records
from pipelines.engines.ray_connection import session

MIB = 2**20
HEADER = (
    "engine",
    "episodes",
    "ms added, min / median / max",
    "MB an episode",
    "process, peak MiB",
)


class Times:
    """Keeps what each episode took beyond its own seconds."""

    def __init__(self) -> None:
        self.added: list[float] = []
        self._began = 0.0

    def begins(self, job: Job, number: int, attempt: int) -> None:
        self._began = time.perf_counter()

    def ended(self, job: Job, number: int, record: records.ResultRecord) -> None:
        assert record["score"] == 1.0, record
        self.added.append(time.perf_counter() - self._began - record["seconds"])


def main(seeds: int = 3) -> None:
    """Print the table."""
    bench = Bench(
        tasks=("rename_file",),
        corruptions={"clean": None, "marks": make_corruption("marks")},
        seeds=tuple(range(seeds)),
    )
    with tempfile.TemporaryDirectory() as name, session(1):
        rows = [_row(engine, bench, Path(name) / engine) for engine in (LOCAL, RAY)]
    print(f"{machine()}, ray {ray.__version__}\n")
    print(table(HEADER, rows))


def _row(engine: str, bench: Bench, folder: Path) -> tuple[str, ...]:
    listed = jobs(bench)
    records.create(folder, bench.to_data())
    setup = WorkerSetup(bench=bench, folder=folder)
    times = Times()
    with open_pool(engine, setup, len(listed), 1) as pool:
        run_jobs(listed, folder, 0, pool, times, reserve=pool.reserve)
        peak = _peak(engine)
    episode_path = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
    later = [1000 * seconds for seconds in times.added[1:]]  # the first one starts the desktop
    return (
        engine,
        str(len(later)),
        spread(later, 0),
        f"{episode_path / len(listed) / 1e6:.1f}",
        f"{peak / MIB:.0f}",
    )


def _peak(engine: str) -> int:
    """The most memory that the process that plays has had, in bytes."""
    name = b"ray::NodeDesktop" if engine == RAY else b"spawn_main"
    items = [0]
    for process in Path("/proc").glob("[0-9]*"):
        try:
            status = (process / "status").read_text()
            is_named = name in (process / "cmdline").read_bytes()
            if is_named and (engine == RAY or f"PPid:\t{os.getpid()}\n" in status):
                line = next(part for part in status.splitlines() if part.startswith("VmHWM:"))
                items.append(1024 * int(line.split()[1]))
        except OSError:
            continue
    return max(items)


if __name__ == "__main__":
    main()
