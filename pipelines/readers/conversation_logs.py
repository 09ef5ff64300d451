"""Logs of conversations: the entries of a file, and the screen of each action."""

import json
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeAlias, cast

from hijack_data.errors import short_repr
from hijack_data.types import Platform, Size, Step, Trajectory, size_text

from . import fields
from .base import Rejected, files_below
from .fields import FieldError, FieldTypeError, JsonObject
from .file_head import LISTS
from .json_rows import is_json
from .recorded_actions import RecordedStep, first_action, raw_action_text
from .recorded_pictures import decode_base64, in_json
from .safe_files import Source, image_size, inside, lines, parse_any, relative_name, source_root

PICTURES = (".png", ".jpg", ".jpeg", ".webp")
_ENTRY_KEYS = frozenset({"role", "type"})  # a message or an item has one, a body has none
# Fields of a body whose list goes on with what the server holds (OpenAI's Responses API).
_CONTINUES = ("previous_response_id", "conversation")
_ONE_RUN = "a file is one run: write a file for each run, with its last body alone"
JsonPath = tuple[str | int, ...]


@dataclass(frozen=True)
class LogEntry:
    """One message or item of a log, and its place.

    Args:
        data: the message or item.
        location: the place in reports.
        offset: where its line begins; `None` in a `.json` file.
        pointer: keys and indices from the file's value, or the line's, to the entry.
    """

    data: JsonObject
    location: str
    offset: int | None
    pointer: JsonPath


class OtherFormatError(FieldError):
    """Raised by a reader if a whole file is of another format."""


@dataclass
class Conversation:
    """One log file, while it is read: the screen that was shown last, and the steps so far."""

    file: Path
    root: Path
    source: str
    instruction: str = ""
    steps: list[Step] = field(default_factory=list[Step])
    actions: int = 0
    image: str = ""
    size: Size = (0, 0)
    display: Size | None = None
    no_screen: str = "no screenshot came before this action"
    apps: tuple[str, ...] = ()
    platform: Platform | None = None

    def add_screenshot(self, value: object, entry: LogEntry, pointer: JsonPath) -> None:
        """Add a screenshot.

        Args:
            value: a `data:` URL, bare base64, or the path of a file beside the log.
            entry: the entry that contains it.
            pointer: keys and indices from the entry to it.

        Raises:
            FieldError: the screenshot is on the web, or cannot be read.
            FieldTypeError: the value is not text.
        """
        self.image = ""
        self.no_screen = "the screenshot before this action cannot be read"
        if not isinstance(value, str) or not value:
            raise FieldTypeError("image", "a data: URL or a path", value)
        if value.startswith(("http:", "https:")):
            reason = "is on the web; only data: URLs and files in the folder are read"
            raise FieldError("image", reason)
        if _is_path(value):
            folder = relative_name(self.file.parent, self.root)
            path = inside(self.root, os.path.join(folder, value))
            self.size = image_size(path)
            self.image = os.fspath(path)
        else:
            self.size = image_size(decode_base64(value))
            self.image = in_json(self.file, entry.offset, (*entry.pointer, *pointer))

    def add_action(self, raw: object, dialect: str, field_name: str, code: object = None) -> None:
        """Add an action.

        Args:
            raw: the action in its dialect.
            dialect: name of the dialect.
            field_name: the field of the action.
            code: the text to keep of it, if that is not `raw` itself.

        Raises:
            FieldError: the action is broken, or there is no screenshot between it and the previous
                action.
        """
        self.actions += 1
        image = self.image
        reason = self.no_screen
        self.image = ""
        self.no_screen = "no screenshot was taken between this action and the one before"
        if not image:
            raise FieldError("screenshot", reason)
        action = first_action(raw, dialect, self.size, field_name)
        if self.display not in (None, self.size) and (action.point or action.end):
            raise FieldError(
                "tools",
                f"state a display of {size_text(self.display)}, but the screenshot is"
                f" {size_text(self.size)}, so it is unknown what the coordinates count; save the"
                " screenshots in the size of the display",
            )
        text = raw_action_text(raw if code is None else code, field_name)
        self.steps.append(RecordedStep(self.actions, image, action, text, dialect=dialect))

    def add_tools(self, tools: object) -> None:
        """Add the size of the display that a body's computer tool states, if it does."""
        for tool in fields.objects(tools):
            for unit in ("", "_px"):
                size = tool.get(f"display_height{unit}"), tool.get(f"display_width{unit}")
                if all(isinstance(side, int) for side in size):
                    self.display = cast("Size", size)

    def add_user_text(self, text: object) -> None:
        """Add a text of the user; the first of which is the instruction."""
        if not self.instruction and isinstance(text, str) and text.strip():
            self.instruction = fields.storable(text.strip(), "instruction")

    def trajectory(self, name: str) -> Iterator[Trajectory | Rejected]:
        """Yield the trajectory, or the reason why there is none."""
        file = relative_name(self.file, self.root)
        if not self.actions:
            yield Rejected(file, "", "", f"holds no action of format {self.source}")
        elif not self.instruction:
            yield Rejected(file, "", "instruction", "no message of the user holds text")
        elif self.steps:
            yield Trajectory(
                id=name,
                source=self.source,
                instruction=self.instruction,
                steps=tuple(self.steps),
                apps=self.apps,
                platform=self.platform,
            )


