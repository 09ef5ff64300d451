"""Read the records of a build's sources, only once if they fit into memory."""

from collections import deque
from collections.abc import Iterator
from itertools import chain

from hijack_data.types import Trajectory

from ..sources import SourceItem, Sources

# While the steps of a source are counted, its records are kept up to this number of steps; a larger
# source is read a second time.
MAX_BUFFERED_STEPS = 2000


def read_items(
    sources: Sources, limit: int | None, count: bool
) -> tuple[Iterator[SourceItem], int]:
    """Return the items of sources and, if `count`, the number of steps (otherwise 0).

    Raises `SourceError` for an empty source.
    """
    items = sources.read(limit)
    first = next(items, None)
    if first is None:
        sources.refuse_nothing()
        return iter(()), 0
    items = chain([first], items)
    if not count:
        return items, 0
    kept, steps = _counted(items)
    if kept is None:
        return sources.read(limit), steps
    return _drained(kept), steps


def _counted(items: Iterator[SourceItem]) -> tuple[deque[SourceItem] | None, int]:
    """Return the items (`None` if there are too many to keep), and the number of steps."""
    kept: deque[SourceItem] | None = deque()
    size = 0
    steps = 0
    for read in items:
        number = len(read.item.steps) if isinstance(read.item, Trajectory) else 0
        steps += number
        size += max(1, number)
        if size > MAX_BUFFERED_STEPS:
            kept = None
        if kept is not None:
            kept.append(read)
    return kept, steps


def _drained(kept: deque[SourceItem]) -> Iterator[SourceItem]:
    while kept:
        yield kept.popleft()
