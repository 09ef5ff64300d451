"""The configuration of a log that environments wrote without a benchmark, from its records.

A label stands for one corruption, and a log for one setting. Otherwise a report would pool what was
not played alike, and take an episode for another attempt at one under other parameters.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeAlias, cast

import yaml

from hijack_data.errors import ParameterError, short_repr
from hijack_data.plan import CLEAN

from .record_score import ResultRecord

FieldReader: TypeAlias = Callable[[ResultRecord], Any]


def _field(*path: str) -> FieldReader:
    """Return what reads a field of a record, of an object in it; `None` if there is none."""

    def read(record: ResultRecord) -> Any:
        value: Any = record
        for key in path:
            value = cast("dict[str, Any]", value).get(key) if isinstance(value, dict) else None
        return value

    return read


# What all episodes of a log have in common, by its name in messages.
_SETTINGS = {
    "max_steps": _field("max_steps"),
    "allow_code": _field("allow_code"),
    "recovery": _field("recovery", "policy"),
    "the size of the screen": _field("desktop", "size"),
    "environment_errors": _field("environment_errors"),
    "guard": _field("guard", "name"),
    "the guard's settings": _field("guard", "settings"),
}
_CONFIG = ("max_steps", "recovery", "guard")  # those that `run.json` has by the same name
_LABELS_REMEDY = (
    "move the episodes of one into a folder of their own, and give each a label of its own:"
    " env.reset(options={'corruption': ..., 'label': ...})"
)
_SETTINGS_REMEDY = "move the episodes of one setting into a folder of their own"


def read_log_config(records: Sequence[ResultRecord]) -> dict[str, Any]:
    """Return what the records of a log tell of its configuration.

    These are `max_steps`, `recovery`, `guard` and, of each label whose corruption is known, the
    entry of `corruptions`, as in `run.json`.

    Raises:
        ParameterError: Episodes under one label had different corruptions, or the episodes
            different settings.
    """
    shared = {
        name: _shared_value(name, read, records, _SETTINGS_REMEDY)
        for name, read in _SETTINGS.items()
    }
    config = {key: shared[key] for key in _CONFIG if shared[key] is not None}
    entries = list(_corruption_entries(records))
    return {**config, "corruptions": entries} if entries else config


def _corruption_entries(records: Sequence[ResultRecord]) -> Iterator[Any]:
    """Yield the entry of each label whose corruption is known.

    Raises:
        ParameterError: A label has several corruptions.
    """
    by_label: dict[str, list[ResultRecord]] = {}
    for record in records:
        by_label.setdefault(record["corruption"], []).append(record)
    for label, labelled in by_label.items():
        name = f"the corruption {label!r}"
        _shared_value(name, _field("params"), labelled, _LABELS_REMEDY)
        planner = _shared_value(name, _field("planner"), labelled, _LABELS_REMEDY)
        if planner == CLEAN:
            yield CLEAN
        elif planner is not None:
            yield _labelled_entry(planner, label)


def _shared_value(
    name: str, read: FieldReader, records: Sequence[ResultRecord], remedy: str
) -> Any:
    """Return the value that all records have which have one; `None` if none has.

    Raises:
        ParameterError: There are several.
    """
    with_value = [record for record in records if read(record) is not None]
    if not with_value:
        return None
    first = with_value[0]
    value = read(first)
    for other in with_value:
        if read(other) != value:
            texts = _differing_texts(value, read(other))
            raise ParameterError(
                f"{name} is {texts[0]} in {first.get('id')} and {texts[1]} in {other.get('id')},"
                f" which a report would pool; {remedy}"
            )
    return value


def _differing_texts(first: Any, other: Any) -> tuple[str, str]:
    """Return two values that differ, of objects the entries that do, as texts."""
    if isinstance(first, dict) and isinstance(other, dict):
        keys = [key for key in {**first, **other} if first.get(key) != other.get(key)]
        first, other = ({key: value.get(key) for key in keys} for value in (first, other))
    return short_repr(first), short_repr(other)


def _labelled_entry(planner: object, label: str) -> Any:
    """Return the entry of a planner, as its record has it, under a label.

    Raises:
        ParameterError: It is no configuration of one corruption.
    """
    try:
        ((name, settings),) = yaml.safe_load(str(planner))["corruptions"][0].items()
        return {name: settings if name == label else {**settings, "as": label}}
    except (yaml.YAMLError, TypeError, KeyError, ValueError, AttributeError, IndexError):
        raise ParameterError(
            f"planner {short_repr(planner)} of {label!r} is no configuration of one corruption"
        ) from None
