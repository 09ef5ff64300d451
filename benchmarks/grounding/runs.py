"""All runs: each training seed with each choice of corruptions, in parallel, kept when done."""

import hashlib
import json
import multiprocessing
import statistics
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from . import data, model, pages, train

CLEAN = "clean"
CONDITIONS = (CLEAN, *data.CORRUPTIONS)
SPLITS = ("new", "site")
_shared: list[pages.Page] = []  # of the workers, which are forks


@dataclass(frozen=True)
class Run:
    """One network.

    Args:
        held_out: the corruption that is not trained with, while the others are; `None`: no
            augmentation.
        seed: decides first weights, order and corruptions.
    """

    held_out: str | None
    seed: int

    @property
    def names(self) -> tuple[str, ...]:
        """The corruptions that are trained with."""
        if self.held_out is None:
            return ()
        return tuple(name for name in data.CORRUPTIONS if name != self.held_out)


def all_runs(held_out: Sequence[str], seeds: int) -> list[Run]:
    """Return the runs of every seed: no augmentation, and it without each of `held_out`."""
    return [Run(name, seed) for seed in range(seeds) for name in (None, *held_out)]


def fingerprint(folder: Path, settings: train.Settings) -> str:
    """Return a hash of the pages, the settings, this code, torch and the library."""
    code = [Path(m.__file__ or "").read_text() for m in (data, model, train)]
    specs = [repr(spec) for spec in data.CORRUPTIONS.values()]
    made_by = json.loads((folder / "pages.json").read_text())["made_by"]
    parts = [made_by, json.dumps(asdict(settings)), torch.__version__, *specs, *code]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:16]


def perform(
    folder: Path, runs: Sequence[Run], settings: train.Settings, jobs: int
) -> dict[Run, dict[str, Any]]:
    """Return the results of the runs; those that `folder` holds already are read.

    A result is `seconds`, `loss` (mean of the last 20 steps) and, for each split, each condition's
    `train.evaluate`, as lists.
    """
    path = folder / "results" / fingerprint(folder, settings)
    path.mkdir(parents=True, exist_ok=True)
    missing = [run for run in runs if not _file(path, run).exists()]
    if missing:
        _shared[:] = pages.load(folder)
    if jobs == 1:
        for run in missing:
            _perform(path, run, settings)
    elif missing:
        fork = multiprocessing.get_context("fork")
        with ProcessPoolExecutor(jobs, mp_context=fork) as pool:
            started = [pool.submit(_perform, path, run, settings) for run in missing]
            for item in started:
                item.result()
    return {run: json.loads(_file(path, run).read_text()) for run in runs}


def _file(place: Path, run: Run) -> Path:
    return place / f"{run.held_out or 'none'}-{run.seed}.json"


def _perform(place: Path, run: Run, settings: train.Settings) -> None:
    torch.set_num_threads(1)
    start = time.perf_counter()
    net, losses = train.train(_pages_of("train"), run.names, run.seed, settings)
    entries: dict[str, Any] = {
        "seconds": time.perf_counter() - start,
        "loss": statistics.fmean(losses[-20:]),
    }
    for split in SPLITS:
        entries[split] = _evaluated(net, _pages_of(split))
    text = f"{run}: {entries['seconds']:.0f} s, loss {losses[0]:.2f} to {entries['loss']:.2f}"
    print(text, file=sys.stderr, flush=True)
    unfinished = _file(place, run).with_suffix(".tmp")
    unfinished.write_text(json.dumps(entries))
    unfinished.replace(_file(place, run))


def _pages_of(split: str) -> list[pages.Page]:
    return [page for page in _shared if page.split == split]


def _evaluated(net: model.Grounder, some: list[pages.Page]) -> dict[str, Any]:
    """Return asked and hit of each page, under each condition."""
    entries: dict[str, Any] = {}
    for condition in CONDITIONS:
        corruption = None if condition == CLEAN else condition
        entries[condition] = train.evaluate(net, some, corruption).tolist()
    return entries


def counts(
    results: dict[Run, dict[str, Any]], held_out: str | None, split: str, condition: str
) -> np.ndarray:
    """Return asked and hit of one choice of corruptions by seed, int64 `[seeds, pages, 2]`."""
    group_runs = [run for run in results if run.held_out == held_out]
    group_runs.sort(key=lambda run: run.seed)
    return np.array([results[run][split][condition] for run in group_runs], np.int64)
