"""Named sets of tasks, the split into training and held-out tasks, and what was measured of each.

`suite/sets.yaml` holds the sets, `suite/measured.yaml` how long the oracle needs. The sets `core`
and `small` follow by the rules of `chosen` and `quick` from `suite/chosen_from.yaml`: the domains
and lengths of the tasks that there were when version 1 of the two sets was chosen. A test applies
the rules again. Tasks that came later are in neither set until there is a version 2.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from hijack_data.errors import UnknownNameError, suggest

from .suite import class_references
from .task_apps import APPS

SUITE = "suite"  # the set of all tasks that come with the library
CORE = 24  # tasks of the set `core`
SMALL = 10  # tasks of the set `small`
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


def candidates() -> tuple[dict[str, str], dict[str, int]]:
    """Return the domain and the length of each task that `core` and `small` were chosen from."""
    entries = _read("chosen_from.yaml")
    domains = {name: domain for name, (domain, _) in entries.items()}
    return domains, {name: actions for name, (_, actions) in entries.items()}


def choose(domains: Mapping[str, str], lengths: Mapping[str, int], count: int) -> list[str]:
    """Return `count` tasks, balanced over domains and lengths, sorted by name.

    The rule: the domains take turns in alphabetical order. At its turns, a domain gives the task
    of median length of those it has left, then the longest, the shortest, and again the median.

    Args:
        domains: The domain of each task.
        lengths: The actions of its oracle.
        count: How many tasks.
    """
    remaining: dict[str, list[str]] = {}
    for task in sorted(domains, key=lambda name: (lengths[name], name)):
        remaining.setdefault(domains[task], []).append(task)
    chosen_tasks: list[str] = []
    turn = 0
    while len(chosen_tasks) < min(count, len(domains)):
        for domain in sorted(remaining):
            tasks = remaining[domain]
            if tasks and len(chosen_tasks) < count:
                chosen_tasks.append(tasks.pop(_index_at_turn(turn, len(tasks))))
        turn += 1
    return sorted(chosen_tasks)


def _index_at_turn(turn: int, count: int) -> int:
    """Return which of `count` tasks, the shortest first, a domain gives at a turn."""
    places = (count // 2, count - 1, 0)
    return places[turn % len(places)]


def quick(domains: Mapping[str, str], lengths: Mapping[str, int], count: int) -> list[str]:
    """Return `count` tasks for a quick look, each of another domain, sorted by name.

    The rule: of the tasks of median length, one of each domain, the shortest. The set `small` is
    drawn from the tasks whose applications come with the profiles `core` and `web`.
    """
    middle = choose(domains, lengths, len(set(domains.values())))
    return sorted(sorted(middle, key=lambda name: (lengths[name], name))[:count])


def is_light(apps: Iterable[str]) -> bool:
    """Return whether applications come with `hijack desktop install`, without another profile."""
    return all(app in APPS and APPS[app].profile in ("core", "web") for app in apps)


@cache
def _sets() -> dict[str, list[str]]:
    return _read("sets.yaml")


def _read(name: str) -> dict[str, Any]:
    return yaml.safe_load((_FOLDER / name).read_text(encoding="utf-8")) or {}
