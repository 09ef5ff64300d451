"""Engines, which play the episodes of a run on this machine or on a cluster.

Results do not depend on the engine; the runner's process writes the journal.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Protocol

from hijack_data.errors import ParameterError, UnknownNameError, suggest

from ..results.records import ResultRecord
from .jobs import Job
from .machine_pool import MachinePool
from .workers import LocalPool, WorkerSetup, default_desktops

LOCAL = "local"
RAY = "ray"
ENGINES = (LOCAL, RAY)
MAX_DESKTOPS = 256  # desktops of a run


class EpisodePool(Protocol):
    """Desktops that play episodes side by side; used in a `with` statement."""

    desktops: int  # number of desktops, or the most at once, when the run begins
    max_episodes: int  # number of threads that may call the pool at once

    def reserve(self) -> AbstractContextManager[object]:
        """Return a context that is entered once a desktop is free for the calling thread."""
        ...

    def __call__(self, job: Job, attempt: int) -> ResultRecord:
        """Play an episode, within `reserve`, and return its record.

        If the process dies during the episode, the record is an error of the machine, and the
        episode is retried. Errors that refuse the episode are raised here again.
        """
        ...

    def stop(self) -> None:
        """End all desktops, interrupting the episodes that are being played."""
        ...


def open_pool(
    engine: str,
    setup: WorkerSetup,
    episodes: int,
    desktops: int | None = None,
    ray_address: str | None = None,
    notice: Callable[[str], object] = lambda _: None,
) -> AbstractContextManager[EpisodePool]:
    """Return the pool of desktops of a run.

    Args:
        engine: `"local"`, processes of this machine, or `"ray"`.
        setup: The settings for a process.
        episodes: How many episodes will be played; there are never more desktops than that.
        desktops: The most of them. By default as many as fit on this machine, or on the nodes of a
            cluster.
        ray_address: A running cluster; see `pipelines.engines.ray_connection.session`.
        notice: Called with lines for the user.

    Raises:
        UnknownNameError: There is no such engine.
        ParameterError: An address is given for another engine than Ray.
    """
    if engine not in ENGINES:
        raise UnknownNameError(f"unknown engine {engine!r}{suggest(engine, ENGINES)}")
    if engine == RAY:
        from .ray_pool import RayPool, is_started_here

        room = default_desktops() if is_started_here(ray_address) else MAX_DESKTOPS
        return RayPool(setup, min(desktops or room, episodes), ray_address)
    if ray_address is not None:
        raise ParameterError(f"--ray-address {ray_address} is for --engine ray, not for {engine!r}")
    if setup.bench.machines is not None:
        return MachinePool(setup, min(desktops or MAX_DESKTOPS, episodes), notice)
    return LocalPool(setup, min(desktops or default_desktops(), episodes))
