"""Engines: where the shards of a build are made. Every engine makes the same files."""

from collections.abc import Callable, Generator, Iterable
from functools import partial
from pathlib import Path
from typing import TypeAlias

from hijack_data.errors import UnknownNameError, suggest

from ..errors import BuildError
from ..rows import Settings
from ..shards import ShardRecord, ShardTask

ENGINES = ("local", "ray")
Tick: TypeAlias = Callable[[int], None]
Engine: TypeAlias = Callable[[Iterable[ShardTask], Settings, Path, int, Tick], Generator[ShardRecord]]


def get_engine(name: str, ray_address: str | None = None) -> Engine:
    """Return the engine of a name: a function of tasks, settings, output folder, workers and `tick` that yields the
    record of each task, in any order.

    `ray_address` names a running Ray cluster; see `pipelines.engines.ray`. Raises `UnknownNameError`, and `BuildError`
    for an address without Ray.
    """
    if name == "ray":
        from . import ray

        return partial(ray.run, address=ray_address)
    if name != "local":
        raise UnknownNameError(f"engine {name!r} is not known{suggest(name, ENGINES)}")
    if ray_address is not None:
        raise BuildError(f"ray_address {ray_address!r} is for engine='ray' (--engine ray), not for 'local'")
    from . import local

    return local.run
