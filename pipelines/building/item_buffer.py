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

    Raises:
        SourceError: the source is empty.
    """
    items = sources.read(limit)
    first = next(items, None)
    if first is None:
        sources.refuse_nothing()
        return iter(()), 0
    items = chain([first], items)
    if not count:
        return items, 0
    buffered, steps = _buffer_items(items)
    if buffered is None:
        return sources.read(limit), steps
    return _drained(buffered), steps


def _buffer_items(items: Iterator[SourceItem]) -> tuple[deque[SourceItem] | None, int]:
    """Return the items (`None` if there are too many to keep), and the number of steps."""
    buffered: deque[SourceItem] | None = deque()
    size = 0
    steps = 0
    for read in items:
        number = len(read.item.steps) if isinstance(read.item, Trajectory) else 0
        steps += number
        size += max(1, number)
        if size > MAX_BUFFERED_STEPS:
            buffered = None
        if buffered is not None:
            buffered.append(read)
    return buffered, steps


def _drained(buffered: deque[SourceItem]) -> Iterator[SourceItem]:
    while buffered:
        yield buffered.popleft()
