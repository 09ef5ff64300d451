"""Plan in fresh processes that differ in everything that must not affect a plan.

These are the hash seed, the folder, the time zone, and the order of the plans.
"""

import json
import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

from ..corruption import Corruption
from ..errors import ParameterError
from ..types import Scene
from . import planning_process
from .base import fail

TIMEOUT = 120.0  # seconds
# Several, because a small set often has the same order under two hash seeds. The dates of the two
# time zones always differ.
PROCESS_ENVIRONMENTS: tuple[Mapping[str, str], ...] = (
    {"PYTHONHASHSEED": "0", "TZ": "Pacific/Kiritimati"},
    {"PYTHONHASHSEED": "1", "TZ": "Etc/GMT+12"},
    {"PYTHONHASHSEED": "2", "TZ": "Pacific/Kiritimati"},
    {"PYTHONHASHSEED": "3", "TZ": "Etc/GMT+12"},
)


class PlanRequest(NamedTuple):
    """One plan to make; `key` holds the arguments of `plan` other than the scene."""

    spec: Corruption
    scene: Scene
    key: Mapping[str, Any]


def unpicklable_reason(cls: type[Corruption]) -> str:
    """Return why another process cannot find a class, or `""` if it can.

    If the class is found but a corruption of it cannot be sent there, the check fails with
    `CheckFailed`.
    """
    if cls.__module__ == "__main__":
        return "the class belongs to a script or session; put it into a module or a file of its own"
    try:
        pickle.dumps(cls)
    except (pickle.PicklingError, AttributeError) as error:
        return f"the class cannot be found there ({error}); put it at the top of a module"
    try:
        pickle.dumps(cls())
    except Exception as error:  # noqa: BLE001  (pickling runs code of the plug-in)
        fail(f"it cannot be sent to worker processes: {type(error).__name__}: {error}")
    return ""


def digest(job: PlanRequest) -> str:
    """Return the digest of a plan as `planning_process.digest` does; raise unless a screen is refused."""
    try:
        return job.spec.plan(job.scene, **job.key).digest()
    except ParameterError as error:
        return type(error).__name__


def digests(jobs: Sequence[PlanRequest]) -> Iterator[tuple[str, list[str]]]:
    """Yield, for each fresh process, a description of it and the digests of `jobs`."""
    with tempfile.TemporaryDirectory() as folder, ExitStack() as ending:
        started: list[subprocess.Popen[bytes]] = []
        for number, world in enumerate(PROCESS_ENVIRONMENTS):
            order = _order(len(jobs), number)
            request = Path(folder, f"{number}.pickle")
            request.write_bytes(_request([jobs[i] for i in order]))
            process = ending.enter_context(_start(request, world, folder))
            ending.callback(process.kill)  # if nobody waited for its answer
            started.append(process)
        for number, (world, process) in enumerate(zip(PROCESS_ENVIRONMENTS, started, strict=True)):
            order = _order(len(jobs), number)
            found = dict(zip(order, _answer(process), strict=True))
            named = ", ".join(f"{key}={value}" for key, value in world.items())
            yield named, [found[i] for i in range(len(jobs))]


def _order(count: int, number: int) -> list[int]:
    """Return the order of the jobs for a process: each process starts with another job."""
    order = list(range(count))
    if number % 2:
        order.reverse()
    turned = number * count // len(PROCESS_ENVIRONMENTS)
    return order[turned:] + order[:turned]


def _request(jobs: Sequence[PlanRequest]) -> bytes:
    """Return a line with the import path, then the jobs: unpickling them imports the plug-in."""
    path = json.dumps([_path_entry(entry) for entry in sys.path])
    pickled = pickle.dumps([tuple(job) for job in jobs])
    return path.encode() + b"\n" + pickled


def _path_entry(entry: str) -> str:
    """Return an entry of the import path in a form that is valid in any folder."""
    if entry and not os.path.exists(entry):  # not a path, but an installer's import hook
        return entry
    return os.path.abspath(entry)


def _start(request: Path, world: Mapping[str, str], folder: str) -> subprocess.Popen[bytes]:
    optimised = [f"-{'O' * sys.flags.optimize}"] if sys.flags.optimize else []
    with request.open("rb") as file:
        return subprocess.Popen(
            [sys.executable, *optimised, "-P", planning_process.__file__],
            stdin=file,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            cwd=folder,
            env={**os.environ, **world},
        )


def _answer(process: subprocess.Popen[bytes]) -> list[str]:
    try:
        out, said = process.communicate(timeout=TIMEOUT)
    except subprocess.TimeoutExpired:
        fail(f"planning in a fresh process takes more than {TIMEOUT:g} seconds")
    if process.returncode:
        lines = said.decode(errors="replace").strip().splitlines()
        reason = lines[-1] if lines else f"exit code {process.returncode}"
        fail(f"a fresh process cannot use it, so neither can workers: {reason}")
    return json.loads(out)
