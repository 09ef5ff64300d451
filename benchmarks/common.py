"""What the benchmark scripts share: timing, the machine, and a Markdown table."""

import importlib.metadata
import os
import platform
import statistics
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from hijack_data.kernels import jit

jit.start()  # as in a run of more than a few pictures

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data" / "screenshots"
PACKAGES = ("numpy", "pillow", "torch", "torchvision", "jax", "numba", "opencv-python-headless", "pyarrow")


def times(work: Callable[[], object], runs: int = 41, warmup: int = 3) -> list[float]:
    """Run `work` and return its durations in milliseconds."""
    for _ in range(warmup):
        work()
    out: list[float] = []
    for _ in range(runs):
        start = time.perf_counter()
        work()
        out.append((time.perf_counter() - start) * 1e3)
    return out


def interleaved(works: dict[str, Callable[[], object]], runs: int = 41) -> dict[str, list[float]]:
    """Time several works in turn, so that a change of the machine's speed touches all of them alike."""
    out: dict[str, list[float]] = {name: [] for name in works}
    for work in works.values():
        times(work, 1)
    for _ in range(runs):
        for name, work in works.items():
            out[name] += times(work, 1, warmup=1)
    return out


def cell(values: Sequence[float]) -> str:
    """`min / median / max` in milliseconds."""
    return f"{min(values):.3f} / {statistics.median(values):.3f} / {max(values):.3f}"


def ratio(values: Sequence[float], base: Sequence[float]) -> str:
    """Median over median."""
    return f"{statistics.median(values) / statistics.median(base):.2f}x"


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [f"| {' | '.join(header)} |", f"|{'|'.join(' --- ' for _ in header)}|"]
    return "\n".join(lines + [f"| {' | '.join(row)} |" for row in rows])


def machine() -> str:
    """One line on the machine and the versions."""
    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    cpu = next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), platform.machine())
    versions = []
    for name in PACKAGES:
        try:
            versions.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            continue
    return (
        f"{cpu}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}; {', '.join(versions)}"
    )


def screenshot(size: tuple[int, int] = (1080, 1920)) -> tuple[np.ndarray, str]:
    """A real screenshot at `size`, uint8 `[H, W, 3]`, and what it is; a drawn one where the recordings are absent."""
    files = sorted(SHARED.glob("*.png"))
    if not files:
        y, x = np.mgrid[: size[0], : size[1]]
        return np.stack([x * 7 % 256, y * 5 % 256, (x + y) % 256], -1).astype(np.uint8), "synthetic picture"
    picture = Image.open(files[0]).convert("RGB").resize(size[::-1])
    return np.array(picture), f"{files[0].name} at {size[1]}x{size[0]}"
