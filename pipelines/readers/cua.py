"""Trajectory folders of cua's agent: turns with computer calls, and the screenshots after them."""

import json
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from hijack_data.errors import short_repr
from hijack_data.types import Step, Trajectory

from . import fields
from .base import Rejected, register
from .fields import FieldError, JsonObject
from .file_head import FileHead
from .folder_reader import FolderReader, folder_id
from .recorded_actions import OPENAI, RecordedStep, first_action, raw_action_text
from .safe_files import image_size, inside, parse_file, relative_name

METADATA = "metadata.json"
_TURN = re.compile(r"turn_\d+")
_ARTIFACT = re.compile(r"(\d+)_(\w+)\.(json|png)")
_CALLS = ("computer_call_result", "function_call_result")
_SCREENSHOT_AFTER = "screenshot_after"
_MARKED_SCREENSHOT = "screenshot_action"


@register
class Cua(FolderReader):
    """Reads the folders that `TrajectorySaverCallback` of cua's agent writes.

    A source is a folder `<id>` with `metadata.json` and `turn_000/0001_*.json`, that
    `metadata.json`, or a folder above. A `computer_call_result` is an action of OpenAI's computer
    tool. cua takes a screenshot after each action and saves it before the result
    (`screenshot_after`), so an action is given the one of the action before, and the first needs a
    screenshot (`screenshot`) before it. `screenshot_action` has a cross drawn on it and is not
    read. The instruction is the first text of the user in the metadata. Function calls do not state
    the space of their coordinates and are rejected.

    Coordinates: pixels of the screenshot; a point outside is rejected.
    """

    name = "cua"
    records = METADATA
    suffixes = (METADATA,)

    def recognizes(self, head: FileHead) -> bool:
        """Return whether a file is a `metadata.json` beside turns."""
        return head.path.name == METADATA and any(map(_is_turn, head.path.parent.iterdir()))

    def beside(self, file: Path) -> bool:
        """Return whether a file is an artifact of a turn."""
        return _is_turn(file.parent)

    def episode(self, file: Path, root: Path) -> Iterator[Trajectory | Rejected]:
        """Yield the trajectory of one folder, and everything rejected of it."""
        return _Run(root, file.parent, list(_artifacts(file.parent))).read()


def _artifacts(folder: Path) -> Iterator[Path]:
    for turn in sorted(filter(_is_turn, folder.iterdir())):
        if not turn.is_dir() or turn.is_symlink():
            continue
        for file in sorted(turn.iterdir()):
            if _ARTIFACT.fullmatch(file.name):
                yield file


def _order(file: Path) -> tuple[int, str]:
    """Return the key that sorts artifacts by number, and those of one number by name."""
    number, _, _ = file.name.partition("_")
    return int(number), file.name


@dataclass
class _Run:
    """One trajectory folder, while it is read.

    Args:
        root: the folder of the source.
        folder: the trajectory's folder.
        files: the artifacts of its turns.
        steps: the steps so far.
        screen: the picture on which the next action is taken.
        after: the picture after the action whose result comes next.
        actions: actions so far, rejected ones included.
    """

    root: Path
    folder: Path
    files: list[Path]
    steps: list[Step] = field(default_factory=list[Step])
    screen: Path | None = None
    after: Path | None = None
    actions: int = 0

    def read(self) -> Iterator[Trajectory | Rejected]:
        """Yield what is broken, then the trajectory."""
        name = f"{relative_name(self.folder, self.root)}/{METADATA}"
        try:
            metadata = inside(self.root, relative_name(self.folder / METADATA, self.root), "")
            instruction = _instruction(parse_file(metadata))
        except FieldError as error:
            yield Rejected(name, "", error.field, error.reason)
            return
        for file in sorted(self.files, key=_order):
            try:
                self._take(file)
            except FieldError as error:
                yield Rejected(relative_name(file, self.root), "", error.field, error.reason)
        if not self.actions:
            yield Rejected(name, "", "", "there is no action in the turns beside it")
        elif self.steps:
            trajectory_id = folder_id(self.folder, self.root)
            yield Trajectory(trajectory_id, Cua.name, instruction, tuple(self.steps))

    def _take(self, file: Path) -> None:
        kind = cast("re.Match[str]", _ARTIFACT.fullmatch(file.name))[2]
        if file.suffix == ".png":
            self._look(file, kind)
        elif kind in _CALLS:
            before = self.screen
            self.screen = self.after
            self.after = None
            path = inside(self.root, relative_name(file, self.root), "")
            self._call(parse_file(path), kind, before)

    def _look(self, file: Path, kind: str) -> None:
        if kind == _SCREENSHOT_AFTER:
            self.after = file
        elif kind != _MARKED_SCREENSHOT:
            self.screen = file

    def _call(self, record: JsonObject, kind: str, screen: Path | None) -> None:
        item = fields.mapping(record.get("item"), "item")
        action: object = item.get("action")
        if isinstance(action, dict) and cast("dict[str, Any]", action).get("type") == "screenshot":
            return
        self.actions += 1
        if kind != _CALLS[0]:
            name = short_repr(item.get("name"))
            raise FieldError("item", f"the function {name} does not say what its coordinates count")
        if screen is None:
            raise FieldError("screenshot", "no screenshot was saved before this action")
        image = inside(self.root, relative_name(screen, self.root), "screenshot")
        size = image_size(image, "screenshot")
        parsed_action = first_action(action, OPENAI, size, "item.action")
        code = raw_action_text(action, "item.action")
        self.steps.append(
            RecordedStep(self.actions, os.fspath(image), parsed_action, code, dialect=OPENAI)
        )


def _instruction(metadata: JsonObject) -> str:
    """Return the first text of the user.

    Raises:
        FieldError: no message of the user holds text.
    """
    kwargs = fields.mapping(metadata.get("kwargs"), "kwargs")
    for entry in fields.items(kwargs, "messages"):
        message = fields.mapping(entry, "kwargs.messages")
        text = next(_texts(message.get("content")), None)
        if message.get("role") == "user" and text:
            return fields.storable(text.strip(), "kwargs.messages")
    excerpt = short_repr(json.dumps(kwargs, default=str))
    raise FieldError("kwargs.messages", f"hold no text of the user: {excerpt}")


def _texts(content: object) -> Iterator[str]:
    """Yield the texts of a message that are not blank; its content is a list of parts or text."""
    parts = fields.objects(content) if isinstance(content, list) else [{"text": content}]
    for part in parts:
        text: object = part.get("text")
        if isinstance(text, str) and text.strip():
            yield text


def _is_turn(folder: Path) -> bool:
    return _TURN.fullmatch(folder.name) is not None
