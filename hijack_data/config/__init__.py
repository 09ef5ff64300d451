"""Configurations: YAML files that name corruptions with their parameters.

Every mistake in a file is reported at once.

    corruptions:
      - marks: {number: 100, color: blue}
      - pop_ups
      - subtitle: {severity: 4}
      - marks: {as: few_marks, number: 5}
      - one_of: {options: [marks, subtitle: {position: top}], p_clean: 0.2, weights: [2, 1]}
      - sequence: [subtitle, network_error]
    seed: 7

`corruptions` is a list, or a mapping from names to parameters. Other top-level keys are those of
`options.OPTIONS`, and `paper_compat: true`, which reads the paper's own names and keys. A file that
has `noise` instead of `corruptions`, as the authors' `config/default.yaml`, is read so too.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias, cast

from ..config_files import available, read_config
from ..corruption import CORRUPTIONS, SETS, Corruption, corruption_names, make_corruption
from ..errors import ParameterError, ParameterTypeError, short_repr, suggest
from ..params import Parameter
from ..planner import Planner
from .build import Builder
from .corruption_settings import check
from .dumping import dump
from .nodes import (
    ConfigNode,
    MappingNode,
    Position,
    Problems,
    ScalarNode,
    describe_node,
    from_python,
)
from .options import OPTIONS
from .paper import WRAPPER, paper_name
from .yaml_reader import read_yaml

__all__ = ["OPTIONS", "Config", "available", "dump", "load_config", "paper_compat", "specs_from"]

ConfigSource: TypeAlias = "str | os.PathLike[str] | Mapping[str, Any]"
_PAPER = Parameter("bool", "Read the paper's names and keys")


@dataclass(frozen=True)
class Config:
    """A configuration that has been read and checked.

    Args:
        corruptions: corruptions and combinators by label, in the order of the file.
        options: the other top-level keys that were given; see `OPTIONS`.
        source: the path, the name of a packaged configuration, or `"<mapping>"`.
    """

    corruptions: dict[str, Planner]
    options: Mapping[str, Any] = field(default_factory=dict[str, Any])
    source: str = ""


def load_config(path_or_name: ConfigSource) -> Config:
    """Read a configuration from a path, the bare name of a packaged one, or a mapping.

    An example of a name is `"paper"`. All mistakes are raised as one `ConfigError`, each as
    `file:line:column: message`; a missing or unreadable file has no line. An argument of any other
    type is a `ParameterTypeError`.
    """
    return _load(path_or_name, paper=False)


def paper_compat(path_or_mapping: ConfigSource) -> Config:
    """Read a configuration in the paper's own names and keys, such as `Pop UPs: {overlap: true}`.

    The corruptions may be at the top level, without `corruptions:`. Raises what `load_config`
    raises.
    """
    return _load(path_or_mapping, paper=True)


def specs_from(text: str) -> list[Corruption]:
    """Return the corruptions named in a text such as `"marks,subtitle"`, with default parameters.

    `"all"` means every registered corruption but those of a named set, `"everyday"` those of that
    set. An unknown name is an `UnknownNameError`.

    Raises:
        ParameterTypeError: the argument is not a text.
        ParameterError: a name is empty or appears twice.
    """
    if not isinstance(cast(object, text), str):
        names = "a string such as 'marks,subtitle' or 'all'"
        raise ParameterTypeError(f"corruptions must be {names}, got {short_repr(text)}")
    word = text.strip()
    is_set = word in ("all", *SETS)
    names = corruption_names(word) if is_set else [name.strip() for name in text.split(",")]
    if "" in names:
        raise ParameterError(
            f"corruptions holds an empty name: {text!r}; write 'marks,subtitle' or 'all'"
        )
    specs = [make_corruption(name) for name in names]
    spec_names = [spec.name for spec in specs]
    twice = next((name for name in spec_names if spec_names.count(name) > 1), None)
    if twice is not None:
        raise ParameterError(f"corruptions names {twice!r} twice: {text!r}; remove one")
    return specs


def _load(source: object, *, paper: bool) -> Config:
    problems = Problems()
    name, tree = _tree(source, problems)
    if tree is None:
        problems.stop(
            Position(name, 1, 1), "the file is empty; write corruptions: [marks, subtitle]"
        )
    if not isinstance(tree, MappingNode):
        problems.stop(
            tree.position,
            f"a configuration is a mapping with the key corruptions, got {describe_node(tree)}",
        )
    config = _config(tree, name, problems, paper)
    problems.check()
    return config


def _tree(source: object, problems: Problems) -> tuple[str, ConfigNode | None]:
    if isinstance(source, Mapping):
        return "<mapping>", from_python(cast("Mapping[str, Any]", source), "<mapping>", problems)
    if isinstance(source, str | os.PathLike):
        name, data = read_config(cast("str | os.PathLike[str]", source), "corruptions")
        return name, read_yaml(data, name, problems)
    raise ParameterTypeError(
        f"a configuration is a path, a name or a mapping, got {short_repr(source)}"
    )


def _config(tree: MappingNode, source: str, problems: Problems, paper: bool) -> Config:
    flag = tree.items.get("paper_compat")
    paper = bool(check(problems, _PAPER, "paper_compat", flag)) if flag else paper
    if WRAPPER in tree.items:
        tree, paper = _unwrapped(tree, problems), paper or flag is None
    if paper and "corruptions" not in tree.items:
        tree = _wrapped(tree)
    options: dict[str, Any] = {}
    for key, value in tree.items.items():
        if key in OPTIONS:
            options[key] = check(problems, OPTIONS[key], key, value)
        elif key not in ("corruptions", "paper_compat"):
            problems.add(tree.keys[key], _unknown(key))
    if "corruptions" not in tree.items:
        problems.add(
            tree.position, "the key corruptions is missing; write corruptions: [marks, subtitle]"
        )
        return Config({}, options, source)
    return Config(Builder(problems, paper).build(tree.items["corruptions"]), options, source)


def _unwrapped(tree: MappingNode, problems: Problems) -> MappingNode:
    """Move what is under `noise` to `corruptions`; note if the file forbids or repeats it."""
    position = tree.keys[WRAPPER]
    if "corruptions" in tree.items:
        problems.add(position, f"{WRAPPER!r} and 'corruptions' both list corruptions; keep one")
        items = {key: item for key, item in tree.items.items() if key != WRAPPER}
        return MappingNode(tree.position, items, tree.keys)
    flag = tree.items.get("paper_compat")
    if isinstance(flag, ScalarNode) and flag.value is False:
        problems.add(
            position,
            f"{WRAPPER!r} is the key of the authors' file, which paper_compat: false does not read;"
            " name it corruptions, or leave out paper_compat",
        )
    renamed = {key if key != WRAPPER else "corruptions": item for key, item in tree.items.items()}
    return MappingNode(tree.position, renamed, {**tree.keys, "corruptions": position})


def _wrapped(tree: MappingNode) -> MappingNode:
    """Move all keys except the options under `corruptions`."""
    keys = {
        key: value
        for key, value in tree.items.items()
        if key not in OPTIONS and key != "paper_compat"
    }
    option_nodes: dict[str, ConfigNode] = {
        key: value for key, value in tree.items.items() if key not in keys
    }
    inner = MappingNode(tree.position, keys, tree.keys)
    return MappingNode(
        tree.position,
        {**option_nodes, "corruptions": inner},
        {**tree.keys, "corruptions": tree.position},
    )


def _unknown(key: str) -> str:
    if paper_name(key, CORRUPTIONS.names()) is not None:
        return f"{key!r} is a corruption; put it under corruptions:"
    return f"unknown key {key!r}{suggest(key, ['corruptions', 'paper_compat', *OPTIONS])}"
