"""OCR of screens: lines found by ONNX Runtime, and by OpenVINO (the extra `openvino`).

    python benchmarks/ocr_engines.py [RUNS]

Reads the pictures of `examples/recordings`, or some that agents saw in a run, each once as a whole
and as parts of different sizes. An engine has a process of its own, so that its memory can be
told, and they take turns. The time is that of the processor, which does not depend on what else the
machine does; of a part, finding the lines and reading one line also stand apart. The third engine
is OpenVINO as RapidOCR starts it, which this library does not use: with the processor's own
precision, and with what it keeps of each size of a picture.
"""

import os
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
from hijack_data.types import UInt8Array

EXAMPLES = Path(__file__).resolve().parents[1] / "examples" / "recordings" / "images"
MOST = 60  # pictures of a run
PARTS = 5  # of each picture
ROUNDS = 2
ONNX = "ONNX Runtime"
OPENVINO = "OpenVINO"
AS_STARTED = "OpenVINO as RapidOCR starts it"
ENGINES = (ONNX, OPENVINO, AS_STARTED)


@dataclass(frozen=True)
class EngineReading:
    """What reading all pictures has cost one engine, and what it read.

    Args:
        whole: processor seconds of each whole picture.
        part: processor seconds of each part.
        finding: processor seconds of finding the lines of each part.
        reading: processor seconds of reading the lines of all parts, for each line.
        memory: GB at most.
        lines: boxes and texts of each reading.
    """

    whole: list[float]
    part: list[float]
    finding: list[float]
    reading: float
    memory: float
    lines: list[tuple[list[list[int]], tuple[str, ...]]]


def main() -> None:
    """Print the table."""
    paths = choose_pictures(sys.argv[1:])
    entries: dict[str, list[EngineReading]] = {engine: [] for engine in ENGINES}
    for _ in range(ROUNDS):
        for engine, readings in entries.items():
            with ProcessPoolExecutor(1, get_context("spawn")) as pool:
                readings.append(pool.submit(read_all, paths, engine).result())
    first = entries[ONNX][0].lines
    rows: list[list[str]] = []
    for engine, readings in entries.items():
        whole_times = [seconds for reading in readings for seconds in reading.whole]
        part = [seconds for reading in readings for seconds in reading.part]
        finding = [seconds for reading in readings for seconds in reading.finding]
        memory = max(reading.memory for reading in readings)
        same = sum(value == second for value, second in zip(first, readings[0].lines, strict=True))
        rows.append(
            [
                engine,
                spread(whole_times, 2),
                spread(part, 2),
                spread(finding, 2),
                f"{min(reading.reading for reading in readings):.3f}",
                f"{memory:.2f}",
                f"{same} of {len(first)}",
            ]
        )
    print(f"{machine()}\n")
    header = [
        "lines found by",
        "CPU s a whole picture, min / median / max",
        "CPU s a part",
        "of it, finding its lines",
        "reading a line",
        "memory at most, GB",
        "same lines and boxes",
    ]
    print(table(header, rows))


def choose_pictures(words: list[str]) -> list[Path]:
    """Return the pictures to read."""
    if not words:
        return sorted(EXAMPLES.glob("*.png"))
    names = sorted(Path(words[0]).glob("episodes/*/frames/*.png"))
    return names[:: max(len(names) // MOST, 1)][:MOST]


def read_all(paths: list[Path], engine: str) -> EngineReading:
    """Read all pictures with one engine, in a process of its own."""
    ocr.has_openvino = lambda: engine != ONNX
    if engine == AS_STARTED:
        ocr._compile = lambda finder: None
    boxes_from_ocr(np.zeros((64, 64, 3), np.uint8))  # loads the models
    rapid = ocr._engine(os.getpid())
    find_lines = rapid.detect_and_crop
    whole_times: list[float] = []
    part: list[float] = []
    finding: list[float] = []
    lines: list[tuple[list[list[int]], tuple[str, ...]]] = []

    def timed(*args: object) -> object:
        start = time.process_time()
        result = find_lines(*args)
        finding.append(time.process_time() - start)
        return result

    rapid.detect_and_crop = timed

    def read(pixels: UInt8Array, times: list[float]) -> None:
        start = time.process_time()
        result = boxes_from_ocr(pixels)
        times.append(time.process_time() - start)
        lines.append((result.boxes.tolist(), tuple(result.names)))

    rng = np.random.default_rng(0)
    for path in paths:
        picture = np.asarray(Image.open(path).convert("RGB"))
        read(picture, whole_times)
        finding.pop()
        for _ in range(PARTS):
            top, left = (int(rng.integers(0, side // 2)) for side in picture.shape[:2])
            height, width = (int(rng.integers(side // 12, side // 3)) for side in picture.shape[:2])
            read(picture[top : top + height, left : left + width], part)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    texts = [len(texts) for number, (_, texts) in enumerate(lines) if number % (PARTS + 1)]
    reading = (sum(part) - sum(finding)) / sum(texts)
    return EngineReading(whole_times, part, finding, reading, memory, lines)


if __name__ == "__main__":
    main()
