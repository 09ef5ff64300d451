"""Check the declarations of a corruption's class; each problem comes with its remedy."""

import dataclasses
import inspect
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeAlias, cast

from . import params as p
from .actions.input_faults import FAULTS
from .errors import suggest

AllowedValues: TypeAlias = Mapping[str, Sequence[str]]

NAME = re.compile(r"[a-z][a-z0-9_]{0,63}")
# Words with a meaning in configurations or on the command line, and words that YAML does not read
# as text.
RESERVED_NAMES = frozenset(
    {
        *("all", "as", "clean", "everyday", "none", "one_of", "schedule", "sequence", "severity"),
        *("false", "no", "null", "off", "on", "true", "yes"),
    }
)
RESERVED_PARAMETERS = ("as", "severity")


def problems(cls: type[Any], base: type[Any], choices: AllowedValues) -> Iterator[str]:
    """Yield what is wrong with the declaration of `cls`, a subclass of `base`.

    `choices` holds the allowed values of class attributes such as `scope`.
    """
    yield from name_problems(getattr(cls, "name", ""))
    for key, options in choices.items():
        value = getattr(cls, key, "")
        if value and value not in options:
            yield f"{key} {value!r} does not exist{suggest(value, options)}"
    version = cast(object, cls.version)
    is_whole = isinstance(version, int) and not isinstance(version, bool)
    if not is_whole or cast(int, version) < 1:
        yield f"version must be an integer of at least 1, not {version!r}"
    yield from _effects(cls)
    yield from _inputs(cls)
    if "__dataclass_fields__" in vars(cls):
        yield from _fields(cls, base)
    yield from _severities(cls)


def name_problems(name: object) -> Iterator[str]:
    """Yield what is wrong with the name of a corruption."""
    if not name:
        return  # reported elsewhere: the name is not set
    if not isinstance(name, str) or not NAME.fullmatch(name):
        yield (
            f"name {name!r} must be 1 to 64 lower-case letters, digits and '_', the first a "
            "letter, such as 'dead_pixels'"
        )
    elif name in RESERVED_NAMES:
        yield f"name {name!r} means something else in configurations; choose another"


def _effects(cls: type[Any]) -> Iterator[str]:
    """Yield what is wrong with the kinds of effects that a corruption declares."""
    kinds = cast(object, cls.effects)
    if not isinstance(kinds, tuple) or not all(
        isinstance(kind, str) and kind for kind in cast("tuple[object, ...]", kinds)
    ):
        yield f'effects must be a tuple of kinds, such as ("lock",), not {kinds!r}'
        return
    scope = getattr(cls, "scope", "")
    if kinds and scope in ("observation", "action"):
        yield f"scope {scope!r} has no effects on the machine; use 'state' or 'transition'"
    if not kinds and scope in ("state", "transition"):
        yield (
            f"scope {scope!r} acts on the machine, and effects is not set; name what its plans may "
            'hold, such as effects: ClassVar[tuple[str, ...]] = ("lock",)'
        )


def _inputs(cls: type[Any]) -> Iterator[str]:
    """Yield what is wrong with the kinds of input faults that a corruption declares."""
    kinds = cast(object, cls.inputs)
    fault_names = ", ".join(FAULTS)
    if not isinstance(kinds, tuple) or not all(
        kind in FAULTS for kind in cast("tuple[object, ...]", kinds)
    ):
        yield f'inputs must be a tuple of kinds ({fault_names}), such as ("drop",), not {kinds!r}'
        return
    scope = getattr(cls, "scope", "")
    if kinds and scope != "action":
        yield f"scope {scope!r} has no faults of the input; use 'action'"
    if not kinds and scope == "action":
        yield (
            "scope 'action' changes what an agent does, and inputs is not set; name the kinds of "
            f'faults ({fault_names}), such as inputs: ClassVar[tuple[str, ...]] = ("drop",)'
        )


def _fields(cls: type[Any], base: type[Any]) -> Iterator[str]:
    parameters_by_name = p.parameters(cls)
    if set(RESERVED_PARAMETERS) & set(parameters_by_name):
        reserved = " and ".join(RESERVED_PARAMETERS)
        yield f"{reserved} are words of the configuration, not names for parameters"
    public = [word for word in dir(base) if not word.startswith("_")]
    reserved_attributes = {*public, "category", "scope"}
    for key in parameters_by_name:
        if key in reserved_attributes:
            yield f"{key!r} is an attribute of every corruption, not a name for a parameter"
    fields = [field.name for field in dataclasses.fields(cls)]
    arguments = list(inspect.signature(cls).parameters)
    for key in dict.fromkeys([*fields, *arguments]):
        if key in parameters_by_name:
            continue
        if key in reserved_attributes:
            yield f"{key} is a field of the dataclass; write {key}: ClassVar[...] = ..."
        else:
            yield (
                f"the field {key!r} is not declared with param, so it would be neither checked nor "
                f'kept in plans; write {key}: ... = param(DEFAULT, "what it is")'
            )


def _severities(cls: type[Any]) -> Iterator[str]:
    levels = cast(object, cls.severities)
    if not isinstance(levels, tuple | list):
        yield f"severities must be a tuple of 5 mappings, not {levels!r}"
        return
    levels = cast("Sequence[object]", levels)
    count = len(levels)
    if count not in (0, 5):
        yield f"severities must hold 5 entries, not {count}"
        return
    parameters_by_name = p.parameters(cls)
    for number, level in enumerate(levels, 1):
        if not isinstance(level, Mapping):
            yield f"severities: level {number} must be a mapping of parameters, not {level!r}"
            continue
        for key in cast("Mapping[str, object]", level):
            if key not in parameters_by_name:
                hint = suggest(key, parameters_by_name)
                yield f"severities: level {number} sets {key!r}, which is not a parameter{hint}"
    if levels and levels[2]:
        yield f"severities: level 3 is the paper's default and must be empty, not {levels[2]!r}"
