"""Third-party parts of the pipeline: a reader, an export format and an engine."""

import csv
from pathlib import Path

from hijack_data.types import Action, Step, Trajectory
from pipelines.engines.local import run as run_locally
from pipelines.readers import Rejected, register
from pipelines.readers.base import files_below


@register
class ClicksCsv:
    """Reads files `*.clicks.csv` with lines `picture,x,y,instruction`, a trajectory each file.

    Coordinates: pixels of the picture.
    """

    name = "clicks_csv"

    def detect(self, path):
        """By its name."""
        return path.name.endswith(".clicks.csv")

    def read(self, path):
        """Yield a trajectory a file."""
        for file in files_below(path):
            if isinstance(file, Rejected):
                yield file
            if isinstance(file, Rejected) or not self.detect(file):
                continue  # with --format it is given the pictures, too
            rows = list(csv.reader(file.read_text().splitlines()))
            steps = tuple(
                Step(number, str(file.parent / picture), Action("click", int(x), int(y)))
                for number, (picture, x, y, _) in enumerate(rows)
            )
            name = file.name.removesuffix(".clicks.csv")
            yield Trajectory(name, self.name, rows[0][3], steps, platform="linux-xfce")


class Lines:
    """Writes one line an example: its key and the answer."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.lines = []

    def shard(self, index, examples):
        """Collect the lines of a shard."""
        self.lines += [f"{example.key} {example.answer}\n" for example in examples]

    def finish(self):
        """Write them."""
        (self.folder / "lines.txt").write_text("".join(self.lines))


def backwards(tasks, settings, out, workers, tick):
    """Make the last shard first, in this process."""
    yield from run_locally(reversed(list(tasks)), settings, out, 1, tick)
