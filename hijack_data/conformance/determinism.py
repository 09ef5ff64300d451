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
SEEDS_TRIED = 32


def check_deterministic(cls: type[Corruption]) -> None:
    """The key alone decides, not the order of planning, global generators or earlier plans."""
    with _restored_generators():
        _check_keys(cls)


def _check_keys(cls: type[Corruption]) -> None:
    screen = scene(SIZES[0])
    same_instance = [cls()] * len(KEYS)
    _seed_generators(1)
    python_state = random.getstate()
    numpy_state = _numpy_state()
    expected = _digests(same_instance, KEYS, screen)
    expect(
        random.getstate() == python_state,
        "planning draws from Python's global generator; use the stream",
    )
    expect(
        np.array_equal(numpy_state, _numpy_state()),
        "planning draws from NumPy's global generator; use the stream",
    )
    _seed_generators(99)
    reversed_order = _digests(same_instance, KEYS[::-1], screen)
    expect(
        reversed_order == expected,
        "the plan depends on the order of planning or on a global generator: "
        + _first_difference(expected, reversed_order),
    )
    new_instances = _digests([cls() for _ in KEYS], KEYS, screen)
    expect(
        new_instances == expected,
        "the plan depends on what another instance did before: keep nothing between plans: "
        + _first_difference(expected, new_instances),
    )


def _seed_generators(seed: int) -> None:
    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002


def _digests(specs: Iterable[Corruption], keys: Sequence[Any], screen: Any) -> dict[Any, str]:
    digests: dict[Any, str] = {}
    for spec, (seed, sample, epoch) in zip(specs, keys, strict=True):
        plan = spec.plan(screen, seed=seed, sample=sample, epoch=epoch)
        digests[seed, sample, epoch] = plan.digest()
    return digests


def _first_difference(expected: dict[Any, str], digests: dict[Any, str]) -> str:
    differing = [key for key in KEYS if expected[key] != digests[key]]
    seed, sample, epoch = differing[0] if differing else KEYS[0]
    return f"first at seed={seed}, sample={sample!r}, epoch={epoch}"


@contextmanager
def _restored_generators() -> Generator[None]:
    """Restore the global generators' states at the end."""
    python = random.getstate()
    legacy = np.random.get_state()  # noqa: NPY002
    try:
        yield
    finally:
        random.setstate(python)
        np.random.set_state(legacy)  # noqa: NPY002


def _numpy_state() -> Any:
    state: Any = np.random.get_state()  # noqa: NPY002
    return np.append(state[1], state[2])


class _CountingStream(Stream):
    """A stream that counts its draws."""

    draws = 0

    def word(self) -> int:
        self.draws += 1
        return super().word()

    def integers(self, ranges: Sequence[tuple[int, int]], count: int) -> npt.NDArray[np.int64]:
        self.draws += 1
        return super().integers(ranges, count)


def check_seed(cls: type[Corruption]) -> list[str]:
    """If a corruption draws from the stream, different seeds give different plans."""
    spec = cls()
    screen = scene(SIZES[0])
    digests = {spec.plan(screen, seed=0, sample="seed").digest()}
    for seed in range(1, SEEDS_TRIED):
        digests.add(spec.plan(screen, seed=seed, sample="seed").digest())
        if len(digests) > 1:
            return []
    stream = _CountingStream(0, spec.id, "seed", spec.first_step(), 0)
    spec.make_plan(screen, stream, spec.first_step())
    if not stream.draws:
        return []
    return [
        f"it draws from the stream, but {SEEDS_TRIED} seeds give one and the same plan: is it used?"
    ]


def check_processes(cls: type[Corruption]) -> list[str]:
    """A fresh process with another hash seed, folder, time zone and order makes the same plans."""
    jobs = _plan_requests(cls)
    reason = fresh_processes.unpicklable_reason(cls)
    if reason:
        return [f"not tried in a fresh process: {reason}"]
    expected = [fresh_processes.digest(job) for job in jobs]
    for environment, digests in fresh_processes.digests(jobs):
        differing = sum(a != b for a, b in zip(expected, digests, strict=True))
        expect(
            not differing,
            f"{differing} of {len(jobs)} plans differ in a fresh process ({environment}): they "
            "depend on the process, on hash(), the order of a set, the folder, the time or on what "
            "was planned before; use the stream, sorted(...) and the scene alone",
        )
    return []


def _plan_requests(cls: type[Corruption]) -> list[fresh_processes.PlanRequest]:
    large = scene(SIZES[0])
    small = scene(SIZES[1])
    cases = [(cls(), large), (cls(), small)]
    cases += [(spec, large) for spec in levels(cls)]
    jobs: list[fresh_processes.PlanRequest] = []
    for spec, screen in cases:
        for seed, sample, epoch in FRESH_KEYS:
            key = {"seed": seed, "sample": sample, "epoch": epoch}
            jobs.append(fresh_processes.PlanRequest(spec, screen, key))
    return jobs
