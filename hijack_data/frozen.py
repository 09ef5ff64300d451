"""Immutable JSON data, for values from which a digest is computed.

Frozen mappings and lists are subclasses of `dict` and `list`: they equal plain ones, and `json`,
`pickle` and `copy` accept them.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NoReturn, cast

from .errors import ParameterTypeError, PlanError


def _refuse(self: object, *_: object, **__: object) -> NoReturn:
    raise ParameterTypeError(
        "the parameters of a plan cannot be changed, its digest is made from them; "
        "plan again with other parameters, or change a copy: dict(plan.params)"
    )


class FrozenDict(dict[str, Any]):
    """A mapping of JSON data that refuses every change."""

    __setitem__ = __delitem__ = __ior__ = cast(Any, _refuse)
    clear = pop = popitem = setdefault = update = cast(Any, _refuse)

    def __reduce__(self) -> tuple[Any, ...]:
        return FrozenDict, (dict(self),)


class FrozenList(list[Any]):
    """A list of JSON data that refuses every change."""

    __setitem__ = __delitem__ = __iadd__ = __imul__ = cast(Any, _refuse)
    append = clear = extend = insert = pop = remove = reverse = sort = cast(Any, _refuse)

    def __reduce__(self) -> tuple[Any, ...]:
        return FrozenList, (list(self),)


def freeze(value: object, path: str) -> Any:
    """Return an immutable copy of JSON data; tuples become lists, as in JSON.

    Raises:
        PlanError: JSON cannot hold a part of the data; the message names its place
            (`path.key[0]`).
    """
    try:
        return _frozen(value)
    except _NotJsonError:
        raise PlanError(_complaint(value, path)) from None
    except RecursionError:
        raise PlanError(f"{path} is nested too deeply") from None


def thaw(value: Any) -> Any:
    """Return a mutable copy of frozen JSON data."""
    if isinstance(value, dict):
        return {key: thaw(item) for key, item in cast("dict[str, object]", value).items()}
    if isinstance(value, list):
        return [thaw(item) for item in cast("list[object]", value)]
    return value


_SAFE = frozenset({str, int, bool, type(None), FrozenDict, FrozenList})
_STRING = frozenset({str})


class _NotJsonError(Exception):
    """A value that JSON cannot hold; `_complaint` finds its place."""


def _frozen(value: Any) -> Any:
    if type(value) in _SAFE:
        return value
    if isinstance(value, dict | Mapping):
        items = cast("Mapping[Any, object]", value)
        if not _STRING.issuperset(map(type, items)) and not all(isinstance(k, str) for k in items):
            raise _NotJsonError
        return FrozenDict({key: _frozen(item) for key, item in items.items()})
    if isinstance(value, list | tuple):
        return FrozenList(map(_frozen, cast("Sequence[object]", value)))
    if not _is_number(value) and not isinstance(value, str):
        raise _NotJsonError
    return value


def _is_number(value: object) -> bool:
    return isinstance(value, int) or (isinstance(value, float) and math.isfinite(value))


def _complaint(value: Any, path: str) -> str:
    """Describe the first value that JSON cannot hold, with its place; empty if there is none."""
    if isinstance(value, Mapping):
        items = cast("Mapping[object, object]", value).items()
        bad = next((key for key, _ in items if not isinstance(key, str)), None)
        if bad is not None:
            return f"{path} has the key {bad!r}; keys must be strings, as in JSON"
        inner = (_complaint(item, f"{path}.{key}") for key, item in items)
        return next(filter(None, inner), "")
    if isinstance(value, list | tuple):
        items = enumerate(cast("Sequence[object]", value))
        return next(filter(None, (_complaint(item, f"{path}[{i}]") for i, item in items)), "")
    if value is None or isinstance(value, str) or _is_number(value):
        return ""
    if isinstance(value, float):
        return f"{path} is {value}, which JSON cannot hold; use a finite number"
    advice = "use None, booleans, numbers, strings, lists and dictionaries"
    return f"{path} is of type {type(value).__name__}, which JSON cannot hold; {advice}"
