"""A temporary connection to Ray, without log output and without usage reports."""

import importlib
import logging
import os
import shutil
import socket
import sys
import threading
import warnings
from collections.abc import Generator
from contextlib import contextmanager, redirect_stdout
from typing import IO, Any, cast

from hijack_data import extras
from hijack_data.errors import HijackError

LOCAL = "local"
# Seconds for the first answer of a cluster.
CONNECT_TIMEOUT_S = 10.0
# The objects in it are small, and Ray spills to disk what does not fit.
STORE_BYTES = 200 * 2**20
ENVIRONMENT = {
    "RAY_USAGE_STATS_ENABLED": "0",
    # avoids a warning about a change in later versions
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",
}


@contextmanager
def session(
    cpus: int,
    address: str | None = None,
    *,
    memory: int | None = None,
    modules: tuple[str, ...] = (),
    error: type[HijackError] = HijackError,
) -> Generator[Any]:
    """Connect to a Ray cluster, or start one, and yield the module `ray`.

    Args:
        cpus: processors of a cluster that is started here.
        address: a running cluster, `"auto"` for that of this machine. By default that of
            `RAY_ADDRESS`, or one that is started and ended here. Ray that the caller started is
            used as it is.
        memory: bytes that actors and tasks of a cluster that is started here may ask for; by
            default what Ray finds.
        modules: further modules of Ray to import, such as `"ray.data"`.
        error: the class of the error if the cluster cannot be used.

    Raises:
        MissingDependencyError: Ray is not installed.
    """
    ray = _import(modules)
    with _quiet():
        if ray.is_initialized():
            yield ray
            return
        cluster_address = resolve_address(address)
        options: dict[str, Any] = {"log_to_driver": False, "logging_level": logging.CRITICAL}
        if cluster_address == LOCAL:
            options |= {
                "num_cpus": cpus,
                "include_dashboard": False,
                "object_store_memory": STORE_BYTES,
                "_memory": memory,
            }
        logs = _init(ray, cluster_address, options, error)
        try:
            yield ray
        finally:
            ray.shutdown()
        if cluster_address == LOCAL:
            shutil.rmtree(logs, ignore_errors=True)  # the logs stay after a failure


def resolve_address(address: str | None) -> str:
    """Return the address to use: the given one, else that of `RAY_ADDRESS`, else `LOCAL`."""
    return address or os.environ.get("RAY_ADDRESS") or LOCAL


def _import(modules: tuple[str, ...]) -> Any:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            ray = importlib.import_module("ray")
            for module in modules:
                importlib.import_module(module)
    except ImportError:
        raise extras.missing("engine 'ray' needs Ray", "ray") from None
    return ray


def _init(ray: Any, address: str, options: dict[str, Any], error: type[HijackError]) -> str:
    # connects to a cluster, or starts one, and returns its folder of logs
    try:
        _check_address(address)
        return str(ray.init(address=address, **options).address_info["session_dir"])
    except (ConnectionError, RuntimeError, ValueError, OSError, ray.exceptions.RayError) as why:
        reason = next(iter(str(why).splitlines()), type(why).__name__)
        raise error(f"Ray at {address!r} cannot be used: {reason}") from None


def _check_address(address: str) -> None:
    # raises `ValueError` or `OSError` in cases where Ray itself would retry for minutes
    if address.startswith("ray://"):
        raise ValueError(
            "Ray clients are not served; use a machine of the cluster, with 'auto' or HOST:PORT"
        )
    host, _, port = address.rpartition(":")
    if host and port.isdecimal():
        socket.create_connection((host, int(port)), CONNECT_TIMEOUT_S).close()


@contextmanager
def _quiet() -> Generator[None]:
    """Suppress Ray's log lines, and keep its messages on dead processes off standard output."""
    loggers = [logging.getLogger(name) for name in ("ray", "ray.data")]
    levels = [logger.level for logger in loggers]
    added_variables = {name: value for name, value in ENVIRONMENT.items() if name not in os.environ}
    os.environ.update(added_variables)
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        with redirect_stdout(cast("IO[str]", _Output(sys.stdout))):
            yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
        for name in added_variables:
            os.environ.pop(name, None)


class _Output:
    """Standard output without the messages from Ray's own threads.

    They become one line each on standard error: the output of `hijack build --json` is JSON alone.
    """

    def __init__(self, stream: IO[str]) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write `text`; a message from Ray is shortened to its beginning, on standard error."""
        if not threading.current_thread().name.startswith("ray_"):
            return self._stream.write(text)
        first = text.strip().partition("\n")[0]
        if first and not text.startswith(" "):
            sys.stderr.write(f"{first[:200]}\n")
        return len(text)
