"""A connection to Ray for builds, and the options of Ray Data."""

import warnings
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any, TypeVar

from ..errors import BuildError
from . import ray_connection

T = TypeVar("T")
# Ray Data plans for blocks of 128 MB per task, too large for a small object store; ours are some
# kB.
OPTIONS = {
    "enable_progress_bars": False,
    "print_on_execution_start": False,
    "target_max_block_size": 2**20,
}


def session(workers: int, address: str | None = None) -> AbstractContextManager[Any]:
    """Connect to a Ray cluster, or start one, and yield the module `ray`.

    The arguments are those of `pipelines.engines.ray.run`.
    """
    return ray_connection.session(workers, address, modules=("ray.data",), error=BuildError)


@contextmanager
def data_options(ray: Any) -> Iterator[None]:
    """Set the options for datasets made in the block, and restore the old ones afterwards."""
    with warnings.catch_warnings():
        # with its own defaults, Ray calls deprecated functions of Ray
        warnings.simplefilter("ignore", DeprecationWarning)
        context = ray.data.DataContext.get_current()
        before = {name: getattr(context, name) for name in OPTIONS if hasattr(context, name)}
        _set(context, {name: OPTIONS[name] for name in before})
        try:
            yield
        finally:
            _set(context, before)


def without_warnings(rows: Iterable[T]) -> Iterator[T]:
    """Yield from `rows` without Ray's warnings, which our users cannot act on."""
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
