"""Turn the entries of a configuration into planners, and note every mistake at its position."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from ..compose import OneOf, Sequence
from ..corruption import CORRUPTIONS, find_corruption
from ..errors import HijackError, UnknownNameError, suggest
from ..params import Parameter
from ..planner import Planner
from .corruption_settings import check, read_spec
from .nodes import (
    ConfigNode,
    MappingNode,
    Position,
    Problems,
    ScalarNode,
    SequenceNode,
    describe_node,
)
from .paper import paper_name

COMBINATORS = ("one_of", "sequence")
# Labels that have another meaning on the command line or in a dataset.
RESERVED = ("clean", "all")
_LABEL = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.+-]{0,63}")
_LABEL_RULE = "1 to 64 letters, digits, '_', '.', '+' or '-', the first a letter or digit"
_SHARE = Parameter("float", "", low=0, high=1)
_WEIGHT = Parameter("float", "", low=0, high=1e9)
_MAX_TIMES = Parameter("int", "", low=1, high=1000)


@dataclass(frozen=True)
class ConfigEntry:
    """One entry as written: a name and its settings."""

    name: str
    position: Position
    settings: ConfigNode | None


@dataclass
class Builder:
    """Turns trees into planners; with `paper`, the paper's names and keys are read too."""

    problems: Problems
    paper: bool = False
    known_names: list[str] = field(default_factory=lambda: [*CORRUPTIONS.names(), *COMBINATORS])

    def build(self, tree: ConfigNode) -> dict[str, Planner]:
        """Return the planners of the list or mapping under `corruptions`, in order, by label."""
        planners: dict[str, Planner] = {}
        positions: dict[str, Position] = {}
        for entry in self._entries(tree, "corruptions"):
            planner = self._planner(entry)
            label, position = self._label(entry, planner)
            if label in positions:
                first = f" (first in line {positions[label].line})" if position.line else ""
                self.problems.add(
                    position,
                    f"{label!r} appears twice{first}; label one of them, such as as: {label}_2",
                )
            positions.setdefault(label, position)
            if planner is not None:
                planners[label] = planner
        return planners

    def _entries(self, tree: ConfigNode, path: str) -> Iterator[ConfigEntry]:
        if isinstance(tree, ScalarNode):
            advice = "write [marks, subtitle]"
            self.problems.add(
                tree.position,
                f"{path} must be a list of corruptions, got {describe_node(tree)}; {advice}",
            )
        elif not tree.items:
            self.problems.add(tree.position, f"{path} is empty; name at least one corruption")
        elif isinstance(tree, MappingNode):
            yield from (
                ConfigEntry(name, tree.keys[name], settings)
                for name, settings in tree.items.items()
            )
        else:
            for item in tree.items:
                entry = self._entry(item, path)
                if entry is not None:
                    yield entry

    def _entry(self, item: ConfigNode, path: str) -> ConfigEntry | None:
        if isinstance(item, ScalarNode) and isinstance(item.value, str):
            return ConfigEntry(item.value, item.position, None)
        if isinstance(item, MappingNode) and len(item.items) == 1:
            ((name, settings),) = item.items.items()
            return ConfigEntry(name, item.keys[name], settings)
        if isinstance(item, MappingNode) and item.items:
            advice = (
                "write its parameters as name: {key: value}, or indent them deeper than the name"
            )
            problem = f"got the keys {', '.join(item.items)}; {advice}"
        else:
            problem = f"got {describe_node(item)}; write marks, or marks: {{number: 10}}"
        self.problems.add(item.position, f"an entry of {path} names one corruption, {problem}")
        return None

    def _name(self, entry: ConfigEntry) -> str:
        if not self.paper:
            return entry.name
        return paper_name(entry.name, self.known_names) or entry.name

    def _label(self, entry: ConfigEntry, planner: Planner | None) -> tuple[str, Position]:
        """Return the label of an entry (its `as`, or its name) and the position of that label."""
        default = self._name(entry)
        if planner is not None:
            (default,) = planner.to_config()
        if not isinstance(entry.settings, MappingNode) or "as" not in entry.settings.items:
            return default, entry.position
        label_node = entry.settings.items["as"]
        label = label_node.value if isinstance(label_node, ScalarNode) else None
        if not isinstance(label, str) or not _LABEL.fullmatch(label):
            self.problems.add(
                label_node.position, f"as must be {_LABEL_RULE}; got {describe_node(label_node)}"
            )
            return default, entry.position
        if label != default and label in (*RESERVED, *self.known_names):
            self.problems.add(
                label_node.position,
                f"as: {label!r} already means something else; choose another label",
            )
        return label, label_node.position

    def _planner(self, entry: ConfigEntry) -> Planner | None:
        name = self._name(entry)
        if name == "one_of":
            return self._one_of(entry)
        if name == "sequence":
            return self._sequence(entry)
        try:
            cls = find_corruption(name)
        except UnknownNameError as error:
            self.problems.add(entry.position, self._unknown(name, error))
            return None
        except HijackError as error:
            self.problems.add(entry.position, str(error))
            return None
        settings = self._settings(entry, f"the parameters of {cls.name}")
        if settings is None:
            return None
        return read_spec(cls, settings, entry.position, self.problems, paper=self.paper)

    def _unknown(self, name: str, error: UnknownNameError) -> str:
        if name == "clean":
            return (
                "'clean' is not a corruption; to keep the clean rows write clean: true at the top"
            )
        paper_spelling = paper_name(name, self.known_names)
        if paper_spelling is not None:
            return f"unknown corruption {name!r}; did you mean {paper_spelling!r}?"
        close = suggest(name, self.known_names)
        if str(error).startswith("unknown"):
            return f"unknown corruption {name!r}{close}"
        return str(error)

    def _settings(self, entry: ConfigEntry, path: str) -> MappingNode | None:
        settings = entry.settings
        if settings is None or (isinstance(settings, ScalarNode) and settings.value is None):
            return MappingNode(entry.position, {}, {})
        if isinstance(settings, MappingNode):
            return settings
        self.problems.add(
            settings.position,
            f"{path} must be a mapping {{key: value}}, got {describe_node(settings)}",
        )
        return None

    def _sequence(self, entry: ConfigEntry) -> Planner | None:
        combinator = self._combinator(entry, "sequence", "parts", ())
        if combinator is None:
            return None
        parts = self._members(combinator[1], "sequence.parts")
        return Sequence(parts) if parts else None

    def _one_of(self, entry: ConfigEntry) -> Planner | None:
        combinator = self._combinator(
            entry, "one_of", "options", ("p_clean", "weights", "max_times")
        )
        if combinator is None:
            return None
        settings, members = combinator
        before = len(self.problems.mistakes)
        options = self._members(members, "one_of.options")
        clean = settings.items.get("p_clean")
        weights = settings.items.get("weights")
        p_clean = 0.0 if clean is None else check(self.problems, _SHARE, "one_of.p_clean", clean)
        numbers = None if weights is None else self._weights(weights)
        limit = settings.items.get("max_times")
        if limit is not None:
            limit = check(self.problems, _MAX_TIMES, "one_of.max_times", limit)
        if len(self.problems.mistakes) > before:
            return None
        try:
            return OneOf(options, p_clean=p_clean, weights=numbers, max_times=limit)
        except HijackError as error:
            self.problems.add(weights.position if weights else entry.position, str(error))
            return None

    def _weights(self, tree: ConfigNode) -> list[float]:
        if not isinstance(tree, SequenceNode):
            self.problems.add(
                tree.position,
                f"one_of.weights must be a list of numbers, got {describe_node(tree)}",
            )
            return []
        items = enumerate(tree.items)
        return [check(self.problems, _WEIGHT, f"one_of.weights[{i}]", item) for i, item in items]

    def _combinator(
        self, entry: ConfigEntry, path: str, member: str, keys: tuple[str, ...]
    ) -> tuple[MappingNode, ConfigNode] | None:
        """Return the settings of a combinator, and its members; a bare list holds members only."""
        if isinstance(entry.settings, SequenceNode):
            return MappingNode(entry.position, {}, {}), entry.settings
        settings = self._settings(entry, path)
        if settings is None:
            return None
        known_keys = (member, "as", *keys)
        for key in settings.items.keys() - set(known_keys):
            self.problems.add(
                settings.keys[key], f"{path} has no key {key!r}{suggest(key, known_keys)}"
            )
        if member not in settings.items:
            self.problems.add(
                entry.position, f"{path} needs {member}: {path}: {{{member}: [marks, subtitle]}}"
            )
            return None
        return settings, settings.items[member]

    def _members(self, tree: ConfigNode, path: str) -> list[Planner]:
        planners: list[Planner] = []
        for entry in self._entries(tree, path):
            if isinstance(entry.settings, MappingNode) and "as" in entry.settings.keys:
                self.problems.add(
                    entry.settings.keys["as"],
                    "as labels entries of corruptions only; remove it here",
                )
            planner = self._planner(entry)
            if planner is not None:
                planners.append(planner)
        return planners
