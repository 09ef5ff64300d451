"""A connection to Ray that is quiet, sends nothing home, and is closed again."""

import logging
import os
import shutil
import socket
import sys
import threading
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, redirect_stdout
from typing import IO, Any, TypeVar, cast

from hijack_data import extras

from ..errors import BuildError

T = TypeVar("T")
LOCAL = "local"
# Seconds for the first answer of a cluster.
TIMEOUT = 10.0
# Tasks and records are small, and Ray writes to disk what does not fit.
STORE_BYTES = 200 * 2**20
ENVIRONMENT = {
    "RAY_USAGE_STATS_ENABLED": "0",
    # its change in later versions is announced by a warning
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",
}
# Ray Data plans for blocks of 128 MB a task, which a small store has no room for; ours are some kB.
OPTIONS = {
    "enable_progress_bars": False,
    "print_on_execution_start": False,
    "target_max_block_size": 2**20,
}


@contextmanager
def session(workers: int, address: str | None = None) -> Iterator[Any]:
    """Connect to a Ray cluster, or start one, and yield the module `ray`.

    The arguments are those of `pipelines.engines.ray.run`.
    """
    ray = _ray()
    with _quiet():
        if ray.is_initialized():
            yield ray
            return
        address = address or os.environ.get("RAY_ADDRESS") or LOCAL
        logs = _init(ray, workers, address)
        try:
            yield ray
        finally:
            ray.shutdown()
        if address == LOCAL:
            shutil.rmtree(logs, ignore_errors=True)  # they stay where something went wrong


@contextmanager
def data_options(ray: Any) -> Iterator[None]:
    """Set the options of datasets that are made inside, and set them back."""
    with warnings.catch_warnings():
        # Ray's own defaults call Ray's deprecated names
        warnings.simplefilter("ignore", DeprecationWarning)
        context = ray.data.DataContext.get_current()
        before = {name: getattr(context, name) for name in OPTIONS if hasattr(context, name)}
        _set(context, {name: OPTIONS[name] for name in before})
        try:
            yield
        finally:
            _set(context, before)


def without_warnings(rows: Iterable[T]) -> Iterator[T]:
    """Yield from `rows`; Ray's advice to its own callers is not for ours."""
    iterator = iter(rows)
    while True:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                row = next(iterator)
            except StopIteration:
                return
        yield row


def _set(context: Any, values: dict[str, Any]) -> None:
    for name, value in values.items():
        setattr(context, name, value)


def _ray() -> Any:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import ray
            import ray.data
    except ImportError:
        raise extras.missing("engine 'ray' needs Ray", "ray") from None
    return ray


def _init(
    ray: Any,
    workers: int,
    address: str,
) -> str:
    # connect to a cluster, or start one, and return its folder of logs
    options: dict[str, Any] = {"log_to_driver": False, "logging_level": logging.CRITICAL}
    if address == LOCAL:
        options |= {
            "num_cpus": workers,
            "include_dashboard": False,
            "object_store_memory": STORE_BYTES,
        }
    try:
        _check_address(address)
        return ray.init(address=address, **options).address_info["session_dir"]
    except (ConnectionError, RuntimeError, ValueError, OSError, ray.exceptions.RayError) as error:
        reason = next(iter(str(error).splitlines()), type(error).__name__)
        raise BuildError(f"Ray at {address!r} cannot be used: {reason}") from None


def _check_address(address: str) -> None:
    # raise `ValueError` or `OSError` where Ray itself would try for minutes
    if address.startswith("ray://"):
        raise ValueError(
            "Ray clients are not served; build on a machine of the cluster, with 'auto' or"
            " HOST:PORT"
        )
    host, _, port = address.rpartition(":")
    if host and port.isdecimal():
        socket.create_connection((host, int(port)), TIMEOUT).close()


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep Ray's log lines away, and what it prints about dead processes off standard output."""
    loggers = [logging.getLogger(name) for name in ("ray", "ray.data")]
    levels = [logger.level for logger in loggers]
    added = {name: value for name, value in ENVIRONMENT.items() if name not in os.environ}
    os.environ.update(added)
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        with redirect_stdout(cast("IO[str]", _Output(sys.stdout))):
            yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
        for name in added:
            os.environ.pop(name, None)


class _Output:
    """Standard output without the messages of Ray's own threads.

    They become one line each on standard error: the output of `hijack build --json` is JSON alone.
    """

    def __init__(self, stream: IO[str]) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write `text`, or the beginning of a message of Ray's."""
        if not threading.current_thread().name.startswith("ray_"):
            return self._stream.write(text)
        first = text.strip().partition("\n")[0]
        if first and not text.startswith(" "):
            sys.stderr.write(f"{first[:200]}\n")
        return len(text)
