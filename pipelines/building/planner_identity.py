"""What identifies planners of users, so that a build is never resumed with other ones.

A configuration holds all parameters of our corruptions, and a loaded file is known by its hash.
Planners that no configuration can hold, and classes from modules of users, are compared by their
attributes and the source of their classes. Of a `Schedule`, the planner of epoch 0 counts, because
builds use that epoch.
"""

import hashlib
import inspect
import json
from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from hijack_data.compose import Schedule
from hijack_data.corruption import Corruption
from hijack_data.entries import is_ours
from hijack_data.loading import find_loaded_file
from hijack_data.planner import Planner, tree

from ..errors import OVERWRITE, BuildError
from .selection import config_text

PLANNERS = "planners"


def planner_digests(planners: Mapping[str, Planner]) -> dict[str, str | None]:
    """Return digests by label, of the planners that other parameters of a build do not identify.

    A digest is `None` if nothing can tell the planner from another one.
    """
    has_no_config = bool(planners) and config_text(planners, {}) is None
    return {
        label: _digest(planner)
        for label, planner in planners.items()
        if has_no_config or any(_is_of_user(type(part)) for part in tree(planner))
    }


def check_comparable(parameters: Mapping[str, Any], folder: str) -> None:
    """Check that the planners of a build can be compared with those of an earlier run.

    Raises:
        BuildError: nothing can tell one of them from another one.
    """
    for label, digest in parameters.get(PLANNERS, {}).items():
        if digest is None:
            raise BuildError(
                f"{folder}: cannot be resumed: nothing shows that the corruption {label!r} is that"
                " of the build (its attributes are no plain data, or its class has no source);"
                f" build again, into another folder or with {OVERWRITE}"
            )


def _digest(planner: Planner) -> str | None:
    try:
        text = json.dumps(_description(planner), sort_keys=True)
    # an attribute is no plain data or holds itself, or a class has no source
    except (TypeError, ValueError, RecursionError, OSError):
        return None
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _description(value: Any) -> Any:
    """Return a value as data that JSON can hold.

    Raises:
        OSError, TypeError: the class of a planner has no source.
    """
    if isinstance(value, Schedule):
        return ["Schedule", _description(value.parts)]
    if isinstance(value, Planner):
        attributes = value.params() if isinstance(value, Corruption) else _description(vars(value))
        return [type(value).__qualname__, _source(type(value)), attributes]
    if isinstance(value, np.ndarray | np.generic):
        return cast(Any, value).tolist()
    if isinstance(value, Mapping):
        entries = cast("Mapping[Any, Any]", value).items()
        return [[_description(key), _description(part)] for key, part in entries]
    if isinstance(value, list | tuple):
        return [_description(part) for part in cast("list[Any]", value)]
    return value


def _source(cls: type) -> str:
    """Return the source of a class and its bases, without ours and those of loaded files.

    Raises:
        OSError, TypeError: there is no source.
    """
    planner_classes = (base for base in cls.__mro__ if issubclass(base, Planner))
    return "".join(map(inspect.getsource, filter(_is_of_user, planner_classes)))


def _is_of_user(cls: type) -> bool:
    return not is_ours(cls) and find_loaded_file(cls) is None
