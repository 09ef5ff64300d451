"""Engines: where the episodes of a run are played, on this machine or on those of a cluster.

All that decides a result is the same with every engine; the runner's process writes the journal.
"""

from contextlib import AbstractContextManager
from typing import Protocol

from hijack_data.errors import ParameterError, UnknownNameError, suggest

from .jobs import Job
from .records import ResultRecord
from .workers import LocalPool, WorkerSetup, default_desktops

LOCAL = "local"
RAY = "ray"
ENGINES = (LOCAL, RAY)
MOST = 256  # desktops of a run


class EpisodePool(Protocol):
    """Desktops that play episodes side by side; used in a `with` statement."""

    desktops: int  # how many there are, or can be at once, when the run begins
    most: int  # how many threads may call it at once

    def place(self) -> AbstractContextManager[object]:
        """Return a context that is entered once a desktop is free for the calling thread."""
        ...

    def __call__(self, job: Job, attempt: int) -> ResultRecord:
        """Play an episode, within `place`, and return its record.

        If its process ends over it, the record is an error of the machine's, which is tried again.
        Errors that refuse the episode are raised here as they were there.
        """
        ...

    def stop(self) -> None:
        """End all desktops; those that play break their episodes off."""
        ...


def open_pool(
    engine: str,
    setup: WorkerSetup,
    episodes: int,
    desktops: int | None = None,
    ray_address: str | None = None,
) -> AbstractContextManager[EpisodePool]:
    """Return the desktops of a run.

    Args:
        engine: `"local"`, processes of this machine, or `"ray"`.
        setup: What a process needs.
        episodes: How many are to be played; there are never more desktops.
        desktops: The most of them. By default as many as this machine has room for, or the nodes
            of a cluster.
        ray_address: A running cluster; see `pipelines.engines.ray_connection.session`.

    Raises:
        UnknownNameError: There is no such engine.
        ParameterError: An address without Ray.
    """
    if engine not in ENGINES:
        raise UnknownNameError(f"unknown engine {engine!r}{suggest(engine, ENGINES)}")
    if engine == RAY:
        from .ray_pool import RayPool, is_started_here

        room = default_desktops() if is_started_here(ray_address) else MOST
        return RayPool(setup, min(desktops or room, episodes), ray_address)
    if ray_address is not None:
        raise ParameterError(f"--ray-address {ray_address} is for --engine ray, not for {engine!r}")
    return LocalPool(setup, min(desktops or default_desktops(), episodes))
