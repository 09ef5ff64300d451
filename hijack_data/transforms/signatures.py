"""Explicit signatures and docstrings of the transforms, made from the declared parameters.

Editors, `help` and `inspect.signature` show every argument of `tr.PopUps(...)`. Static tools read
the same from `hijack_data/transforms/__init__.pyi`, which `make stubs` generates.
"""

import functools
import inspect
import re
import textwrap
from collections.abc import Iterator, Mapping
from typing import Any, TypeVar, cast

from ..corruption import Corruption
from ..params import Parameter, parameters
from .base import Corrupt

C = TypeVar("C", bound=Corrupt)
_TYPES = {
    "bool": "bool",
    "int": "int",
    "float": "float",
    "str": "str",
    "color": "str | Sequence[int]",
    "steps": "int | Sequence[int] | Mapping[str, int]",
    "ip": "str",
}
_SEVERITY = (
    "1 (mild) to 5 (harsh) sets the parameters of the corruption that are not passed; 3, the"
    " paper's parameters, by default."
)
_KEYWORD = inspect.Parameter.KEYWORD_ONLY


def explicit(
    spec: type[Corruption] | None = None,
    *,
    defaults: Mapping[str, Any] | None = None,
    without: tuple[str, ...] = (),
) -> Any:
    """Class decorator: complete the signature of `__init__`, and the section `Args:` of the class.

    Args:
        spec: the corruption whose parameters the transform takes as keyword arguments; by default
            the arguments are those of the class's own `__init__`.
        defaults: defaults of the transform that are not those of the corruption.
        without: arguments of `Corrupt` that the transform does not take.
    """

    def decorate(cls: type[C]) -> type[C]:
        init = _own_init(cls)
        shared = [
            argument
            for name, argument in inspect.signature(Corrupt).parameters.items()
            if name not in ("planner", *without)
        ]
        arguments_in_order = [
            argument
            for argument in inspect.signature(init).parameters.values()
            if argument.kind is not inspect.Parameter.VAR_KEYWORD
        ]
        docs = _read_args(cls)
        if spec is not None:
            arguments_in_order += [
                inspect.Parameter("severity", _KEYWORD, default=None, annotation="int | None")
            ]
            docs["severity"] = _SEVERITY
            arguments_in_order += _arguments(spec, defaults or {})
            docs |= {
                name: f"{parameter.doc}: {parameter.accepts}."
                for name, (parameter, _) in parameters(spec).items()
            }
        names = {argument.name for argument in arguments_in_order}
        arguments_in_order += [argument for argument in shared if argument.name not in names]
        init.__signature__ = inspect.Signature(arguments_in_order, return_annotation="None")
        common = _read_args(Corrupt)
        if cls.__doc__:  # python -OO removes docstrings
            arguments = [
                argument.name for argument in arguments_in_order if argument.name != "self"
            ]
            cls.__doc__ = _with_args(cls.__doc__, {k: docs.get(k) or common[k] for k in arguments})
        return cls

    return decorate


def _own_init(cls: type[Corrupt]) -> Any:
    """Return the `__init__` of a class itself; one that only calls its base gets its own."""
    if "__init__" not in vars(cls):
        inherited = cls.__init__

        @functools.wraps(inherited, assigned=("__module__", "__name__", "__doc__"))
        def init(self: Corrupt, **values: Any) -> None:
            inherited(self, **values)

        del cast(Any, init).__wrapped__
        setattr(cls, "__init__", init)  # noqa: B010 - the checker knows it as a method that is not assigned to
    return vars(cls)["__init__"]


def _arguments(spec: type[Corruption], defaults: Mapping[str, Any]) -> Iterator[inspect.Parameter]:
    for name, (parameter, default) in parameters(spec).items():
        value = defaults.get(name, default)
        yield inspect.Parameter(name, _KEYWORD, default=value, annotation=_annotation(parameter))


def _annotation(parameter: Parameter) -> str:
    """Return the type of a declared parameter, as source text."""
    if parameter.choices:
        text = f"Literal[{', '.join(map(repr, parameter.choices))}]"
    else:
        text = _TYPES[parameter.kind]
    return f"{text} | None" if parameter.optional else text


def _read_args(cls: type[Any]) -> dict[str, str]:
    """Return the entries of a docstring's section `Args:`, each on one line."""
    text = inspect.cleandoc(cls.__doc__ or "")
    section = re.search(r"^Args:\n((?: +.*\n?|\n(?= ))*)", text, re.MULTILINE)
    if section is None:
        return {}
    entries = re.split(r"^ {4}(?=\w+: )", section[1], flags=re.MULTILINE)[1:]
    pairs = (entry.partition(": ") for entry in entries)
    return {name: " ".join(description.split()) for name, _, description in pairs}


def _with_args(doc: str, arguments: Mapping[str, str]) -> str:
    """Return a docstring with these entries as its section `Args:`."""
    text = inspect.cleandoc(doc)
    text = re.sub(r"^Args:\n(?: +.*\n?)*\n?", "", text, flags=re.MULTILINE)
    head, marker, tail = text.partition("\nRaises:")
    if not marker:
        head, marker, tail = text.partition("\nExamples:")
    entries = [
        textwrap.fill(f"{name}: {text}", 92, initial_indent=" " * 4, subsequent_indent=" " * 8)
        for name, text in arguments.items()
    ]
    section = ["Args:", *entries]
    return "\n".join([head.rstrip(), "", *section]) + (f"\n{marker}{tail}" if marker else "\n")
