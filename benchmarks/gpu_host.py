"""The host's work for a batch of new overlays on a GPU, with kernels that do nothing; needs no GPU.

    python benchmarks/gpu_host.py

Planning comes first, apart, beside seeding a generator of NumPy for each sample. Then drawing:
plans whose sprites the host draws, and plans that `hijack_data.prepare` drew before, as a loader's
worker does. Copying and launching are the driver's, and not in these times.
"""

import itertools
from collections import defaultdict
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import torch
from common import cell, interleaved, machine, ratio, spread, table, times

import hijack_data as hj
from hijack_data.backends import torch as torch_backend
from hijack_data.corruption import Corruption
from hijack_data.drawing import raster
from hijack_data.kernels.gpu import device

BATCH = 64
RUNS, WARMUP = 15, 3
LIMIT = "a generator of NumPy, seeded anew"
SCENE = hj.Scene(size=(1080, 1920))


def host_rows() -> list[list[str]]:
    """Milliseconds of both ways."""
    launch = defaultdict(lambda: lambda *_, **__: None)
    device._kernels = lambda: SimpleNamespace(paste=launch)
    device.runs_on = torch_backend.together = lambda _place: True
    aug = hj.OneOf([hj.PopUps(), hj.Marks(), hj.Subtitle()])
    batch = torch.zeros((BATCH, 3, *SCENE.size), dtype=torch.uint8)
    plans = [
        [aug.plan(SCENE, seed=1, sample=f"{number}-{i}") for i in range(BATCH)]
        for number in range(RUNS + WARMUP)
    ]
    prepared = itertools.cycle([hj.prepare(batch_plans) for batch_plans in plans])
    raster._cache = raster._Cache(raster.CACHE_BYTES)  # so that the host draws anew
    drawing = iter(plans)
    paste = torch_backend.BACKEND.apply_many  # `apply` would first draw all, since it is in place
    ways = {
        "plans, drawn by the host": lambda: paste(next(drawing), batch, (BATCH,), inplace=True),
        "prepared": lambda: hj.apply(next(prepared), batch, inplace=True),
    }
    timed = {name: times(work, RUNS, WARMUP) for name, work in ways.items()}
    least = [min(values) for values in timed.values()]
    return [
        [name, cell(values), f"{min(values) / least[0]:.2f}x"] for name, values in timed.items()
    ]


def planning_rows() -> list[list[str]]:
    """Microseconds of planning a sample, of all corruptions that the host of a GPU plans."""
    samples = itertools.count()
    parts = [hj.PopUps(), hj.Marks(), hj.Subtitle()]
    works: dict[str, Callable[[], object]] = {
        LIMIT: lambda: np.random.default_rng([next(samples), 1]).integers(0, 1080, 8)
    }
    for planner in [*parts, hj.Resolution(), hj.MultiApps(), hj.OneOf(parts)]:
        name = planner.label if isinstance(planner, Corruption) else "one of the first three"
        works[name] = lambda p=planner: p.plan(SCENE, seed=1, sample=f"episode-{next(samples)}")
    timed = interleaved(
        {name: lambda w=work: [w() for _ in range(BATCH)] for name, work in works.items()}
    )
    microseconds = {name: [ms * 1000 / BATCH for ms in values] for name, values in timed.items()}
    return [
        [name, spread(values, 0), ratio(values, microseconds[LIMIT])]
        for name, values in microseconds.items()
    ]


def main() -> None:
    """Print the tables."""
    print(f"{machine()}\n")
    print(table(["planning", "us a sample", "to NumPy"], planning_rows()))
    print(f"\nA batch of {BATCH} at 1080p, one of pop_ups, marks and subtitle each, in place.\n")
    print(table(["work of the host", "ms", "ratio"], host_rows()))


if __name__ == "__main__":
    main()
