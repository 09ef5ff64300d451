"""Make shards in this process, or in several on this machine."""

import multiprocessing
import os
import pickle
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

from ..building.shards import ONE_THREAD, ShardTask, build_shard
from ..building.step_rows import RowSettings
from ..dataset.shard import ShardRecord
from ..errors import RESUME, BuildError
from ..worker_processes import begin_worker

# Tasks queued for each worker: enough that no worker idles, few enough that the source is not read
# into memory.
QUEUED_TASKS_PER_WORKER = 2


def run(
    tasks: Iterable[ShardTask],
    settings: RowSettings,
    out: Path,
    workers: int,
    tick: Callable[[int], None],
) -> Generator[ShardRecord]:
    """Yield the record of each task, in any order.

    Args:
        tasks: the shards, read from the source on demand.
        settings: those of the build.
        out: the folder of the dataset.
        workers: number of processes; 1 is this one.
        tick: called with the number of rows processed.

    Raises:
        BuildError: the corruptions cannot be sent to a worker, a worker died, or this machine
            allows none.
    """
    if workers == 1:
        for task in tasks:
            yield build_shard(task, settings, out, tick)
        return
    _check_picklable(settings)
    with _make_pool(workers) as pool:
        try:
            submit = partial(pool.submit, partial(build_shard, settings=settings, out=out))
            for task, record in _bounded(submit, iter(tasks), workers * QUEUED_TASKS_PER_WORKER):
                tick(task.steps * settings.variants)
                yield record
        except BrokenProcessPool:
            raise BuildError(
                "a worker process died (out of memory, killed, or a script that builds without `if"
                f" __name__ == '__main__':`); finished shards are kept: build again with {RESUME}"
            ) from None
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _make_pool(workers: int) -> ProcessPoolExecutor:
    context = multiprocessing.get_context("spawn")
    try:
        return ProcessPoolExecutor(workers, context, initializer=_start_worker)
    except (
        OSError,
        ImportError,
        NotImplementedError,
    ) as error:  # it needs semaphores, which are in /dev/shm
        raise BuildError(
            f"there can be no worker processes here ({error}); make /dev/shm writable, or use"
            " workers=1 (--workers 1)"
        ) from None


def _bounded(
    submit: Callable[[ShardTask], "Future[Any]"], tasks: Iterator[ShardTask], limit: int
) -> Iterator[Any]:
    """Keep at most `limit` tasks in flight; yield each with its result when it is done."""
    pending = {submit(task): task for task in islice(tasks, limit)}
    while pending:
        finished, _ = wait(pending, return_when=FIRST_COMPLETED)
        for future in finished:
            yield pending.pop(future), future.result()
            pending.update((submit(task), task) for task in islice(tasks, 1))


def _check_picklable(settings: RowSettings) -> None:
    try:
        pickle.dumps(settings)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise BuildError(
            f"the corruptions cannot be sent to worker processes ({error}); use workers=1, or"
            " functions that a module defines instead of lambdas"
        ) from None


def _start_worker() -> None:
    os.environ.update(ONE_THREAD)
    begin_worker()
