"""Refuse fields of an action that would stay unmapped, or be ignored when it is carried out."""

import re
from collections.abc import Collection, Mapping
from typing import Any, cast

from ...errors import ActionError, short_repr, suggest

# Numeric fields that tools and logs add to an action and that are not coordinates.
_AMOUNTS = frozenset(
    {
        *("amount", "clicks", "duration", "id", "index", "interval", "ms", "num_clicks"),
        *("presses", "repeat", "seconds", "step", "steps", "times", "timestamp"),
    }
)
_PLACE = re.compile(r"coord|point|pos|box|region|path|offset|location|^[xy]\d*$")
_NUMBER = re.compile(r"\d")
_NUMERIC = re.compile(r"[^\w]*-?\d[\d\s.,;:()\[\]<>x-]*")
_TAG = re.compile(r"</?\w+>|<\|\w+\|>")  # <point>5 6</point>
_MAX_DEPTH = 5
_ASK_NOTHING: tuple[object, ...] = (None, False, "", [], {}, ())
# Fields in which a model explains an action.
_EXPLANATIONS = frozenset({"description", "explanation", "intent", "reason", "thought"})


def check_fields(fields: Mapping[str, Any], known_names: Collection[str], label: str) -> None:
    """Check that every field is in `known_names` or cannot hold coordinates.

    Unknown fields without coordinates (notes, ids, None) are accepted, since no mapping has to
    change them.

    Raises:
        ActionError: a field is unknown and may hold coordinates.
    """
    for name, value in fields.items():
        if name not in known_names and _may_be_place(name, value):
            raise ActionError(
                f"{label} has no field {name!r}, got {short_repr(value)}, which would stay unmapped"
                f"{suggest(name.lower(), known_names)}"
            )


def check_carried_out(fields: Mapping[str, Any], read_names: Collection[str], label: str) -> None:
    """Check that no field of an action that is carried out says something that is not done.

    Empty fields, zero and false ask for nothing.

    Raises:
        ActionError: a field is not read, such as the `button` of an action that clicks left.
    """
    for name, value in fields.items():
        if name not in read_names and name not in _EXPLANATIONS and value not in _ASK_NOTHING:
            raise ActionError(
                f"{label} does not take {name!r}, got {short_repr(value)}, which would be ignored;"
                " leave it out"
            )


def _may_be_place(name: str, value: object, depth: int = _MAX_DEPTH) -> bool:
    if isinstance(value, str) and _PLACE.search(name.lower()):
        return _NUMBER.search(value) is not None
    if name in _AMOUNTS and _is_one_number(value):
        return False
    return _has_number(value, depth)


def _is_one_number(value: object) -> bool:
    if isinstance(value, str):
        return value.strip().isdigit()
    return isinstance(value, int | float)


def _has_number(value: object, depth: int) -> bool:
    """Return whether a value may hold a number; values of unknown types may."""
    if isinstance(value, str):
        return _NUMERIC.fullmatch(_TAG.sub(" ", value)) is not None
    if value is None or isinstance(value, bool):
        return False
    if depth == 0:
        return True
    if isinstance(value, dict):
        fields = cast("dict[Any, object]", value).items()
        return any(_may_be_place(str(name), item, depth - 1) for name, item in fields)
    if isinstance(value, list | tuple):
        return any(_has_number(item, depth - 1) for item in cast("list[object]", value))
    return True
