"""What a build reads from its sources: once if that fits into memory."""

from collections import deque
from collections.abc import Iterator
from itertools import chain

from hijack_data.types import Trajectory

from ..sources import SourceItem, Sources

# Counting the steps of a source keeps its records up to this number of steps; those of a larger
# source are read a second time.
KEPT_STEPS = 2000


def read_items(
    sources: Sources,
    limit: int | None,
    count: bool,
) -> tuple[Iterator[SourceItem], int]:
    """Return what sources contain and, if `count`, the number of steps (otherwise 0).

    An empty source is a `SourceError`.
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
    return _handed_out(kept), steps


def _counted(items: Iterator[SourceItem]) -> tuple[deque[SourceItem] | None, int]:
    """Return the items, or `None` if they are too many to keep, and their number of steps."""
    kept: deque[SourceItem] | None = deque()
    size = 0
    steps = 0
    for read in items:
        number = len(read.item.steps) if isinstance(read.item, Trajectory) else 0
        steps += number
        size += max(1, number)
        if size > KEPT_STEPS:
            kept = None
        if kept is not None:
            kept.append(read)
    return kept, steps


def _handed_out(kept: deque[SourceItem]) -> Iterator[SourceItem]:
    while kept:
        yield kept.popleft()
