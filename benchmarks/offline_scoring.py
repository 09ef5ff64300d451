"""`hijack score` with an agent that costs nothing, against reading the dataset and nothing more.

    python benchmarks/offline_scoring.py

The rows are recorded screens at 1920x1080, clean and under the four corruptions of the picture.
"Reading" iterates over `open_dataset` and so decodes (or draws) every picture; "scoring" does that
in a worker, puts each picture to the agent `fail`, compares, and writes the records to the disk.

The ratio is of processor time, of all processes together: the difference between a run over all
rows and one over those of a single screen, so that the start of a worker cancels out. Rates are by
the clock, from the first record on.
"""

import json
import resource
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from common import SHARED, machine, spread, table
from PIL import Image

from online_env.scoring.cases import Selection
from online_env.scoring.run import ScoreRun, ScoreSettings
from pipelines import build, open_dataset

SCREENS = 24
REPEATS = 3
CORRUPTIONS = "pop_ups,marks,subtitle,resolution"


@dataclass(frozen=True)
class Measured:
    """Rows, rows a second by the clock, and seconds of processor time."""

    rows: int
    rate: float
    cpu: float


def record(folder: Path) -> Path:
    """Record a click on each of some real screens, all of one size."""
    (folder / "images").mkdir(parents=True)
    lines = []
    for number, path in enumerate(sorted(SHARED.glob("*.png"))[:SCREENS]):
        picture = Image.open(path).convert("RGB").resize((1920, 1080))
        picture.save(folder / f"images/{number}.png")
        line = {
            "trajectory_id": f"t{number}",
            "step": 0,
            "instruction": "click",
            "image": f"images/{number}.png",
            "action": {"type": "click", "x": 900, "y": 500},
            "target_box": [880, 490, 920, 510],
            "elements": [[880, 490, 920, 510]],
        }
        lines.append(json.dumps(line))
    (folder / "trajectories.jsonl").write_text("\n".join(lines))
    return folder


def cpu_time() -> float:
    """Return the processor time of this process and of those that ended, in seconds."""
    kinds = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    values = [resource.getrusage(kind) for kind in kinds]
    return sum(usage.ru_utime + usage.ru_stime for usage in values)


def read(folder: Path) -> Measured:
    """Read all rows."""
    before = cpu_time()
    start = time.perf_counter()
    count = sum(1 for _ in open_dataset(folder))
    seconds = time.perf_counter() - start
    return Measured(count, count / seconds, cpu_time() - before)


def score(folder: Path, out: Path, workers: int = 1, limit: int | None = None) -> Measured:
    """Score all rows, or those of the first screens."""
    settings = ScoreSettings(
        dataset=folder, agents=("fail",), workers=workers, selection=Selection(limit=limit)
    )
    run = ScoreRun(settings)
    ticks: list[float] = []
    before = cpu_time()
    with run.begin(out, resume=False):
        run.play(out, run.remaining_cases(out), lambda *_: ticks.append(time.perf_counter()), print)
    rate = (len(ticks) - 1) / (time.perf_counter() - ticks[0])
    return Measured(len(ticks), rate, cpu_time() - before)


def row_of(output: str, folder: Path) -> list[str]:
    """Return a line of the table."""
    reads: list[Measured] = []
    scores: list[Measured] = []
    firsts: list[Measured] = []
    measurements: list[Measured] = []
    for repeat in range(REPEATS):
        out = folder.parent / f"{output}-{repeat}"
        reads.append(read(folder))
        scores.append(score(folder, out / "all"))
        firsts.append(score(folder, out / "one", limit=1))
        measurements.append(score(folder, out / "two", workers=2))
    reading = min(first.cpu for first in reads) / reads[0].rows
    more = min(first.cpu for first in scores) - min(first.cpu for first in firsts)
    scoring = more / (scores[0].rows - firsts[0].rows)
    rates = [spread([first.rate for first in part], 1) for part in (reads, scores, measurements)]
    return [
        output,
        *rates,
        f"{1e3 * reading:.1f}",
        f"{1e3 * scoring:.1f}",
        f"{scoring / reading:.2f}",
    ]


def main() -> None:
    """Print the table."""
    if not SHARED.is_dir():
        sys.exit("no recordings: see tests on shared/data in CONTRIBUTING.md")
    rows: list[list[str]] = []
    with tempfile.TemporaryDirectory() as scratch:
        source = record(Path(scratch) / "source")
        for output in ("materialised", "lazy"):
            folder = Path(scratch) / output
            build(source, folder, corruptions=CORRUPTIONS, seed=7, output=output)
            rows.append(row_of(output, folder))
    print(machine(), end="\n\n")
    head = (
        "",
        "reading, rows/s",
        "scoring",
        "two workers",
        "reading, CPU ms/row",
        "scoring",
        "ratio",
    )
    print(table(head, rows))


if __name__ == "__main__":
    main()
