"""Logs of UI-TARS: chat messages with screenshots, and replies in its action text."""

import re
from collections.abc import Iterator
from typing import Any, cast

from hijack_data.errors import short_repr
from hijack_data.types import Trajectory

from . import fields
from .base import FileReader, Rejected, register
from .chat import Chat
from .conversation_logs import Conversation, LogEntry, OtherFormatError, content_parts, read_logs
from .fields import FieldError, JsonObject
from .file_head import LISTS, FileHead, one_of_each
from .recorded_actions import UI_TARS, UI_TARS_15
from .safe_files import Source

_ACTION = re.compile(
    r"\b(?:click|left_double|right_single|drag|scroll)\((?:start_box|point|start_point)="
    r"|\b(?:hotkey\(key=|type\(content=|wait\(\)|finished\()|<function=\w+>"
)
# The prompt that UI-TARS was trained with puts the task under this heading.
_TASK = "## User Instruction"
_PIXELS = re.compile(r"ui-?tars-?1[.\-]5", re.IGNORECASE)
_THOUSAND = re.compile(r"doubao|ui-?tars-?(?:1[.\-]0|2b|7b|72b)", re.IGNORECASE)


class _UITars(FileReader):
    name = ""
    adopts = True
    keys = one_of_each(("role", *LISTS))

    def recognizes(self, head: FileHead) -> bool:
        """Return whether one of the first replies has UI-TARS actions of this version."""
        if head.has_keys(Chat.keys):
            return False
        models = {_version(entry.get("model")) for entry in head.entries}
        replies = (_text(entry) for entry in head.entries if entry.get("role") == "assistant")
        return any(map(_ACTION.search, replies)) and (self.name in models or models <= {""})

    def read(self, path: Source) -> Iterator[Trajectory | Rejected]:
        """Yield trajectories in the order of the files."""
        return read_logs(path, self.name, self._take)

    def _take(self, conversation: Conversation, entry: LogEntry) -> Iterator[FieldError]:
        version = _version(entry.data.get("model"))
        if version not in ("", self.name):
            raise OtherFormatError(
                "model",
                f"{short_repr(entry.data['model'])} writes {version}; read it with that format",
            )
        conversation.add_user_text(entry.data.get("instruction"))
        if entry.data.get("role") == "assistant":
            text = _text(entry.data)
            conversation.add_action(text, self.name, "content")
        elif entry.data.get("role") == "user":
            yield from _user(conversation, entry)


@register
class UITars(_UITars):
    """Reads logs of UI-TARS 1.0 (and of Doubao-UI-TARS, which counts alike).

    A source is a `.json` or `.jsonl` file, or a folder with them; each file is a trajectory, whose
    id is its path without the suffix. A `.jsonl` line is a chat message, a `.json` file a list of
    them or an object with `messages`; `model` and `instruction` may stand beside them. A message
    has a `role` and `content`, text or parts as the chat completions API has them: `text`, and
    `image_url` with a `data:` URL or a file in the folder. Without an `instruction`, it is what
    stands under "User Instruction" in the first text of the user, or all of it.

    A step is a reply; `action_code` is all of it. Where it holds several actions the step's is the
    first, since there is no picture of the screen between them.

    Coordinates: 0..1000 of the picture. Version 1.5 writes the same text in pixels of the
    smart-resized picture, so which of the two it is must be said, by `model` in the log or by the
    name of the format: it is never guessed.
    """

    name = UI_TARS


@register
class UITars15(_UITars):
    """Reads logs of UI-TARS 1.5, laid out as those of `UITars`.

    Coordinates: pixels of the smart-resized picture (`hijack_data.coords.smart_resize`), mapped to
    the picture with one rounding. What is more than 5 % outside is rejected.
    """

    name = UI_TARS_15


def _user(conversation: Conversation, entry: LogEntry) -> Iterator[FieldError]:
    for pointer, part in content_parts(entry):
        try:
            if part.get("type") == "text":
                conversation.add_user_text(str(part.get("text")).rpartition(_TASK)[2])
            elif part.get("type") == "image_url":
                conversation.add_screenshot(*_link(part, entry, pointer))
        except FieldError as error:
            yield error


def _link(
    part: JsonObject, entry: LogEntry, pointer: tuple[str | int, ...]
) -> tuple[Any, LogEntry, Any]:
    link: object = part.get("image_url")
    if isinstance(link, dict):
        return cast("dict[str, object]", link).get("url"), entry, (*pointer, "image_url", "url")
    return link, entry, (*pointer, "image_url")


def _version(model: object) -> str:
    """Return the dialect that a model writes; `""` if its name does not state it."""
    if not isinstance(model, str):
        return ""
    if _PIXELS.search(model):
        return UI_TARS_15
    return UI_TARS if _THOUSAND.search(model) else ""


def _text(message: JsonObject) -> str:
    content: object = message.get("content")
    if isinstance(content, str):
        return content
    parts = fields.objects(content)
    return "\n".join(str(part.get("text")) for part in parts if part.get("type") == "text")
