"""The split of tasks, which keeps tasks with reported results out of training.

The tasks of the suite and those of OSWorld are split once and for all. The suite's split is in
`online_env/tasks/suite/sets.yaml`, OSWorld's in `configs/train/osworld_split.yaml`. The authors
train on 128 of the 369 tasks that they report; these and the other 241 are a second split of
OSWorld's tasks, `configs/train/agenthijack_split.yaml`.

This module needs neither torch nor a desktop, so dataset builds can use it, too.
"""

import importlib.util
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from hijack_data.config_files import read_config
from hijack_data.errors import HijackError, UnknownNameError, shorten_list, suggest

from .errors import LeakError

TRAINING = "training"
HELD_OUT = "held_out"
SIDES = (TRAINING, HELD_OUT)
TOY_TRAINING = 128  # the same number as in the paper
TOY_HELD_OUT = 128
_TOY_FIRST = {TRAINING: 0, HELD_OUT: 10_000}
OSWORLD_SPLITS = ("osworld", "agenthijack")  # ours, and that of the paper's authors
FAMILIES = ("toy", "suite", *OSWORLD_SPLITS)
_MAX_NAMES = 5


def members(name: str) -> tuple[str, ...]:
    """Return the tasks of a side, such as `suite/training`, or the one task of that name.

    The sides are those of `toy`, `suite`, `osworld` and `agenthijack` (the authors' split of
    OSWorld's tasks), each with `training` and `held_out`.

    Raises:
        UnknownNameError: there is no such side.
    """
    family, _, side = name.partition("/")
    if not side:
        return (name,)
    if family not in FAMILIES or side not in SIDES:
        names = [f"{part_family}/{part}" for part_family in FAMILIES for part in SIDES]
        raise UnknownNameError(f"no set of tasks {name!r}{suggest(name, names)}")
    if family == "toy":
        return _toy(side)
    return _sides(family)[side]


def check_split(
    training: Iterable[str],
    evaluation: Iterable[str] = (),
    *,
    source: str = "training",
    osworld_split: str = "osworld",
) -> None:
    """Refuse tasks to be trained on that are held out, or that the evaluation reports.

    A task outside these splits, such as one of your own, is only compared with `evaluation`.

    Args:
        training: names of tasks: of the suite, ids of OSWorld, or your own.
        evaluation: names of the tasks that are reported.
        source: what is refused, for the message: a file, or a dataset.
        osworld_split: the split whose tasks of OSWorld are held out: `osworld`, or `agenthijack`
            for training on the authors' 128 tasks.

    Raises:
        LeakError: there are such tasks; the message names them, the split and the remedy.
        UnknownNameError: `osworld_split` is none of the two.
    """
    if osworld_split not in OSWORLD_SPLITS:
        raise UnknownNameError(
            f"osworld_split: no {osworld_split!r}{suggest(osworld_split, OSWORLD_SPLITS)}"
        )
    names = list(dict.fromkeys(training))
    reported = set(evaluation)
    overlap = [name for name in names if name in reported]
    if overlap:
        raise LeakError(
            f"{source}: {_listed_tasks(overlap)} would be trained on and reported: the result would"
            " say nothing of other tasks; take them out of one of the two"
        )
    for family in ("suite", osworld_split, "toy"):
        held_out = set(members(f"{family}/{HELD_OUT}"))
        leaked = [name for name in names if name in held_out]
        if leaked:
            raise LeakError(
                f"{source}: {_listed_tasks(leaked)} of {family}/{HELD_OUT} must not be trained on:"
                f" results are reported on them; take tasks of {family}/{TRAINING}"
                + _authors_hint(family, names)
            )


def _authors_hint(family: str, names: list[str]) -> str:
    """Return how to train on the authors' tasks, if the refused ones are all of theirs."""
    if family != "osworld" or not set(names) <= set(members(f"agenthijack/{TRAINING}")):
        return ""
    return (
        f". These are tasks of agenthijack/{TRAINING}: with osworld_split='agenthijack' they may be"
        f" trained on, and results may be reported on agenthijack/{HELD_OUT} only"
    )


def _listed_tasks(names: list[str]) -> str:
    plural = "s" if len(names) > 1 else ""
    return f"task{plural} {shorten_list(names, _MAX_NAMES)}"


def _toy(side: str) -> tuple[str, ...]:
    count = TOY_TRAINING if side == TRAINING else TOY_HELD_OUT
    first = _TOY_FIRST[side]
    return tuple(f"toy-{number:05d}" for number in range(first, first + count))


@cache
def _sides(family: str) -> dict[str, tuple[str, ...]]:
    """Return both sides of a split that is in a file.

    Raises:
        HijackError: the file is damaged: a task is on both sides, or a side is missing.
    """
    name, data = _suite_file() if family == "suite" else read_config(f"train/{family}_split")
    content: Any = yaml.safe_load(data)
    sides: dict[str, tuple[str, ...]] = {}
    for side in SIDES:
        tasks = content.get(side) if isinstance(content, dict) else None
        if isinstance(tasks, dict):  # by domain
            tasks = [task for domain_tasks in tasks.values() for task in domain_tasks]
        if not isinstance(tasks, list) or not tasks:
            raise HijackError(f"{name}: the side {side!r} of the split is missing")
        sides[side] = tuple(str(task) for task in tasks)
    overlap = sorted(set(sides[TRAINING]) & set(sides[HELD_OUT]))
    if overlap:
        raise HijackError(f"{name}: {_listed_tasks(overlap)} on both sides of the split")
    return sides


def _suite_file() -> tuple[str, bytes]:
    """Return the suite's sets. Only the file is read: `online_env` is not imported.

    Raises:
        HijackError: the package is not complete.
    """
    spec = importlib.util.find_spec("online_env")
    folders = [] if spec is None else list(spec.submodule_search_locations or ())
    for folder in folders:
        path = Path(folder) / "tasks" / "suite" / "sets.yaml"
        if path.is_file():
            return str(path), path.read_bytes()
    raise HijackError("online_env/tasks/suite/sets.yaml is missing: install agenthijack again")
