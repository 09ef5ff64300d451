"""Make shards on a Ray cluster, with Ray Data.

Ray Data needs all items before it starts, and a source may be larger than memory. So shards are
processed in waves, and the next wave is read from the source while the present one is made. Waves
grow from `FIRST_WAVE_SHARDS` to `MAX_WAVE_SHARDS` per worker, so that the idle time at the end of
each wave does not matter. Only tasks and records pass through Ray: a worker writes its file itself,
into a folder that all machines share, and renames it when it is complete. So it is harmless if Ray
makes a shard twice, as it does when a process or a machine dies.
"""

import os
import pickle
import secrets
from collections.abc import Callable, Generator, Iterable
from contextlib import closing
from itertools import islice
from pathlib import Path
from typing import Any

from hijack_data.errors import HijackError
from hijack_data.file_io import write_atomic
from hijack_data.pack import VARIABLE

from ..building.row_settings import pack_identity
from ..building.shards import ONE_THREAD, ShardTask
from ..building.step_rows import RowSettings
from ..dataset.manifest import STATE, libraries
from ..dataset.shard import ShardRecord
from ..errors import RESUME, BuildError
from .ray_data import data_options, session, without_warnings
from .remote_worker import GUIDE, TOKEN, ShardJob, make, wait_until

FIRST_WAVE_SHARDS = 4
MAX_WAVE_SHARDS = 32
# How often a shard is retried after its process or machine died or ran out of memory.
RETRIES = 4


def run(
    tasks: Iterable[ShardTask],
    settings: RowSettings,
    out: Path,
    workers: int,
    tick: Callable[[int], None],
    address: str | None = None,
) -> Generator[ShardRecord]:
    """Yield the record of each task, in any order.

    Args:
        tasks: the shards, taken from the source as they are needed.
        settings: those of the build.
        out: the output folder, which every node must see under this path.
        workers: shards that are made at the same time, each on one CPU of the cluster.
        tick: called with the number of rows of each shard when it is done.
        address: a running cluster, `"auto"` for that of this machine. By default that of
            `RAY_ADDRESS`, or a cluster of `workers` CPUs on this machine that is started and
            stopped here. If the caller has started Ray, that connection is used.

    Raises:
        BuildError: there is no cluster, a node does not share the folders or has other libraries,
            or a shard kept killing its process.
        MissingDependencyError: Ray is not installed.
    """
    source = iter(tasks)
    wave = list(islice(source, FIRST_WAVE_SHARDS * workers))
    if not wave:
        return
    job = _make_job(settings, Path(os.path.abspath(out)))
    with session(workers, address) as ray:
        _check_sendable(ray, settings)
        limit = FIRST_WAVE_SHARDS * workers
        while wave:
            limit = min(2 * limit, MAX_WAVE_SHARDS * workers)
            following: list[ShardTask] = []
            with closing(_make_shards(ray, wave, job, workers)) as records:
                for record in records:
                    tick(record.steps * settings.variants)
                    yield record
                    following += islice(source, min(2, limit - len(following)))
            wave = following


def _make_job(settings: RowSettings, out: Path) -> ShardJob:
    token = secrets.token_hex(16)
    write_atomic(out / STATE / TOKEN, token)
    environment = ONE_THREAD | {
        name: os.environ[name] for name in (VARIABLE,) if name in os.environ
    }
    return ShardJob(
        settings, out, token, libraries(settings.detect), pack_identity(settings), environment
    )


def _check_sendable(ray: Any, settings: RowSettings) -> None:
    try:
        ray.cloudpickle.dumps(settings)
    except (pickle.PicklingError, AttributeError, TypeError, RecursionError) as error:
        raise BuildError(
            f"the corruptions cannot be sent to other processes ({error}); use planners that hold"
            " no open files, locks or the like"
        ) from None


def _make_shards(
    ray: Any, wave: list[ShardTask], job: ShardJob, workers: int
) -> Generator[ShardRecord]:
    # makes the shards of a wave with Ray Data, and yields their records as they arrive
    with data_options(ray):
        items = ray.data.from_items(
            [{"task": task} for task in wave], override_num_blocks=len(wave)
        )
        shards = items.map(
            make,
            fn_kwargs={"job": job},
            compute=ray.data.TaskPoolStrategy(size=min(workers, len(wave))),
            num_cpus=1,
            max_retries=RETRIES,
        )
    try:
        for row in without_warnings(shards.iter_rows()):
            yield _record(row["made"], row["node"], job.out)
    except ray.exceptions.RayError as error:
        raise BuildError(_failure(ray, error)) from None


def _record(result: ShardRecord | HijackError, node: str, out: Path) -> ShardRecord:
    # returns the record of a shard after its file is visible on this machine
    if isinstance(result, HijackError):
        raise result
    file = out / result.file
    if not wait_until(lambda: file.is_file() and file.stat().st_size == result.bytes):
        raise BuildError(
            f"{file}: the node {node} wrote this file, but it is not here; the output must lie in a"
            f" folder that all nodes share under one path ({GUIDE})"
        )
    return result


def _failure(ray: Any, error: BaseException) -> str:
    text = str(error).partition("\n\nThe above exception")[0].strip() or type(error).__name__
    reason = text.splitlines()[-1]
    if isinstance(error, ray.exceptions.RayTaskError):
        failure = f"a worker failed with an error ({reason})"
    else:
        failure = (
            f"a shard was given up after {RETRIES + 1} workers died over it"
            f" ({type(error).__name__}: {reason})"
        )
    return f"{failure}; finished shards are kept: build again with {RESUME}"
