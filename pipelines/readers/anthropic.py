"""Logs of Anthropic's computer use: messages of the Messages API."""

from collections.abc import Iterator
from pathlib import Path

from hijack_data.types import Trajectory

from . import fields
from .base import FileReader, Rejected, register
from .conversation_logs import Conversation, JsonPath, LogEntry, content_parts, read_logs
from .fields import FieldError, FieldTypeError, JsonObject
from .file_head import FileHead
from .recorded_actions import ANTHROPIC
from .safe_files import Source

TOOL = "computer"
_LOOKING_TOOLS = ("screenshot", "zoom", "cursor_position")


@register
class Anthropic(FileReader):
    """Reads logs of Anthropic's computer use.

    A source is a `.json` or `.jsonl` file, or a folder with them; each file is a trajectory, whose
    id is its path without the suffix. A `.jsonl` line is a message or a body, a `.json` file a list
    of messages or a body; a body is an object with a list `messages`. Of the blocks (Messages API,
    "computer use tool") these are read:

    - `text` of the user: the first is the instruction;
    - `image` with a `source` of type `base64`, of the user or in a `tool_result`: the screen for
      the next action;
    - `tool_use` with the name `computer`, or with `toolset_name` `computer` (its name is then the
      action): a step; `action_code` keeps its `input` as JSON.

    `screenshot`, `zoom` and `cursor_position` are no steps, and the cut-out that `zoom` returns is
    not a screen. Of several actions in one turn only those with a screenshot of their own are
    steps, the others are rejected.

    Coordinates: pixels of the screenshot that the action answers; a point outside is rejected.
    """

    name = "anthropic"
    adopts = True

    def recognizes(self, head: FileHead) -> bool:
        """Return whether one of the first messages uses the tool `computer`."""
        parts = (part for entry in head.entries for part in fields.objects(entry.get("content")))
        return any(map(_is_use, parts))

    def read(self, path: Source) -> Iterator[Trajectory | Rejected]:
        """Yield trajectories in the order of the files."""
        return read_logs(path, self.name, _EntryReader())


class _EntryReader:
    """Takes in messages, and notes the uses of the tool that asked for a part of the screen."""

    def __init__(self) -> None:
        self.file: Path | None = None
        self.zooms: set[object] = set()

    def __call__(self, talk: Conversation, entry: LogEntry) -> Iterator[FieldError]:
        if self.file != talk.file:
            self.file = talk.file
            self.zooms = set()
        for pointer, part in content_parts(entry):
            try:
                self._part(talk, entry, pointer, part)
            except FieldError as error:
                yield error

    def _part(
        self, talk: Conversation, entry: LogEntry, pointer: JsonPath, part: JsonObject
    ) -> None:
        kind = part.get("type")
        is_user = entry.data.get("role") == "user"
        if _is_use(part):
            self._use(talk, part)
        elif kind == "text" and is_user:
            talk.ask(part.get("text"))
        elif kind == "image" and is_user:
            _look(talk, entry, pointer, part)
        elif kind == "tool_result" and str(part.get("tool_use_id")) not in self.zooms:
            _result(talk, entry, pointer, part)

    def _use(self, talk: Conversation, part: JsonObject) -> None:
        given = fields.mapping(part.get("input"), "input")
        name = part.get("name")
        action = given if name == TOOL else {"action": name, **given}
        kind = action.get("action")
        if kind == "zoom":
            self.zooms.add(str(part.get("id")))
        if kind not in _LOOKING_TOOLS:
            talk.act(action, ANTHROPIC, "input")


def _result(talk: Conversation, entry: LogEntry, pointer: JsonPath, part: JsonObject) -> None:
    """Take the pictures that a use of the tool returned as the screen."""
    for index, inner in enumerate(fields.listed(part.get("content"))):
        block = fields.mapping(inner, f"content[{index}]")
        if block.get("type") == "image":
            _look(talk, entry, (*pointer, "content", index), block)


def _look(talk: Conversation, entry: LogEntry, pointer: JsonPath, block: JsonObject) -> None:
    source = fields.mapping(block.get("source"), "source")
    if source.get("type") != "base64":
        raise FieldTypeError("source.type", "base64", source.get("type"))
    talk.look(source.get("data"), entry, (*pointer, "source", "data"))


def _is_use(part: JsonObject) -> bool:
    return part.get("type") == "tool_use" and TOOL in (part.get("name"), part.get("toolset_name"))
