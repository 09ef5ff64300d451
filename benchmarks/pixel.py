"""What the agent `pixel` reads: seconds a step, and the OCR saved by reading only what changed.

    python benchmarks/pixel.py [RUNS]

The recorded frames of `examples/recordings`, or of the episodes of a run, are read in their order:
each picture as a whole; only what changed since the last one; and once more as a later episode of
the same process would, which knows what was read before. Texts lost are lines of the whole reading
that the other lacks (OCR reads a part of a picture a little differently).
"""

import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from common import machine, spread, table
from PIL import Image

from online_env.agents.pixel.screen_reader import ScreenReader, TextCache
from online_env.agents.pixel.text_matching import even

EXAMPLES = Path(__file__).resolve().parents[1] / "examples" / "recordings" / "images"
EPISODES = 12  # of a run that are read


def recorded() -> dict[str, list[Path]]:
    """The frames of the example recordings."""
    entries: dict[str, list[Path]] = {}
    for path in sorted(EXAMPLES.glob("*.png")):
        entries.setdefault(path.stem.rpartition("-")[0], []).append(path)
    return entries


def find_runs(runs: Path) -> dict[str, list[Path]]:
    """What the agent saw in the first episodes of a run."""
    entries: dict[str, list[Path]] = {}
    for folder in sorted(runs.glob("episodes/*/frames"))[:EPISODES]:
        calls = {path.name.split(".")[0]: path for path in sorted(folder.glob("*.png"))}
        entries[folder.parent.name] = list(calls.values())
    return entries


def pixels(paths: list[Path]) -> Iterator[np.ndarray]:
    """Decode pictures."""
    for path in paths:
        yield np.asarray(Image.open(path).convert("RGB"))


@dataclass
class Reading:
    """What one way of reading has cost."""

    make: Callable[[], ScreenReader]
    times: list[float] = field(default_factory=list)
    calls: int = 0
    pixels: int = 0
    lost: int = 0
    texts: set[str] = field(default_factory=set)

    def read(self, reader: ScreenReader, picture: np.ndarray) -> None:
        start = time.perf_counter()
        lines = reader.read(picture)
        self.times.append(time.perf_counter() - start)
        self.texts = {even(line.text) for line in lines}

    def count(self, reader: ScreenReader) -> None:
        self.calls += reader.counts.calls
        self.pixels += reader.counts.pixels


def measured(episodes: dict[str, list[Path]]) -> tuple[dict[str, Reading], int]:
    """Read all episodes in each way, picture by picture; also return the number of texts."""
    shared = TextCache()
    ways = {
        "every picture as a whole": Reading(lambda: ScreenReader(TextCache(0), whole=True)),
        "what changed": Reading(lambda: ScreenReader(shared)),
        "what changed, a second time": Reading(lambda: ScreenReader(shared)),
    }
    whole_way = ways["every picture as a whole"]
    whole_way.make().read(np.zeros((64, 64, 3), np.uint8))  # loads the models
    total = 0
    for paths in episodes.values():
        readers = [(way, way.make()) for way in ways.values()]
        for picture in pixels(paths):
            for way, reader in readers:
                way.read(reader, picture)
                way.lost += len(whole_way.texts - way.texts)
            total += len(whole_way.texts)
        for way, reader in readers:
            way.count(reader)
    return ways, total


def main() -> None:
    """Print the table."""
    episodes = find_runs(Path(sys.argv[1])) if len(sys.argv) > 1 else recorded()
    ways, total = measured(episodes)
    whole_way = ways["every picture as a whole"]
    rows = [
        [
            name,
            spread(way.times, 2),
            f"{sum(way.times) / sum(whole_way.times):.2f}",
            str(way.calls),
            f"{way.pixels / whole_way.pixels:.2f}",
            f"{way.lost / total:.1%}",
        ]
        for name, way in ways.items()
    ]
    print(f"{len(episodes)} episodes, {len(whole_way.times)} pictures.\n")
    print(f"{machine()}\n")
    header = [
        "read",
        "s a picture, min / median / max",
        "time, to whole",
        "OCR calls",
        "pixels, to whole",
        "texts lost",
    ]
    print(table(header, rows))


if __name__ == "__main__":
    main()