ReadEntry: TypeAlias = Callable[[Conversation, LogEntry], Iterator[FieldError]]


def read_logs(
    path: Source, source: str, take: ReadEntry, *, repeats: bool = False
) -> Iterator[Trajectory | Rejected]:
    """Read every log of a source; each file is a trajectory.

    Args:
        path: the source.
        source: name of the format.
        take: handles an entry, and yields the errors in it.
        repeats: `take` knows the entries that it had before, so that a body may repeat them with
            changes.
    """
    root = source_root(path)
    ids: set[str] = set()
    for file in files_below(path):
        if isinstance(file, Rejected):
            yield file
        elif is_json(file):
            conversation = Conversation(file, root, source)
            yield from _conversation(conversation, take, ids, _History(repeats))


def _conversation(
    conversation: Conversation, take: ReadEntry, ids: set[str], history: "_History"
) -> Iterator[Trajectory | Rejected]:
    file = relative_name(conversation.file, conversation.root)
    name = os.path.splitext(file)[0]
    try:
        inside(conversation.root, file, "")
        for entry in entries(conversation.file, history):
            if isinstance(entry, Rejected):
                yield Rejected(file, entry.where, entry.field, entry.reason)
                continue
            for error in _take_entry(conversation, entry, take):
                yield Rejected(file, entry.location, error.field, error.reason)
        if name in ids:
            raise FieldError("id", f"{name!r} was there before, in a file with another suffix")
        ids.add(name)
        yield from conversation.trajectory(name)
    except FieldError as error:
        yield Rejected(file, "", error.field, error.reason)
    except OSError as error:
        yield Rejected(file, "", "", f"cannot be read ({error.strerror or error})")


def _take_entry(
    conversation: Conversation, entry: LogEntry, take: ReadEntry
) -> Iterator[FieldError]:
    try:
        conversation.add_tools(entry.data.get("tools"))
        yield from take(conversation, entry)
    except OtherFormatError:
        raise
    except FieldError as error:
        yield error


@dataclass
class _History:
    """The entries of a log so far, as digests.

    A client sends the whole conversation with each request, so the body of a later one repeats what
    earlier lines hold.

    Args:
        repeats: a body may repeat earlier entries with changes.
    """

    repeats: bool
    digests: list[str] = field(default_factory=list[str])

    def count_known(self, body: JsonObject, values: list[Any]) -> int:
        """Return how many of a body's first entries earlier lines hold, and note the others.

        Raises:
            FieldError: the list is of another conversation, or it is unknown what it repeats.
        """
        digests = [_digest(value) for value in values]
        count = len(self.digests)
        if digests[:count] == self.digests:
            self.digests = digests
            return count
        if _begins(values) and not any(body.get(key) for key in _CONTINUES):
            if digests[0] != self.digests[0]:
                raise FieldError("", f"begins another conversation; {_ONE_RUN}")
            if not self.repeats:
                raise FieldError("", f"repeats earlier messages with changes; {_ONE_RUN}")
        self.digests += digests
        return 0


