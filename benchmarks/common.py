"""Helpers of the benchmark scripts: timing, commands, the machine, and a Markdown table."""

import importlib.metadata
import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from hijack_data.kernels.cpu import jit

jit.start()  # as in a run of more than a few pictures

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data" / "screenshots"
PACKAGES = (
    "numpy",
    "pillow",
    "torch",
    "torchvision",
    "jax",
    "numba",
    "opencv-python-headless",
    "pyarrow",
)


def hijack(*arguments: object) -> None:
    """Run a command of ours.

    Raises:
        CalledProcessError: It failed.
    """
    command = [sys.executable, "-m", "hijack_data", *map(str, arguments)]
    subprocess.run(command, check=True)


def times(work: Callable[[], object], runs: int = 41, warmup: int = 3) -> list[float]:
    """Run `work` and return its durations in milliseconds."""
    for _ in range(warmup):
        work()
    return [seconds(work) * 1e3 for _ in range(runs)]


def seconds(work: Callable[[], object]) -> float:
    """Run `work` once and return its duration in seconds."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def interleaved(works: dict[str, Callable[[], object]], runs: int = 41) -> dict[str, list[float]]:
    """Time several works in turn, so that a change of the machine's speed affects all alike."""
    out: dict[str, list[float]] = {name: [] for name in works}
    for work in works.values():
        times(work, 1)
    for _ in range(runs):
        for name, work in works.items():
            out[name] += times(work, 1, warmup=1)
    return out


def cell(values: Sequence[float]) -> str:
    """Return `min / median / max` of milliseconds."""
    return spread(values, 3)


def spread(values: Sequence[float], digits: int) -> str:
    """Return `min / median / max` with so many digits after the point."""
    numbers = (min(values), statistics.median(values), max(values))
    return " / ".join(f"{number:.{digits}f}" for number in numbers)


def ratio(values: Sequence[float], base: Sequence[float]) -> str:
    """Return the ratio of the medians."""
    factor = statistics.median(values) / statistics.median(base)
    return f"{factor:.2f}x"


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table."""
    rule = "|".join(" --- " for _ in header)
    lines = [_line(header), f"|{rule}|"]
    lines += map(_line, rows)
    return "\n".join(lines)


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def machine() -> str:
    """Return one line about the machine and the versions of the packages."""
    versions: list[str] = []
    for name in PACKAGES:
        try:
            versions.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            continue
    python = platform.python_version()
    system = f"{_processor()}, {os.cpu_count()} cores, {platform.system()}, Python {python}"
    speed = f"Speed of this run: {yardstick():.1f} ms for 200,000 sums in Python."
    return f"{system}; {', '.join(versions)}\n\n{speed}"


def yardstick() -> float:
    """Return the least milliseconds of a fixed piece of work, to compare times of two runs by."""
    return min(times(lambda: sum(map(int.__add__, range(200_000), range(200_000))), 9))


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":")[1].strip()
    return platform.machine()


def screenshot(size: tuple[int, int] = (1080, 1920)) -> tuple[np.ndarray, str]:
    """Return a real screenshot at `size`, uint8 `[H, W, 3]`, and its name.

    A drawn picture takes its place if the recordings are absent.
    """
    height, width = size
    files = sorted(SHARED.glob("*.png"))
    if not files:
        y, x = np.mgrid[:height, :width]
        planes = [x * 7 % 256, y * 5 % 256, (x + y) % 256]
        return np.stack(planes, -1).astype(np.uint8), "synthetic picture"
    picture = Image.open(files[0]).convert("RGB")
    resized = picture.resize((width, height))
    return np.array(resized), f"{files[0].name} at {width}x{height}"
