"""Check that a plan depends on its key alone: seed, sample, step and epoch."""

import random
from collections.abc import Generator, Iterable, Sequence
from contextlib import contextmanager
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt

from ..corruption import Corruption
from ..rng import Stream
from . import fresh_processes
from .base import expect
from .cases import SIZES, levels, scene

KEYS = tuple(product((0, 1), ("a", "b", 3), (0, 1)))  # seed, sample, epoch
FRESH_KEYS = ((0, "a", 0), (5, "a", 0), (0, 7, 0), (0, "a", 1))
MANY = 32


def check_deterministic(cls: type[Corruption]) -> None:
    """The key alone decides, not the order of planning, global generators or earlier plans."""
    with _generators_kept():
        _check_generators(cls)


def _check_generators(cls: type[Corruption]) -> None:
    screen = scene(SIZES[0])
    one = [cls()] * len(KEYS)
    _seed_generators(1)
    python = random.getstate()
    legacy = _legacy()
    first = _digests(one, KEYS, screen)
    advice = "global generator; use the stream"
    expect(random.getstate() == python, f"planning draws from Python's {advice}")
    expect(np.array_equal(legacy, _legacy()), f"planning draws from NumPy's {advice}")
    _seed_generators(99)
    again = _digests(one, KEYS[::-1], screen)
    advice = "depends on the order of planning or on a global generator"
    expect(again == first, f"the plan {advice}: {_first_difference(first, again)}")
    others = _digests([cls() for _ in KEYS], KEYS, screen)
    advice = "depends on what another instance did before: keep nothing between plans"
    expect(others == first, f"the plan {advice}: {_first_difference(first, others)}")


def _seed_generators(seed: int) -> None:
    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002


def _digests(specs: Iterable[Corruption], keys: Sequence[Any], screen: Any) -> dict[Any, str]:
    found: dict[Any, str] = {}
    for spec, (seed, sample, epoch) in zip(specs, keys, strict=True):
        plan = spec.plan(screen, seed=seed, sample=sample, epoch=epoch)
        found[seed, sample, epoch] = plan.digest()
    return found


def _first_difference(one: dict[Any, str], other: dict[Any, str]) -> str:
    differing = [key for key in KEYS if one[key] != other[key]]
    seed, sample, epoch = differing[0] if differing else KEYS[0]
    return f"first at seed={seed}, sample={sample!r}, epoch={epoch}"


@contextmanager
def _generators_kept() -> Generator[None]:
    """Put the global generators back as they were."""
    python = random.getstate()
    legacy = np.random.get_state()  # noqa: NPY002
    try:
        yield
    finally:
        random.setstate(python)
        np.random.set_state(legacy)  # noqa: NPY002


def _legacy() -> Any:
    state: Any = np.random.get_state()  # noqa: NPY002
    return np.append(state[1], state[2])


class _Counting(Stream):
    """A stream that counts how often it is drawn from."""

    drawn = 0

    def word(self) -> int:
        self.drawn += 1
        return super().word()

    def integers(self, ranges: Sequence[tuple[int, int]], count: int) -> npt.NDArray[np.int64]:
        self.drawn += 1
        return super().integers(ranges, count)


def check_seed(cls: type[Corruption]) -> list[str]:
    """If a corruption draws from the stream, different seeds give different plans."""
    spec = cls()
    screen = scene(SIZES[0])
    found = {spec.plan(screen, seed=0, sample="seed").digest()}
    for seed in range(1, MANY):
        found.add(spec.plan(screen, seed=seed, sample="seed").digest())
        if len(found) > 1:
            return []
    stream = _Counting(0, spec.id, "seed", spec.first_step(), 0)
    spec.make_plan(screen, stream, spec.first_step())
    if not stream.drawn:
        return []
    return [f"it draws from the stream, but {MANY} seeds give one and the same plan: is it used?"]


def check_processes(cls: type[Corruption]) -> list[str]:
    """A fresh process with another hash seed, folder, time zone and order makes the same plans."""
    jobs = _jobs(cls)
    reason = fresh_processes.unpicklable_reason(cls)
    if reason:
        return [f"not tried in a fresh process: {reason}"]
    here = [fresh_processes.digest(job) for job in jobs]
    for world, there in fresh_processes.digests(jobs):
        differing = sum(a != b for a, b in zip(here, there, strict=True))
        expect(
            not differing,
            f"{differing} of {len(jobs)} plans differ in a fresh process ({world}): they "
            "depend on the process, on hash(), the order of a set, the folder, the time or on what "
            "was planned before; use the stream, sorted(...) and the scene alone",
        )
    return []


def _jobs(cls: type[Corruption]) -> list[fresh_processes.PlanRequest]:
    large = scene(SIZES[0])
    small = scene(SIZES[1])
    tried = [(cls(), large), (cls(), small)]
    tried += [(spec, large) for spec in levels(cls)]
    jobs: list[fresh_processes.PlanRequest] = []
    for spec, screen in tried:
        for seed, sample, epoch in FRESH_KEYS:
            key = {"seed": seed, "sample": sample, "epoch": epoch}
            jobs.append(fresh_processes.PlanRequest(spec, screen, key))
    return jobs
