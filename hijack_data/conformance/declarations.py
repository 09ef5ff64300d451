"""Check the declarations of a corruption: name, documentation, parameters."""

import sys
from collections.abc import Iterator
from typing import Any

from .. import params as p
from ..corruption import Corruption
from ..errors import UnknownNameError
from .base import expect, fail
from .cases import levels


def check_registered(cls: type[Corruption]) -> None:
    """It is found by name and by id, is documented, and has a default for every parameter."""
    expect(find(cls.name) is cls, f"{cls.name!r} finds another class; call @register on it")
    expect(find(cls().id) is cls, f"{cls().id!r} is not found")
    documented = cls.summary() or sys.flags.optimize > 1  # python -OO has removed all docstrings
    expect(documented, "the class needs a docstring: its first line is the documentation")
    for key, (parameter, _) in p.parameters(cls).items():
        expect(parameter.doc, f"parameter {key} has no documentation")


def check_parameters(cls: type[Corruption]) -> None:
    """Unknown, wrong and out-of-range parameters are refused; values survive JSON."""
    _refuses_unknown(cls())  # fails if a default does not pass its own check
    for key, (parameter, _) in p.parameters(cls).items():
        for bad in _bad_values(parameter):
            expect(not _accepts(cls, key, bad), f"{key}={bad!r} is accepted")
    for spec in levels(cls):
        same = cls(**spec.params()) == spec
        expect(same, f"params() does not give the corruption back: {spec.params()}")


def _refuses_unknown(spec: Corruption) -> None:
    try:
        spec.replace(no_such_parameter=1)
    except UnknownNameError:
        return
    fail("an unknown parameter is accepted")


def _accepts(cls: type[Corruption], key: str, value: Any) -> bool:
    try:
        cls(**{key: value})
    except (ValueError, TypeError):
        return False
    return True


def _bad_values(parameter: p.Parameter) -> Iterator[object]:
    yield object()
    if parameter.low is not None:
        yield parameter.low - 1
    if parameter.high is not None:
        yield parameter.high + 1
