"""What makes the shards of a build: the type of an engine, and the engines by name."""

from collections.abc import Callable, Generator, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

from hijack_data.registry import Registry

from ..choices import LOCAL
from ..dataset.shard import ShardRecord
from ..errors import BuildError
from .shards import ShardTask
from .step_rows import RowSettings

Tick: TypeAlias = Callable[[int], None]
# Called with tasks, settings, output folder, workers and `tick`; yields the record of each task, in
# any order. `tick` must be called with the number of rows processed.
Engine: TypeAlias = Callable[
    [Iterable[ShardTask], RowSettings, Path, int, Tick], Generator[ShardRecord]
]
RAY = "ray"


def _problems(engine: Any, _: str) -> Iterator[str]:
    """Yield what is wrong with an engine."""
    if not callable(engine):
        yield "an engine is a function of (tasks, settings, folder, workers, tick)"


ENGINES = Registry[Engine](
    "engine",
    "engines",
    builtin={LOCAL: "pipelines.engines.local:run", RAY: "pipelines.engines.ray:run"},
    problems=_problems,
)
register = ENGINES.register


def get_engine(name: str, ray_address: str | None = None) -> Engine:
    """Return the engine with a name.

    Args:
        name: `"local"`, `"ray"`, or that of a plug-in.
        ray_address: names a running Ray cluster; see `pipelines.engines.ray`.

    Raises:
        BuildError: an address is given for another engine than Ray.
        PluginError: the plug-in of the engine cannot be loaded.
        UnknownNameError: there is no such engine; the message has the closest name.
    """
    run: Any = ENGINES.get(name)
    if name == RAY:
        return partial(run, address=ray_address)
    if ray_address is not None:
        raise BuildError(
            f"ray_address {ray_address!r} is for engine='ray' (--engine ray), not for {name!r}"
        )
    return run
