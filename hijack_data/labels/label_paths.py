"""Labels at the end of a dotted path, such as `objects.bbox`, also inside lists on the path."""

import contextlib
from collections.abc import Callable, Iterable, Mapping
from itertools import chain
from typing import Any, TypeAlias, cast

import numpy as np

from ..errors import HijackError
from ..sample_pictures import FOLLOWING, is_tensor
from ..types import Size
from .base import Format, Location, Move
from .formats import label_locations, map_label
from .nested_numbers import Numbers

SampleDict: TypeAlias = Mapping[str, Any]
_NUMBER_TYPES = frozenset([int, float])


def split_path(path: str, sample: SampleDict) -> tuple[str, list[str]]:
    """Split a path into an entry of a sample and the path inside that entry."""
    if path in sample:
        return path, []
    key, *steps = path.split(".")
    return key, steps


def map_at_path(path: str, form: Format, value: Any, steps: list[str], move: Move) -> Any:
    """Return a copy of the entry of a path, whose labels at the end of `steps` follow a move.

    Raises:
        LabelError: a label cannot follow the pixels; the message names the path.
    """
    if steps and form.rows is not None:
        labels = _collect(value, steps)
        rows = _read_rows(labels, form.rows.width)
        if rows is not None:
            try:
                after = form.rows.map_rows(rows, move).tolist()
            except HijackError:
                pass  # below, the message names the label
            else:
                new_labels = map(_like, labels, after)
                return change_at_path(value, steps, lambda _: next(new_labels))
    return change_at_path(value, steps, lambda label: _map_unless_tensor(path, form, label, move))


def locate_at_path(
    path: str, form: Format, value: Any, steps: list[str], size: Size
) -> list[Location]:
    """Return where the labels at the end of a path point.

    Raises:
        LabelError: a label cannot be right; the message names the path.
    """
    labels = _collect(value, steps)
    if form.rows is not None:
        rows = _read_rows(labels, form.rows.width)
        if rows is not None:
            # Where it fails, the message below names the label.
            with contextlib.suppress(HijackError):
                return form.rows.locate_rows(rows, size)
    return [location for label in labels for location in label_locations(path, form, label, size)]


def _collect(value: Any, steps: list[str]) -> list[Any]:
    """Return the labels at the end of a path, in order."""
    level: list[Any] = [value]
    for step in steps:
        while any(issubclass(kind, list | tuple) for kind in set(map(type, level))):
            level = list(
                chain.from_iterable(
                    cast("list[Any]", part) if isinstance(part, list | tuple) else [part]
                    for part in level
                )
            )
        kinds: set[Any] = {kind for kind in set(map(type, level)) if issubclass(kind, Mapping)}
        level = [part[step] for part in level if type(part) in kinds and step in part]
    return [label for label in level if label is not None]


def _read_rows(labels: list[Any], width: int) -> Numbers | None:
    """Return labels as the rows of one array; `None` unless all are alike, and several.

    They are lists or tuples of `width` finite numbers of Python, all of whole numbers, or all with
    a fraction.
    """
    if len(labels) < 2 or not set(map(type, labels)) <= {list, tuple}:
        return None
    if set(map(len, labels)) != {width}:
        return None
    numbers = list(chain.from_iterable(labels))
    kinds = set(map(type, numbers))
    if not kinds <= _NUMBER_TYPES:
        return None
    if len(kinds) > 1 and not all(float in map(type, label) for label in labels):
        return None
    try:
        rows: Numbers = np.array(numbers, np.float64 if float in kinds else np.int64)
    except OverflowError:
        return None
    return rows.reshape(-1, width) if np.isfinite(rows).all() else None


def _like(label: Any, numbers: list[Any]) -> Any:
    return tuple(numbers) if type(label) is tuple else numbers


def _map_unless_tensor(path: str, form: Format, value: Any, move: Move) -> Any:
    """Return a declared label after a move; torchvision's own labels are moved elsewhere."""
    first = value
    while isinstance(first, list | tuple) and first:
        first = cast("list[Any]", first)[0]
    return value if is_following(first) else map_label(path, form, value, move)


def is_following(value: Any) -> bool:
    """Return whether a value is a label of torchvision, which is moved elsewhere."""
    return is_tensor(value, *FOLLOWING)


def change_at_path(value: Any, steps: list[str], change: Callable[[Any], Any]) -> Any:
    """Return a copy of a value with the end of a path changed, also inside lists on the path."""
    if value is None:
        return None
    if not steps:
        return change(value)
    if isinstance(value, list | tuple):
        parts = [change_at_path(part, steps, change) for part in cast("list[Any]", value)]
        return tuple(parts) if isinstance(value, tuple) else parts
    if type(value) is not dict and not isinstance(value, Mapping):
        return value
    entries = dict(cast("Mapping[str, Any]", value))
    if steps[0] in entries:
        entries[steps[0]] = change_at_path(entries[steps[0]], steps[1:], change)
    return entries


def names_at(value: Any, steps: list[str]) -> Iterable[Any] | None:
    """Return `None` if a path leads somewhere, otherwise the names where it fails.

    A value that is `None` or an empty list proves nothing, and counts as somewhere.
    """
    if value is None or not steps:
        return None
    if isinstance(value, Mapping):
        entries = cast("Mapping[str, Any]", value)
        if steps[0] not in entries:
            return list(entries)
        return names_at(entries[steps[0]], steps[1:])
    if not isinstance(value, list | tuple):
        return ()
    names: Iterable[Any] | None = None
    for part in cast("list[Any]", value):
        if part is None:
            continue
        names = names_at(part, steps)
        if names is None:
            return None
    return names


def find_lost_step(path: str, sample: SampleDict) -> str:
    """Return the part of a path that leads nowhere."""
    key, steps = split_path(path, sample)
    if key not in sample:
        return path if "." not in path else key
    count = next(
        n for n in range(1, len(steps) + 1) if names_at(sample[key], steps[:n]) is not None
    )
    return steps[count - 1]
