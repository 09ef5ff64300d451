"""Named sets of tasks, the split into training and held-out tasks, and what was measured of each.

`suite/sets.yaml` holds the sets and says how they were chosen, `suite/measured.yaml` how long the
oracle needs. Tasks that came after version 1 of `core` and `small` are in neither set until there
is a version 2.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from hijack_data.errors import UnknownNameError, suggest

from .suite import class_references

SUITE = "suite"  # the set of all tasks that come with the library
_FOLDER = Path(__file__).parent / "suite"


@dataclass(frozen=True, kw_only=True)
class Measured:
    """What the oracle needed for a task: the median of its runs.

    Args:
        actions: Its actions.
        setup: Seconds to prepare the task and to open its application.
        seconds: Seconds of the whole episode.
    """

    actions: int
    setup: float
    seconds: float


def set_names() -> tuple[str, ...]:
    """Return the names of all sets."""
    return (SUITE, *_sets())


def members(name: str) -> tuple[str, ...]:
    """Return the names of the tasks of a set.

    Raises:
        UnknownNameError: There is no such set.
    """
    if name == SUITE:
        return tuple(class_references())
    sets = _sets()
    if name not in sets:
        raise UnknownNameError(f"no set of tasks {name!r}{suggest(name, set_names())}")
    return tuple(sets[name])


def read_measurements() -> dict[str, Measured]:
    """Return what was measured of each task, by its name."""
    return {name: Measured(**values) for name, values in _read("measured.yaml").items()}


@cache
def _sets() -> dict[str, list[str]]:
    return _read("sets.yaml")


def _read(name: str) -> dict[str, Any]:
    return yaml.safe_load((_FOLDER / name).read_text(encoding="utf-8")) or {}
