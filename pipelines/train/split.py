"""The split of tasks, which keeps tasks with reported results out of training.

The tasks of the suite and those of OSWorld are split once and for all. The suite's split is in
`online_env/tasks/suite/sets.yaml`, OSWorld's in `configs/train/osworld_split.yaml`. The authors
train on 128 of the 369 tasks that they report.

This module needs neither torch nor a desktop, so dataset builds can use it, too.
"""

import importlib.util
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from hijack_data.config.files import read_config
from hijack_data.errors import HijackError, UnknownNameError, some_of, suggest

from .errors import LeakError

TRAINING = "training"
HELD_OUT = "held_out"
SIDES = (TRAINING, HELD_OUT)
TOY_TRAINING = 128  # the same number as in the paper
TOY_HELD_OUT = 128
_TOY_FIRST = {TRAINING: 0, HELD_OUT: 10_000}
_SHOWN = 5


def members(name: str) -> tuple[str, ...]:
    """Return the tasks of a side, such as `suite/training`, or the one task of that name.

    The sides are those of `toy`, `suite` and `osworld`, each with `training` and `held_out`.

    Raises:
        UnknownNameError: there is no such side.
    """
    family, _, side = name.partition("/")
    if not side:
        return (name,)
    families = ("toy", "suite", "osworld")
    if family not in families or side not in SIDES:
        known = [f"{each}/{part}" for each in families for part in SIDES]
        raise UnknownNameError(f"no set of tasks {name!r}{suggest(name, known)}")
    if family == "toy":
        return _toy(side)
    return _sides(family)[side]


def check_split(
    training: Iterable[str], evaluation: Iterable[str] = (), *, what: str = "training"
) -> None:
    """Refuse tasks to be trained on that are held out, or that the evaluation reports.

    A task outside these splits, such as one of your own, is only compared with `evaluation`.

    Args:
        training: names of tasks: of the suite, ids of OSWorld, or your own.
        evaluation: names of the tasks that are reported.
        what: what is refused, for the message: a file, or a dataset.

    Raises:
        LeakError: there are such tasks; the message names them, the split and the remedy.
    """
    wanted = list(dict.fromkeys(training))
    reported = set(evaluation)
    both = [name for name in wanted if name in reported]
    if both:
        raise LeakError(
            f"{what}: {_some(both)} would be trained on and reported: the result would say nothing"
            " of other tasks; take them out of one of the two"
        )
    for family in ("suite", "osworld", "toy"):
        held_out = set(members(f"{family}/{HELD_OUT}"))
        leaked = [name for name in wanted if name in held_out]
        if leaked:
            raise LeakError(
                f"{what}: {_some(leaked)} of {family}/{HELD_OUT} must not be trained on: results"
                f" are reported on them; take tasks of {family}/{TRAINING}"
            )


def split_side(name: str) -> str | None:
    """Return `training` or `held_out`, or `None` for a task that is in none of the splits."""
    for family in ("suite", "osworld", "toy"):
        for side in SIDES:
            if name in members(f"{family}/{side}"):
                return side
    return None


def _some(names: list[str]) -> str:
    plural = "s" if len(names) > 1 else ""
    return f"task{plural} {some_of(names, _SHOWN)}"


def _toy(side: str) -> tuple[str, ...]:
    count = TOY_TRAINING if side == TRAINING else TOY_HELD_OUT
    first = _TOY_FIRST[side]
    return tuple(f"toy-{number:05d}" for number in range(first, first + count))


@cache
def _sides(family: str) -> dict[str, tuple[str, ...]]:
    """Return both sides of the split of the suite or of OSWorld.

    Raises:
        HijackError: the file is damaged: a task is on both sides, or a side is missing.
    """
    name, data = _suite_file() if family == "suite" else read_config("train/osworld_split")
    found: Any = yaml.safe_load(data)
    sides: dict[str, tuple[str, ...]] = {}
    for side in SIDES:
        tasks = found.get(side) if isinstance(found, dict) else None
        if isinstance(tasks, dict):  # by domain
            tasks = [task for some in tasks.values() for task in some]
        if not isinstance(tasks, list) or not tasks:
            raise HijackError(f"{name}: the side {side!r} of the split is missing")
        sides[side] = tuple(str(task) for task in tasks)
    both = sorted(set(sides[TRAINING]) & set(sides[HELD_OUT]))
    if both:
        raise HijackError(f"{name}: {_some(both)} on both sides of the split")
    return sides


def _suite_file() -> tuple[str, bytes]:
    """Return the suite's sets. Only the file is read: `online_env` is not imported.

    Raises:
        HijackError: the package is not complete.
    """
    spec = importlib.util.find_spec("online_env")
    places = [] if spec is None else list(spec.submodule_search_locations or ())
    for place in places:
        path = Path(place) / "tasks" / "suite" / "sets.yaml"
        if path.is_file():
            return str(path), path.read_bytes()
    raise HijackError("online_env/tasks/suite/sets.yaml is missing: install agenthijack again")
