"""What labels cost beside the pixels: 2,000 boxes of a sample, in five forms.

Everything that `Corrupt` does for a sample except its pixels is timed, against a deep copy of the
boxes in dictionaries by the standard library.
"""

import copy
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from common import machine, table

import hijack_data as hj
from hijack_data import samples
from hijack_data.transforms import Corrupt

COUNT = 2000
RUNS = 30
GOAL_MS = 10


def forms() -> dict[str, tuple[dict[str, Any], dict[str, str]]]:
    """Return entries of samples with their declarations, by what they are."""
    random = np.random.default_rng(3)
    corners = random.integers(0, (1800, 1000), (COUNT, 2))
    boxes = np.concatenate([corners, corners + random.integers(4, 80, (COUNT, 2))], axis=1)
    listed = boxes.tolist()
    objects = [{"bbox": box, "text": "Save", "id": i} for i, box in enumerate(listed)]
    return {
        "at a path through a list": ({"objects": objects}, {"objects.bbox": "xyxy"}),
        "at a path to a list": ({"objects": {"bbox": listed}}, {"objects.bbox": "xyxy"}),
        "lists in a list": ({"boxes": listed}, {"boxes": "xyxy"}),
        "one flat list": ({"boxes": boxes.ravel().tolist()}, {"boxes": "xyxy"}),
        "an array": ({"boxes": boxes}, {"boxes": "xyxy"}),
    }


def cpu_ms(work: Callable[[], object]) -> float:
    """Return the least milliseconds of processor time of a call."""
    spent: list[float] = []
    for _ in range(RUNS):
        start = time.process_time()
        work()
        spent.append((time.process_time() - start) * 1e3)
    return min(spent)


def main() -> None:
    """Print the table."""
    halves = np.zeros((540, 960, 3), np.uint8)
    samples.apply_plan = lambda plan, pixels: halves if plan.ops else pixels  # no pixels
    rows: list[list[str]] = []
    objects = forms()["at a path through a list"][0]
    copy_time = cpu_ms(lambda: copy.deepcopy(objects))
    for name, (entries, labels) in forms().items():
        sample = {"image": np.zeros((1080, 1920, 3), np.uint8), "id": 1, **entries}
        corrupt = Corrupt(hj.Resolution(scale=0.5), seed=1, labels=labels)
        ours = cpu_ms(lambda corrupt=corrupt, sample=sample: corrupt(sample))
        goal = f"<= {GOAL_MS}" if "through" in name else ""
        rows.append([name, f"{ours:.1f}", f"{ours / copy_time:.2f}x", goal])
    print(f"{machine()}\n\nThe deep copy takes {copy_time:.1f} ms.\n")
    header = [f"{COUNT:,} boxes", "ms a sample", "to a deep copy", "goal, ms"]
    print(table(header, rows))


if __name__ == "__main__":
    main()