def _begins(values: list[Any]) -> bool:
    """Return whether a list begins as a conversation does, with words and not with a result."""
    first = next(iter(fields.objects(values[:1])), {})
    if first.get("role") not in ("user", "system", "developer"):
        return False
    parts = fields.objects(first.get("content"))
    return not parts or any(part.get("type") in ("text", "input_text") for part in parts)


def _digest(value: object) -> str:
    """Return the hash of an entry; of a message, only its role and content count."""
    if isinstance(value, dict) and "role" in value:
        message = cast("dict[str, object]", value)
        value = [message["role"], message.get("content")]
    return sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def entries(file: Path, history: _History) -> Iterator[LogEntry | Rejected]:
    """Yield the entries of a log: lines of a `.jsonl`, or a list in a `.json`.

    Bodies with one of the `LISTS` are spread out, without what earlier lines hold. A line that
    cannot be read is a `Rejected` without file; a `.json` file that cannot be read, and a body of
    another conversation, are a `FieldError`.
    """
    if file.suffix == ".jsonl":
        for line in lines(file):
            location = f"line {line.number}"
            try:
                record = line.record()
            except FieldError as error:
                yield Rejected("", location, error.field, error.reason)
                continue
            yield from _spread(record, location, line.offset, history)
        return
    data = parse_any(file)
    if isinstance(data, list):
        yield from _items(cast("list[object]", data), "entry", None, ())
    else:
        yield from _spread(fields.mapping(data, ""), "", None, history)


def content_parts(entry: LogEntry) -> Iterator[tuple[JsonPath, JsonObject]]:
    """Yield the parts of a message's `content`, with the pointer to each; text is one part."""
    content: object = entry.data.get("content")
    if isinstance(content, str):
        yield ("content",), {"type": "text", "text": content}
    elif isinstance(content, list):
        for index, part in enumerate(cast("list[object]", content)):
            yield ("content", index), fields.mapping(part, f"content[{index}]")


def _spread(
    record: JsonObject, location: str, offset: int | None, history: _History
) -> Iterator[LogEntry | Rejected]:
    """Yield a message, or the parts of a body.

    Raises:
        FieldError: the body is of another conversation than earlier lines.
    """
    inner = [key for key in LISTS if isinstance(record.get(key), list)]
    if record.keys() & _ENTRY_KEYS:
        history.digests.append(_digest(record))
    elif isinstance(record.get("input"), str):  # short for a message of the user
        message = {"role": "user", "content": record["input"]}
        _count_known(history, record, [message], location, "input")
    if not inner or "role" in record:
        yield LogEntry(record, location, offset, ())
        return
    outer = {key: value for key, value in record.items() if key not in inner}
    yield LogEntry(outer, location, offset, ())
    for key in inner:
        start = _count_known(history, record, record[key], location, key)
        list_location = f"{location}, {key}" if location else key
        yield from _items(record[key], list_location, offset, (key,), start)


def _count_known(
    history: _History, record: JsonObject, values: list[Any], location: str, key: str
) -> int:
    """Return how many of a body's first entries earlier lines hold.

    Raises:
        FieldError: as `_History.count_known` raises it, with the line and the field of the list.
    """
    try:
        return history.count_known(record, values)
    except FieldError as error:
        raise FieldError(", ".join(filter(None, (location, key))), error.reason) from None


def _items(
    values: list[Any], location: str, offset: int | None, pointer: JsonPath, start: int = 0
) -> Iterator[LogEntry | Rejected]:
    for index, value in enumerate(values[start:], start):
        item_location = f"{location} {index}"
        if isinstance(value, dict):
            yield LogEntry(cast("dict[str, Any]", value), item_location, offset, (*pointer, index))
        else:
            yield Rejected("", item_location, "", f"must be an object, got {short_repr(value)}")


def _is_path(value: str) -> bool:
    # base64 text has no dot
    return not value.startswith("data:") and value[-5:].lower().endswith(PICTURES)
