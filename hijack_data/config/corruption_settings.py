"""Make a corruption from its settings in a configuration."""

import re
from typing import Any

from ..corruption import Corruption
from ..errors import HijackError, suggest
from ..params import Parameter, parameters
from .hints import hint
from .nodes import ConfigNode, MappingNode, Position, Problems, plain
from .options import Option
from .paper import PaperKey, paper_keys

# Keys that every corruption takes in addition to its parameters.
COMMON = ("as", "severity")
PAPER_SEVERITY = 3


def read_spec(
    cls: type[Corruption],
    settings: MappingNode,
    position: Position,
    problems: Problems,
    *,
    paper: bool,
) -> Corruption | None:
    """Return the corruption, or `None` if a mistake was noted.

    With `paper`, the paper's keys are read too.
    """
    before = len(problems.mistakes)
    known_parameters = parameters(cls)
    keys = paper_keys(cls)
    values: dict[str, Any] = {}
    positions: dict[str, Position] = {}
    for key, tree in settings.items.items():
        if key in COMMON:
            continue
        translation = keys.get(key) if paper else None
        name = translation.name if translation else key
        if name not in known_parameters:
            problems.add(
                settings.keys[key],
                f"{cls.name} has no parameter {key!r}{_advice(key, list(known_parameters), keys)}",
            )
        elif name in positions:
            problems.add(
                settings.keys[key], f"{cls.name}.{name} is given twice, once as {key!r}; remove one"
            )
        else:
            positions[name] = tree.position
            errors = len(problems.mistakes)
            value = check(
                problems, known_parameters[name][0], f"{cls.name}.{key}", tree, translation
            )
            if len(problems.mistakes) == errors:
                values[name] = value
    severity = _severity(cls, settings.items.get("severity"), problems)
    spec = _make(cls, severity, values, positions, position, problems)
    return spec if len(problems.mistakes) == before else None


def check(
    problems: Problems, parameter: Option, name: str, tree: ConfigNode, key: PaperKey | None = None
) -> Any:
    """Return the checked value of a tree, or note why it is refused and return `None`."""
    value = plain(tree)
    try:
        if key is not None and key.translate is not None:
            value = key.translate(name, value)
        return parameter.check(name, value)
    except HijackError as error:
        advice = hint(parameter, tree) if isinstance(parameter, Parameter) else ""
        problems.add(tree.position, f"{error}{advice}")
        return None


def _advice(key: str, names: list[str], keys: dict[str, PaperKey]) -> str:
    if key not in keys:
        return suggest(key, [*names, *COMMON])
    turned = " with the opposite value" if keys[key].opposite else ""
    return (
        f"; it is the paper's key for {keys[key].name}: write that{turned}, or set paper_compat:"
        " true"
    )


def _severity(cls: type[Corruption], tree: ConfigNode | None, problems: Problems) -> int:
    if tree is None:
        return PAPER_SEVERITY
    try:
        cls.at(plain(tree))
    except HijackError as error:
        problems.add(tree.position, f"{cls.name}: {error}{hint(Parameter('int', ''), tree)}")
        return PAPER_SEVERITY
    return plain(tree)


def _make(
    cls: type[Corruption],
    severity: int,
    values: dict[str, Any],
    positions: dict[str, Position],
    position: Position,
    problems: Problems,
) -> Corruption | None:
    """Make the corruption; if the class refuses it, note the error at the offending parameter."""
    try:
        return cls.at(severity, **values)
    except HijackError as error:
        message = str(error)
        candidates = (
            at
            for key, at in positions.items()
            if re.match(rf"{re.escape(cls.name)}\.{key}\b", message)
        )
        problems.add(next(candidates, position), message)
        return None
