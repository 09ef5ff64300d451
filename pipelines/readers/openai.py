"""Logs of OpenAI's computer use: items of the Responses API."""

from collections.abc import Iterator
from pathlib import Path

from hijack_data.platforms import find_platform
from hijack_data.types import Trajectory

from . import fields
from .base import FileReader, Rejected, register
from .conversation_logs import Conversation, LogEntry, content_parts, read_logs
from .fields import FieldError
from .file_head import LISTS, FileHead, one_of_each
from .recorded_actions import OPENAI
from .safe_files import Source

CALL = "computer_call"
RESULT = "computer_call_output"


@register
class OpenAI(FileReader):
    """Reads logs of OpenAI's computer use.

    A source is a `.json` or `.jsonl` file, or a folder with them; each file is a trajectory, whose
    id is its path without the suffix. A `.jsonl` line is an item or a body, a `.json` file a list
    of items or a body; a body is an object with a list `items`, `input` or `output`. Of the items
    (Responses API, "computer use") these are read:

    - `computer_call`: `action`, or the first that does something of `actions`; `action_code` keeps
      all as JSON;
    - `computer_call_output`: `output.image_url` is the screen for the next call.

    A call repeated with the same `call_id` (a body that was sent again) is read once; calls for a
    screenshot alone are no steps. Pictures are `data:` URLs or files in the folder, not web
    addresses or `file_id`s.

    Coordinates: pixels of the screenshot that the call answers; a point outside is rejected.
    """

    name = "openai"
    adopts = True
    keys = one_of_each(("type", *LISTS))

    def recognizes(self, head: FileHead) -> bool:
        """Return whether one of the first items is a `computer_call` or its output."""
        return any(entry.get("type") in (CALL, RESULT) for entry in head.entries)

    def read(self, path: Source) -> Iterator[Trajectory | Rejected]:
        """Yield trajectories in the order of the files."""
        return read_logs(path, self.name, _EntryReader(), repeats=True)


class _EntryReader:
    """Takes in items, each call of a file once."""

    def __init__(self) -> None:
        self.file: Path | None = None
        self.seen: set[tuple[str, str]] = set()

    def __call__(self, conversation: Conversation, entry: LogEntry) -> Iterator[FieldError]:
        if self.file != conversation.file:
            self.file = conversation.file
            self.seen = set()
        kind = entry.data.get("type")
        _environment(conversation, entry.data.get("tools"))
        if kind in (CALL, RESULT):
            self._once(conversation, entry)
        elif entry.data.get("role") == "user" and not conversation.actions:
            yield from _message(conversation, entry)
        elif "role" not in entry.data:
            conversation.add_user_text(entry.data.get("input"))

    def _once(self, conversation: Conversation, entry: LogEntry) -> None:
        """Take in a call or its output, unless it was there before."""
        kind = str(entry.data.get("type"))
        key = (kind, fields.text(entry.data, "call_id"))
        if key in self.seen:
            return
        self.seen.add(key)
        if kind == CALL:
            _call(conversation, entry)
        else:
            _result(conversation, entry)


def _environment(conversation: Conversation, tools: object) -> None:
    """Take in the `environment` of a body's computer tool: a platform, or `"browser"`."""
    for tool in fields.objects(tools):
        environment = tool.get("environment")
        conversation.platform = conversation.platform or find_platform(environment)
        if environment == "browser":
            conversation.apps = ("browser",)


def _message(conversation: Conversation, entry: LogEntry) -> Iterator[FieldError]:
    for pointer, part in content_parts(entry):
        try:
            conversation.add_user_text(part.get("text"))
            if part.get("type") == "input_image":
                conversation.add_screenshot(part.get("image_url"), entry, (*pointer, "image_url"))
        except FieldError as error:
            yield error


def _call(conversation: Conversation, entry: LogEntry) -> None:
    if entry.data.get("actions") is None:
        field = "action"
        raw: object = fields.mapping(entry.data.get("action"), "action")
        actions = [fields.mapping(raw, "action")]
    else:
        field = "actions"
        raw = fields.items(entry.data, "actions")
        actions = fields.mappings(raw, "actions")
    for action in actions:
        if action.get("type") != "screenshot":
            conversation.add_action(action, OPENAI, field, code=raw)
            return


def _result(conversation: Conversation, entry: LogEntry) -> None:
    output = fields.mapping(entry.data.get("output"), "output")
    conversation.add_screenshot(output.get("image_url"), entry, ("output", "image_url"))
