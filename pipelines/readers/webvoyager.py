"""Task folders of WebVoyager: an agent's messages, and a marked screenshot for each reply."""

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import cast

from hijack_data.actions.dialects.computer_tools import PIXELS_PER_NOTCH
from hijack_data.actions.recorded_actions import SIZELESS
from hijack_data.errors import short_repr
from hijack_data.types import Action, Size, Step, Trajectory

from . import fields
from .base import Rejected, register
from .fields import FieldError, FieldTypeError
from .folder_reader import FolderReader, folder_id
from .recorded_actions import RecordedStep, raw_action_text
from .safe_files import image_size, inside, parse_any, relative_name

RECORDS = "interact_messages.json"
WAIT_SECONDS = 5.0  # what WebVoyager's own code waits
_TASK = re.compile(r"Now given a task:(.*?)(?:Please interact with|\Z)", re.DOTALL)
_LABEL = re.compile(r"Action:")
_TYPE = re.compile(r"Type \[?\d+\]?[;:]?\s*(.*)", re.DOTALL)
_ANSWER = re.compile(r"ANSWER[;:]?\s*(.*)", re.DOTALL)
_OTHER = re.compile(r"Click \[?\d+\]?|GoBack|Google")
_SCROLL = re.compile(r"Scroll \[?(\d+|WINDOW)\]?[;:]?\s*(up|down)")
# WebVoyager scrolls the window by this share of its height.
_SCROLL_SHARE = 2 / 3


@register
class WebVoyager(FolderReader):
    """Reads task folders of WebVoyager.

    A source is a folder with `interact_messages.json` anywhere below, or such a file; a
    trajectory's id is the path of its folder. The n-th reply of the agent was given on
    `screenshot<n>.png`. `action_code` is what stands after the last `Action:` of the reply.

    Coordinates: none. Actions name the number of a mark that is painted on the screenshot, and
    where the marks are is not recorded; a click is therefore `"other"`, and so is typing, which
    clicks, clears, types and presses Enter (its text ends in a newline), and scrolling inside a
    mark. Scrolling the window keeps its direction. The marks are part of the picture: it is not a
    plain page. The browser and the desktop around the page do not show.
    """

    name = "webvoyager"
    records = RECORDS
    file_names = (RECORDS,)
    any_name = True

    def episode(self, file: Path, root: Path) -> Iterator[Trajectory | Rejected]:
        """Yield the trajectory of one task folder, and everything rejected of it."""
        try:
            yield from _trajectory(file, root)
        except FieldError as error:
            yield Rejected(relative_name(file, root), "", error.field, error.reason)


def _trajectory(file: Path, root: Path) -> Iterator[Trajectory | Rejected]:
    name = relative_name(file, root)
    messages = parse_any(inside(root, name, ""))
    if not isinstance(messages, list):
        raise FieldError("", "must be a list of messages")
    steps: list[Step] = []
    instruction = ""
    replies = 0
    for number, message in enumerate(cast("list[object]", messages)):
        try:
            role, text = _read(message)
            if role == "user" and not instruction:
                instruction = _instruction(text)
            elif role == "assistant":
                replies += 1
                steps.append(_step(text, replies, file.parent, root))
        except FieldError as error:
            yield Rejected(name, f"message {number}", error.field, error.reason)
    if not replies:
        raise FieldError("", "holds no step")
    if not instruction:
        raise FieldError("instruction", "no message of the user holds text")
    if steps:
        yield Trajectory(
            id=folder_id(file.parent, root),
            source=WebVoyager.name,
            instruction=instruction,
            steps=tuple(steps),
            apps=("browser",),
            platform="web",
        )


def _read(message: object) -> tuple[str, str]:
    """Return the role and the text of a message.

    Raises:
        FieldTypeError: the content is neither text nor a list of parts.
    """
    record = fields.mapping(message, "")
    role = fields.text(record, "role")
    content: object = record.get("content")
    if isinstance(content, list):
        parts = fields.objects(content)
        content = "\n".join(str(part.get("text")) for part in parts if part.get("type") == "text")
    if not isinstance(content, str):
        raise FieldTypeError("content", "text or a list of parts", content)
    return role, fields.storable(content, "content")


def _instruction(text: str) -> str:
    match = _TASK.search(text)
    return (match[1] if match else text).strip()


def _step(text: str, number: int, folder: Path, root: Path) -> Step:
    image_name = relative_name(folder / f"screenshot{number}.png", root)
    image = inside(root, image_name, "screenshot")
    size = image_size(image, "screenshot")
    labels = list(_LABEL.finditer(text))
    if not labels:
        raise FieldError("content", "the reply names no action")
    code = text[labels[-1].end() :].strip()
    action = _action(code, size)
    kept_code = raw_action_text(code, "content")
    return RecordedStep(number, os.fspath(image), action, kept_code, dialect=SIZELESS)


def _action(code: str, size: Size) -> Action:
    typed = _TYPE.fullmatch(code)
    if typed:
        # A click on the mark, select all, the text, and Enter: where the click goes is not
        # recorded.
        return Action("other", text=f"{typed[1]}\n")
    answer = _ANSWER.fullmatch(code)
    if answer:
        return Action("done", text=answer[1])
    scrolled = _SCROLL.fullmatch(code)
    if scrolled:
        return _scroll(scrolled[1], scrolled[2], size)
    if code == "Wait":
        return Action("wait", amount=WAIT_SECONDS)
    if _OTHER.fullmatch(code):
        return Action("other")
    raise FieldError("content", f"{short_repr(code)} is not an action of WebVoyager")


def _scroll(target: str, direction: str, size: Size) -> Action:
    if target != "WINDOW":
        return Action("other")  # inside a mark: the pointer is not there
    notches = round(size[0] * _SCROLL_SHARE / PIXELS_PER_NOTCH)
    return Action("scroll", amount=notches if direction == "up" else -notches)
