"""Write corruptions as a configuration that loads back to the same ones, to record a run."""

from collections.abc import Iterable, Mapping
from typing import Any, cast

import yaml

from ..errors import ParameterError, ParameterTypeError, short_repr
from ..planner import Planner, as_planner
from .build import Builder
from .nodes import Problems, from_python
from .yaml_reader import resolve

WIDTH = 10**6  # characters of a line, so that texts are never wrapped


def dump(
    planners: Mapping[str, Planner] | Iterable[Planner], options: Mapping[str, Any] | None = None
) -> str:
    """Return canonical YAML that `load_config` reads back to equal corruptions.

    Every parameter is written out.

    Args:
        planners: corruptions, `OneOf` and `Sequence`, by label or in a list; the labels of a list
            are the names.
        options: other top-level keys, such as `Config.options`.

    Raises:
        ParameterTypeError: a file cannot hold one of the planners, such as a `Schedule`, which is a
            function.
        ParameterError: two entries of a list have the same name: give a mapping.
        ConfigError: a file cannot hold a label, or there is nothing to write.
    """
    if not isinstance(cast(object, planners), Iterable):
        value = short_repr(planners)
        raise ParameterTypeError(f"dump takes corruptions in a mapping or a list, got {value}")
    if isinstance(planners, Mapping):
        by_label = cast("Mapping[str, Planner]", planners)
    else:
        by_label = _labelled(planners)
    entries = [_entry(planner, label) for label, planner in by_label.items()]
    problems = Problems()
    Builder(problems).build(from_python(entries, "dump", problems))
    problems.check()
    data = {"corruptions": entries, **(options or {})}
    return yaml.dump(data, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=WIDTH)


def _labelled(planners: Iterable[Planner]) -> dict[str, Planner]:
    by_label: dict[str, Planner] = {}
    for planner in planners:
        name, _ = _named(planner)
        if name in by_label:
            raise ParameterError(f"{name} appears twice: give dump a mapping from a label to each")
        by_label[name] = planner
    return by_label


def _entry(planner: Planner, label: str | None) -> dict[str, Any]:
    name, settings = _named(planner)
    if label in (None, name):
        return {name: settings}
    return {name: {"as": label, **settings}}


def _named(planner: Planner) -> tuple[str, dict[str, Any]]:
    """Return the name and the settings of a planner's entry."""
    checked = as_planner(planner, "a configuration holds corruptions, OneOf and Sequence")
    ((name, settings),) = checked.to_config().items()
    return name, settings


class _Dumper(yaml.SafeDumper):
    """Quotes texts that YAML 1.1 or our reader would read as another type."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _represent_text(dumper: yaml.SafeDumper, value: str) -> yaml.ScalarNode:
    needs_quotes = "\n" in value or not isinstance(resolve(value), str)
    style = '"' if needs_quotes else None
    return cast(Any, dumper).represent_scalar("tag:yaml.org,2002:str", value, style=style)


_Dumper.add_representer(str, _represent_text)
