"""Read YAML text into a tree whose nodes know their positions.

Plain scalars follow the core rules of YAML 1.2, not the surprises of 1.1: `no`, `on`, `1:30`, `010`
and dates are texts, and `1e3` is a number. Tags and merge keys are refused, a key may not appear
twice, depth and size are bounded.

The tree is built from PyYAML's events rather than by `yaml.compose`. `compose` has the whole
document in memory before anything can be counted: it takes 11.7 s and 350 MiB for a hostile list of
1 MiB, which this reader's limit on values ends after 0.2 s. It raises `RecursionError` for 500
nested lists. Its nodes no longer show an explicit tag, the place of an alias, or an alias inside
its own anchor.
"""

import re
from typing import Any, cast

import yaml

from ..errors import ConfigError
from ..surrogates import has_half
from .nodes import (
    MAX_DEPTH,
    MAX_DIGITS,
    MAX_VALUES,
    ConfigNode,
    MappingNode,
    Position,
    Problems,
    ScalarNode,
    SequenceNode,
    describe_node,
)

_LINE_BREAK = re.compile("\r\n|[\r\n\x85\u2028\u2029]")
_NULL = re.compile(r"~|null|Null|NULL|")
_BOOL = re.compile(r"true|True|TRUE|false|False|FALSE")
_INT = re.compile(r"[-+]?(?:0|[1-9][0-9]*)")
_FLOAT = re.compile(
    r"[-+]?(?:\.[0-9]+|(?:0|[1-9][0-9]*)(?=[.eE])(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?"
)
_SPECIAL = re.compile(r"[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)")
_ADVICE = {
    "mapping values are not allowed": 'put a text that holds ": " in quotes',
    "cannot start any token": "put the text in quotes",
    "block sequence entries are not allowed": "put a lone - in quotes",
}


def resolve(text: str) -> object:
    """Return the value of a plain scalar: `None`, a bool, an int, a float or the text itself."""
    if _NULL.fullmatch(text):
        return None
    if _BOOL.fullmatch(text):
        return text.lower() == "true"
    if _INT.fullmatch(text) and len(text) <= MAX_DIGITS:
        return int(text)
    if _FLOAT.fullmatch(text):
        return float(text)
    if _SPECIAL.fullmatch(text):
        return float(text.replace(".", "", 1))
    return text


def read_yaml(data: bytes, file: str, problems: Problems) -> ConfigNode | None:
    """Return the one document of a YAML file, or `None` when it is empty.

    A mistake after which reading can go on is noted in `problems`.

    Args:
        data: the bytes of the file, UTF-8 with or without a byte order mark.
        file: the name of the file in messages.
        problems: receives the mistakes.

    Raises:
        ConfigError: a mistake ends the reading; the error has all mistakes so far.
    """
    text = _decode(data, file, problems)
    try:
        reader = _Reader(text, file, problems)
    except yaml.reader.ReaderError as error:
        code = f"U+{ord(text[error.position]):04X}"
        position = _end_position(text[: error.position], file)
        problems.stop(position, f"the character {code} is not allowed; remove it")
    try:
        return reader.document()
    except ConfigError:
        raise
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark or reader.mark()
        problems.stop(_position(mark, file), _syntax(error, text[mark.index : mark.index + 1]))
    except (ValueError, OverflowError):
        # PyYAML passes \UFFFFFFFF to chr, and version numbers of any length to int.
        position = _position(reader.mark(), file)
        problems.stop(
            position, "not valid YAML: a character code or version number is out of range"
        )


def _decode(data: bytes, file: str, problems: Problems) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        # `start` does not count the byte order mark, which the codec removes first.
        at = data.removeprefix(b"\xef\xbb\xbf")
        position = _end_position(at[: error.start].decode(), file)
        problems.stop(
            position, f"byte 0x{at[error.start]:02x} is not UTF-8; save the file as UTF-8"
        )


def _position(mark: Any, file: str) -> Position:
    return Position(file, mark.line + 1, mark.column + 1)


def _end_position(text: str, file: str) -> Position:
    lines = _LINE_BREAK.split(text)
    return Position(file, len(lines), len(lines[-1]) + 1)


def _syntax(error: yaml.MarkedYAMLError, character: str) -> str:
    if character == "\t":
        return "a tab cannot indent or separate here; use spaces"
    message = ", ".join(part for part in (error.context, error.problem) if part)
    advice = [text for start, text in _ADVICE.items() if start in message]
    return f"not valid YAML: {'; '.join([message, *advice])}"


def _height(tree: ConfigNode) -> int:
    if isinstance(tree, SequenceNode):
        heights = [_height(child) for child in tree.items]
    elif isinstance(tree, MappingNode):
        heights = [_height(child) for child in tree.items.values()]
    else:
        return 0
    return 1 + max(heights, default=-1)


