"""OCR of whole screens: lines found by ONNX Runtime, and by OpenVINO (the extra `openvino`).

    python benchmarks/ocr_engines.py [RUNS]

Reads the pictures of `examples/recordings`, or some that agents saw in a run, once as a whole and
once a part of each. Each engine has a process of its own, so that its memory can be told, and they
take turns. The time is that of the processor: it does not depend on what else the machine does.
"""

import resource
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from common import machine, spread, table
from PIL import Image

from hijack_data.elements import boxes_from_ocr, ocr

EXAMPLES = Path(__file__).resolve().parents[1] / "examples" / "recordings" / "images"
MOST = 60  # pictures of a run
ROUNDS = 2


@dataclass(frozen=True)
class EngineReading:
    """What reading all pictures has cost one engine, and what it read."""

    whole: list[float]
    part: list[float]
    memory: float
    lines: list[tuple[list[list[int]], tuple[str, ...]]]


def main() -> None:
    """Print the table."""
    paths = chosen(sys.argv[1:])
    found: dict[bool, list[EngineReading]] = {False: [], True: []}
    for _ in range(ROUNDS):
        for has_openvino, readings in found.items():
            with ProcessPoolExecutor(1, get_context("spawn")) as pool:
                readings.append(pool.submit(read_all, paths, has_openvino).result())
    rows = [
        [
            "OpenVINO" if has_openvino else "ONNX Runtime",
            spread([time for reading in readings for time in reading.whole], 2),
            spread([time for reading in readings for time in reading.part], 2),
            f"{max(reading.memory for reading in readings):.2f}",
        ]
        for has_openvino, readings in found.items()
    ]
    theirs, ours = (
        np.median([time for reading in readings for time in reading.whole])
        for readings in found.values()
    )
    both = zip(found[False][0].lines, found[True][0].lines, strict=True)
    same = sum(one == other for one, other in both)
    print(f"{machine()}\n")
    header = [
        "lines found by",
        "CPU s a whole picture, min / median / max",
        "CPU s a part",
        "memory at most, GB",
    ]
    print(table(header, rows))
    print(f"\nWith OpenVINO a whole picture takes {ours / theirs:.2f} of the processor time.")
    print(f"Lines and boxes are the same in {same} of {2 * len(paths)} readings.")


def chosen(words: list[str]) -> list[Path]:
    """Return the pictures to read."""
    if not words:
        return sorted(EXAMPLES.glob("*.png"))
    found = sorted(Path(words[0]).glob("episodes/*/frames/*.png"))
    return found[:: max(len(found) // MOST, 1)][:MOST]


def read_all(paths: list[Path], has_openvino: bool) -> EngineReading:
    """Read all pictures with one engine, in a process of its own."""
    ocr.has_openvino = lambda: has_openvino
    boxes_from_ocr(np.zeros((64, 64, 3), np.uint8))  # loads the models
    costs: tuple[list[float], list[float]] = ([], [])
    lines: list[tuple[list[list[int]], tuple[str, ...]]] = []
    for path in paths:
        picture = np.asarray(Image.open(path).convert("RGB"))
        height, width = picture.shape[:2]
        middle = picture[height // 4 : height // 2, width // 4 : width // 2]
        for pixels, times in zip((picture, middle), costs, strict=True):
            start = time.process_time()
            found = boxes_from_ocr(pixels)
            times.append(time.process_time() - start)
            lines.append((found.boxes.tolist(), tuple(found.names)))
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    return EngineReading(costs[0], costs[1], memory, lines)


if __name__ == "__main__":
    main()
