"""Corruptions as one line of text, such as `marks:number=10,severity=4,subtitle`.

    line      = item {("," | ";") item}
    item      = NAME | NAME ":" KEY "=" VALUE | KEY "=" VALUE

A `KEY=VALUE` belongs to the last `NAME:` before it; a `;` ends the settings of that name. Text in
quotes or brackets is not split: `subtitle:subtitle_text="a, b"`. `KEY` is a parameter, `severity`,
or `as`, which gives the label of the rows. `clean` names the uncorrupted rows.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import yaml

from hijack_data import params
from hijack_data.corruption import SETS, Corruption, check_names, corruption_names, find_corruption
from hijack_data.errors import HijackError, suggest
from hijack_data.plan import CLEAN
from hijack_data.planner import Planner

from ..errors import BuildError

NONE = "none"
LABEL = "as"
SEVERITY = "severity"
_CLOSING = {"[": "]", "{": "}", "(": ")"}
_TEXTS = ("str", "choice", "color", "ip")


@dataclass
class _Entry:
    """One corruption as written, and where it begins, counted from 1."""

    name: str
    position: int
    settings: dict[str, tuple[str, int]] = field(default_factory=dict[str, tuple[str, int]])


@dataclass(frozen=True)
class _Item:
    """A part between separators, where it begins, counted from 1, and the separator after it."""

    text: str
    position: int
    after: str

    @property
    def is_setting(self) -> bool:
        """Whether the item is `KEY=VALUE`, without a name."""
        key, sign, _ = self.text.partition("=")
        return bool(sign) and ":" not in key


@dataclass(frozen=True)
class NamedPlanners:
    """The planners of a line by label, and whether the line names the clean rows."""

    planners: dict[str, Planner]
    clean: bool


def parse(text: str) -> NamedPlanners:
    """Return the corruptions in a line.

    Raises:
        BuildError: the line has a mistake; the message names its position.
        UnknownNameError: no corruption has such a name.
    """
    planners: dict[str, Planner] = {}
    clean = False
    for entry in _entries(text):
        if entry.name in (CLEAN, NONE):
            _refuse_settings(entry)
            clean = clean or entry.name == CLEAN
            continue
        label, planner = _planner(entry)
        if label in planners:
            advice = f"label one of them, such as {entry.name}:as={entry.name}_2"
            raise BuildError(f"corruptions: {label!r} is given twice; {advice}")
        planners[label] = planner
    return NamedPlanners(planners, clean)


def _entries(text: str) -> Iterator[_Entry]:
    # yields the corruptions of a line with their settings as text
    entry: _Entry | None = None
    is_closed = True  # whether the settings of `entry` have ended
    for item in _items(text):
        if item.is_setting and entry is not None and not is_closed:
            key, _, value = item.text.partition("=")
            _set(entry, key, value, item.position)
        elif item.is_setting:
            reason = f"{item.text!r} belongs to no corruption; write NAME:{item.text}"
            raise _wrong(item.position, reason)
        elif item.text:
            if entry is not None:
                yield entry
            entry = _named(item)
            is_closed = ":" not in item.text
        if item.after == ";":
            is_closed = True
    if entry is not None:
        yield entry


def _named(item: _Item) -> _Entry:
    """Return the corruption of `NAME`, or of `NAME:KEY=VALUE` with its first setting."""
    name, colon, setting = item.text.partition(":")
    entry = _Entry(name.strip(), item.position)
    if colon:
        key, sign, value = setting.partition("=")
        position = item.position + item.text.index(":") + 1
        _set(entry, key, value if sign else None, position)
    return entry


def _set(entry: _Entry, key: str, value: str | None, position: int) -> None:
    name = key.strip()
    if value is None or not name:
        example = f"{entry.name}:{name or 'KEY'}=VALUE"
        raise _wrong(position, f"a setting of {entry.name} must be KEY=VALUE, such as {example}")
    if name in entry.settings:
        raise _wrong(position, f"{entry.name}: {name!r} is given twice")
    entry.settings[name] = value.strip(), position


def _items(text: str) -> Iterator[_Item]:
    # yields the parts between separators, except for separators in quotes and brackets
    start = 0
    closing: list[str] = []
    quote = ""
    for index, letter in enumerate(text):
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'" and text[start:index].rstrip().endswith("="):
            quote = letter
        elif letter in _CLOSING:
            closing.append(_CLOSING[letter])
        elif closing and letter == closing[-1]:
            closing.pop()
        elif letter in ",;" and not closing:
            yield _item(text, start, index, letter)
            start = index + 1
    if quote or closing:
        raise _wrong(len(text) + 1, f"{quote or closing[-1]!r} is missing")
    yield _item(text, start, len(text), "")


def _item(text: str, start: int, end: int, after: str) -> _Item:
    part = text[start:end]
    spaces = len(part) - len(part.lstrip())
    return _Item(part.strip(), start + spaces + 1, after)


def _planner(entry: _Entry) -> tuple[str, Planner]:
    if entry.name in SETS:
        members = corruption_names(entry.name)
        faults = [name for name in members if not find_corruption(name).effects]
        advice = f"what the others do is not known of a recording; name {','.join(faults)}"
        raise _wrong(entry.position, f"{entry.name} is a set of {len(members)}, and {advice}")
    cls = find_corruption(entry.name)
    make: Callable[..., Planner] = cls
    values: dict[str, Any] = {}
    label = cls.name
    for key, (text, position) in entry.settings.items():
        if key == LABEL:
            label = text
        elif key == SEVERITY:
            make = partial(cls.at, _severity(text, position))
        else:
            values[key] = _value(cls, key, text, position)
    try:
        return label, make(**values)
    except HijackError as error:
        raise _wrong(entry.position, f"{entry.name}: {error}") from None


def _value(cls: type[Corruption], key: str, text: str, position: int) -> Any:
    keys = (*params.parameters(cls), SEVERITY, LABEL)
    if key not in keys:
        raise _wrong(position, f"{cls.name} has no parameter {key!r}{suggest(key, keys)}")
    check_names(cls, {key: None})
    parameter, _ = params.parameters(cls)[key]
    if parameter.kind in _TEXTS:
        return _unquoted(text).replace("\\n", "\n")
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError:
        raise _wrong(position, f"{key}: {text!r} cannot be read as {parameter.accepts}") from None


def _unquoted(text: str) -> str:
    is_quoted = len(text) > 1 and text[0] in "\"'" and text[-1] == text[0]
    return text[1:-1] if is_quoted else text


def _severity(text: str, position: int) -> int:
    if text not in ("1", "2", "3", "4", "5"):
        raise _wrong(position, f"severity must be 1 to 5, got {text!r}")
    return int(text)


def _refuse_settings(entry: _Entry) -> None:
    if entry.settings:
        raise _wrong(entry.position, f"{entry.name!r} takes no settings")


def _wrong(position: int, reason: str) -> BuildError:
    return BuildError(f"corruptions, at character {position}: {reason}")
