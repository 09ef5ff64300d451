"""Configuration data as a tree whose nodes have positions, and the list of mistakes found in it."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NoReturn, TypeAlias, cast

from ..errors import ConfigError

MAX_VALUES = 10_000
MAX_DEPTH = 32
MAX_DIGITS = 40
MAX_MESSAGE = 400


@dataclass(frozen=True)
class Position:
    """The position of a value in a file.

    Attributes:
        file: the path, the name of a packaged configuration, or the path of a value in Python data.
        line: the line, from 1; 0 for a file as a whole and for Python data.
        column: the column, from 1; 0 where the line is 0.
    """

    file: str
    line: int = 0
    column: int = 0

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}" if self.line else self.file


@dataclass(frozen=True)
class ScalarNode:
    """A single value.

    Attributes:
        position: its position.
        value: `None`, a bool, an int, a float or a text.
        text: a plain (unquoted) scalar as it was written; `None` for any other value.
    """

    position: Position
    value: object
    text: str | None = None


@dataclass(frozen=True)
class SequenceNode:
    """A list."""

    position: Position
    items: "list[ConfigNode]"


@dataclass(frozen=True)
class MappingNode:
    """A mapping; `keys` has the position of each key."""

    position: Position
    items: "dict[str, ConfigNode]"
    keys: dict[str, Position]


ConfigNode: TypeAlias = ScalarNode | SequenceNode | MappingNode


@dataclass
class Problems:
    """The mistakes noted so far."""

    mistakes: list[tuple[Position, str]] = field(default_factory=list[tuple[Position, str]])

    def add(self, position: Position, message: str) -> None:
        """Note a mistake and go on."""
        # Names in files may hold any character; an error must stay printable and on one line.
        printable = message.encode("utf-8", "backslashreplace").decode()
        line = printable.replace("\n", "\\n")
        if len(line) > MAX_MESSAGE:
            line = line[:MAX_MESSAGE] + " ..."
        self.mistakes.append((position, line))

    def error(self) -> ConfigError:
        """Return all mistakes as one error, ordered by position."""
        ordered = sorted(self.mistakes, key=lambda problem: (problem[0].line, problem[0].column))
        return ConfigError(f"{position}: {message}" for position, message in ordered)

    def check(self) -> None:
        """Raise a `ConfigError` with all mistakes, if there are any."""
        if self.mistakes:
            raise self.error()

    def stop(self, position: Position, message: str) -> NoReturn:
        """Note a mistake that ends the reading, and raise a `ConfigError` with all mistakes."""
        self.add(position, message)
        raise self.error()


def plain(tree: ConfigNode) -> Any:
    """Return a tree as plain Python data."""
    match tree:
        case ScalarNode():
            return tree.value
        case SequenceNode():
            return [plain(item) for item in tree.items]
        case MappingNode():
            return {key: plain(item) for key, item in tree.items.items()}


def describe_node(tree: ConfigNode) -> str:
    """Return a description of a node for messages, such as `"a list"` or `"5 (int)"`."""
    match tree:
        case SequenceNode():
            return "a list"
        case MappingNode():
            return "a mapping"
        case ScalarNode(value=None):
            return "nothing"
        case ScalarNode():
            return f"{tree.value!r} ({type(tree.value).__name__})"


def from_python(value: object, name: str, problems: Problems) -> ConfigNode:
    """Return Python data (mappings, lists, scalars) as a tree.

    The limits are those of files, because data with shared lists and mappings (from YAML aliases)
    can be huge or endless when written out.

    Args:
        value: the data.
        name: the name of the data in messages.
        problems: receives the mistakes.
    """
    return _convert(value, name, problems, 0, itertools.count(1))


def _convert(
    value: object, name: str, problems: Problems, depth: int, counter: Iterator[int]
) -> ConfigNode:
    position = Position(name)
    if depth > MAX_DEPTH or next(counter) > MAX_VALUES:
        limits = f"more than {MAX_DEPTH} levels deep or {MAX_VALUES} values in all"
        problems.stop(position, f"{limits}; make it smaller")
    if isinstance(value, Mapping):
        mapping = MappingNode(position, {}, {})
        for key, item in cast("Mapping[object, object]", value).items():
            if not isinstance(key, str):
                message = f"keys must be strings, got one of type {type(key).__name__}"
                problems.add(position, message)
                continue
            path = f"{name}.{key}"
            mapping.keys[key] = Position(path)
            mapping.items[key] = _convert(item, path, problems, depth + 1, counter)
        return mapping
    if isinstance(value, list | tuple):
        items: list[ConfigNode] = []
        for i, item in enumerate(cast("Sequence[object]", value)):
            items.append(_convert(item, f"{name}[{i}]", problems, depth + 1, counter))
        return SequenceNode(position, items)
    if isinstance(value, int) and abs(value) >= 10**MAX_DIGITS:
        problems.stop(
            position, f"a whole number of more than {MAX_DIGITS} digits; use a smaller one"
        )
    return ScalarNode(position, value)