class _Reader:
    """Builds the tree from the events of PyYAML's parser, which constructs no Python objects."""

    def __init__(self, text: str, file: str, problems: Problems) -> None:
        self._parser = cast(Any, yaml.SafeLoader(text))
        self._file = file
        self._problems = problems
        self._count = 0
        # The tree behind each anchor, with its number of values and its height.
        self._anchors: dict[str, tuple[ConfigNode, int, int]] = {}

    def mark(self) -> Any:
        """Return the parser's position in the text."""
        return self._parser.get_mark()

    def document(self) -> ConfigNode | None:
        """Return the only document, `None` when it is empty."""
        self._parser.get_event()  # the start of the stream
        if isinstance(self._parser.get_event(), yaml.StreamEndEvent):
            return None
        tree = self._tree(0)
        self._parser.get_event()  # the end of the document
        after = self._parser.get_event()
        if not isinstance(after, yaml.StreamEndEvent):
            message = "a second document starts here; a configuration is one document"
            self._problems.add(self._event_position(after), message)
        if isinstance(tree, ScalarNode) and tree.value is None:
            return None
        return tree

    def _event_position(self, event: Any) -> Position:
        return _position(event.start_mark, self._file)

    def _grow(self, by: int, position: Position) -> None:
        self._count += by
        if self._count > MAX_VALUES:
            self._problems.stop(
                position, f"more than {MAX_VALUES} values, those behind aliases included; use fewer"
            )

    def _tree(self, depth: int) -> ConfigNode:
        event = self._parser.get_event()
        position = self._event_position(event)
        self._limit_depth(depth, position)
        if isinstance(event, yaml.AliasEvent):
            return self._alias(event, position, depth)
        before = self._count
        self._grow(1, position)
        self._refuse_tag(event.tag, position)
        if isinstance(event, yaml.SequenceStartEvent):
            tree = self._sequence(position, depth)
        elif isinstance(event, yaml.MappingStartEvent):
            tree = self._mapping(position, depth)
        else:
            tree = self._scalar(event, position)
        if event.anchor is not None:
            self._anchors[event.anchor] = tree, self._count - before, _height(tree)
        return tree

    def _refuse_tag(self, tag: str | None, position: Position) -> None:
        if tag is not None:
            name = tag.replace("tag:yaml.org,2002:", "!!")
            advice = "remove it (quotes make a text of anything)"
            self._problems.add(position, f"the tag {name!r} is refused; {advice}")

    def _alias(self, event: Any, position: Position, depth: int) -> ConfigNode:
        if event.anchor not in self._anchors:
            self._problems.stop(
                position,
                f"the alias *{event.anchor} has no finished anchor &{event.anchor} before it",
            )
        tree, size, height = self._anchors[event.anchor]
        self._grow(size, position)
        self._limit_depth(depth + height, position)
        return tree

    def _limit_depth(self, depth: int, position: Position) -> None:
        if depth > MAX_DEPTH:
            self._problems.stop(position, f"nested more than {MAX_DEPTH} levels deep; flatten it")

    def _ends(self, kind: type) -> bool:
        return self._parser.check_event(kind) and self._parser.get_event() is not None

    def _sequence(self, position: Position, depth: int) -> SequenceNode:
        items: list[ConfigNode] = []
        while not self._ends(yaml.SequenceEndEvent):
            items.append(self._tree(depth + 1))
        return SequenceNode(position, items)

    def _mapping(self, position: Position, depth: int) -> MappingNode:
        mapping = MappingNode(position, {}, {})
        while not self._ends(yaml.MappingEndEvent):
            key = self._tree(depth + 1)
            value = self._tree(depth + 1)
            mistake = self._mistake_of_key(key, mapping)
            if mistake:
                self._problems.add(key.position, mistake)
                continue
            name = _key_name(key)
            mapping.items[name] = value
            mapping.keys[name] = key.position
        return mapping

    def _mistake_of_key(self, key: ConfigNode, mapping: MappingNode) -> str:
        if not isinstance(key, ScalarNode):
            return f"a key must be a name, not {describe_node(key)}; quote a text with braces"
        name = _key_name(key)
        if name == "<<":
            return "merge keys (<<) are not read; write the keys out"
        if name in mapping.keys:
            line = mapping.keys[name].line
            return f"the key {name!r} appears twice (first in line {line}); remove one"
        return ""

    def _scalar(self, event: Any, position: Position) -> ScalarNode:
        text = cast(str, event.value)
        if has_half(text):
            message = (
                "a \\u escape holds half a character (a surrogate); write the character itself"
            )
            self._problems.add(position, message)
        if event.style is not None:
            return ScalarNode(position, text)
        if len(text) > MAX_DIGITS and _INT.fullmatch(text):
            message = f"a whole number of {len(text)} digits; the limit is {MAX_DIGITS}"
            self._problems.add(position, message)
            return ScalarNode(position, 0, text)
        return ScalarNode(position, resolve(text), text)


def _key_name(key: ConfigNode) -> str:
    if isinstance(key, ScalarNode):
        return str(key.value) if key.text is None else key.text
    return ""
