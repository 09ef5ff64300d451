"""Conversations with pictures, as in training sets: the screen of each reply.

Messages have `role` and `content`, or `from` and `value`. A picture is shown by `<image>` in the
text or by a part of the content, each picture of the row once; a reply belongs to the last picture
shown before it.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any, cast

from hijack_data.actions.dialects.qwen import TOOLS, tool_call_text
from hijack_data.actions.recorded_actions import SIZELESS
from hijack_data.errors import ParameterError, short_repr
from hijack_data.smart_resize import smart_resize
from hijack_data.types import Action, Size, Step

from ..choices import FRACTIONS, PIXELS, RESIZED, THOUSAND
from ..prompts import parse_question
from . import fields
from .fields import FieldError, JsonObject
from .model_replies import ModelReply, ReplyContext, is_action, parse_reply
from .reader_options import Space, space_scaling
from .recorded_actions import PYAUTOGUI, ParsedAction, RecordedStep, raw_action_text
from .safe_files import parse_embedded
from .tool_calls import acting_calls, call_arguments, parse_call

IMAGE = "<image>"
# The types of parts that show a picture, and where a part may name it beside the row.
IMAGE_PARTS = ("image", "image_url", "input_image")
_NAMES = ("image", "image_url", "path", "url")
USER = "user"
ASSISTANT = "assistant"
_ROLES = {
    "human": USER,
    "gpt": ASSISTANT,
    "model": ASSISTANT,
    "observation": USER,
    "function_call": ASSISTANT,
}
_RESOLUTION = re.compile(r"screen'?s? resolution is (\d{2,5})\s*x\s*(\d{2,5})", re.IGNORECASE)
# The places of the task in the prompts of the recipes; if none matches, the task is the whole text.
_TASKS = tuple(
    re.compile(pattern, re.DOTALL)
    for pattern in (
        r"## User Instruction\s*\n(.*)\Z",
        (
            r"(?:\A|\n)(?:Task|Instruction|Task instruction):"
            r" *(.*?)(?:\n\s*\n?(?:Previous|History)[^\n]*:.*)?\Z"
        ),
        r"The user query: *(.*?)(?:\s*\n?\(?You have done the following.*|\s*Task progress.*)?\Z",
    )
)
TurnImage = tuple[str, Size]


class ChatTurns:
    """A conversation, while it is read.

    Args:
        picture: returns the reference and the (height, width) of the n-th picture.
        pictures: what the row holds for each picture: its path or `data:` URL, or anything else.
        choice: the space of the coordinates that the user chose.
        record: the row, which may state the size of its picture.
    """

    def __init__(
        self,
        picture: Callable[[int], TurnImage],
        pictures: Sequence[object],
        choice: str | None,
        record: JsonObject,
    ) -> None:
        self.picture = picture
        self.pictures = pictures
        self.choice = choice
        self.record = record
        self.steps: list[Step] = []
        self.instruction = ""
        self.replies = self.shown = 0
        self.stated_space: Space | None = None
        self.screen: int | None = None
        self.calls = False
        self.numbered = False  # whether parts state which picture they show

    def read(self, messages: list[JsonObject], key: str) -> Iterator[FieldError]:
        """Read all messages of the field `key`; yield the errors in them.

        Raises:
            FieldError: there is no action or no instruction.
        """
        self._begin(messages)
        idle: int | None = None  # the reply to the present picture, if it is no action
        for index, message in enumerate(messages):
            shown_before = self.shown
            try:
                self._take(message, is_last=index == len(messages) - 1)
            except FieldError as error:
                inner = f".{error.field}" if error.field else ""
                yield FieldError(f"{key}[{index}]{inner}", error.reason)
            if idle is not None and self.shown > shown_before:
                reason = "is no action that is known, so the picture before it gives no step"
                yield FieldError(f"{key}[{idle}]", reason)
            if self.shown > shown_before or self.screen is None:
                idle = None
            elif _replies(message):
                idle = index
        if not self.replies:
            raise FieldError(key, "hold no action")
        if self.shown < len(self.pictures) and not self.numbered:
            raise FieldError(
                key,
                f"show {self.shown} of the row's {len(self.pictures)} pictures, so it is unknown"
                f" which; write {IMAGE} for each, or leave the others out of the row",
            )
        if not self.instruction:
            raise FieldError(key, "hold no text of the user")

    def _begin(self, messages: list[JsonObject]) -> None:
        """Look at the messages as a whole.

        Raises:
            FieldError: no message shows one of several pictures.
        """
        self.calls = any(message.get("tool_calls") for message in messages)
        if any(_shows(message) for message in messages):
            return
        count = len(self.pictures)
        if count > 1:
            raise FieldError("messages", f"none says which of the {count} pictures it shows")
        self._show(0)

    def _take(self, message: JsonObject, is_last: bool) -> None:
        role = _role(message)
        text = self._look(_content(message), role != ASSISTANT)
        if role != ASSISTANT:
            self.add_prompt(text, role)
            return
        self._reply(message, text, is_last)

    def add_prompt(self, text: str, role: str) -> None:
        """Take in the task and the space of the coordinates from a prompt."""
        match = _RESOLUTION.search(text)
        if match:
            self.stated_space = (int(match[2]), int(match[1]))
        prompt = text.replace(IMAGE, "").strip()
        question = parse_question(prompt)
        task = _task(prompt)
        if question:
            task, self.stated_space = question
        if role == USER and not self.instruction:
            self.instruction = fields.storable(task, "content")

    def _look(self, content: object, shows: bool) -> str:
        """Take in the images of a message, if it shows any, and return its text."""
        parts: list[object] = [{"type": "text", "text": content}]
        if isinstance(content, list):
            parts = fields.listed(content)
        texts: list[str] = []
        for part in parts:
            entry = fields.mapping(part, "content")
            text: object = entry.get("text")
            if entry.get("type") in IMAGE_PARTS and shows:
                self._show_part(entry)
            elif isinstance(text, str):
                texts.append(text)
                if shows:
                    self._show(self.shown + text.count(IMAGE) - 1)
        return "\n".join(texts)

    def _show_part(self, part: JsonObject) -> None:
        """Take the picture of a part as the screen.

        Raises:
            FieldError: the part names another picture than the row has at its place.
        """
        index = self.shown
        if part.get("index") is not None:
            self.numbered = True
            index = _picture_index(part["index"])
        field, name = _part_picture(part)
        row_picture = self.pictures[index] if index < len(self.pictures) else None
        if name is not None and name != row_picture:
            raise FieldError(
                f"content.{field}",
                f"names {short_repr(name)}, but picture {index} of the row is"
                f" {short_repr(row_picture)}; only the row's pictures are read",
            )
        self._show(index)

    def _show(self, index: int) -> None:
        """Take the `index`-th image as the screen, unless it was shown before."""
        if index >= self.shown:
            self.screen = index
            self.shown = index + 1

    def _reply(self, message: JsonObject, text: str, is_last: bool) -> None:
        text, calls = _with_calls(message, text)
        acting = acting_calls(calls)
        is_end = self.calls and is_last and not acting and not is_action(text)
        if not acting and not is_end and not is_action(text):
            return
        self.replies += 1
        if self.screen is None:
            raise FieldError("images", "no image was shown between this action and the one before")
        image, size = self.picture(self.screen)
        self.screen = None
        if acting:
            reply = ModelReply(self._called(acting[0], calls, size))
        elif is_end:
            end = Action("done", text=fields.storable(text, "content"))
            reply = ModelReply(ParsedAction(end, text, SIZELESS))
        else:
            context = ReplyContext(size, self.choice, _space(self.stated_space, size))
            reply = parse_reply(text, "content", context)
        self._check_size(reply, size)
        self._add(image, reply)

    def _check_size(self, reply: ModelReply, size: Size) -> None:
        """Check the size that the row states of its only picture, where a reply counts its pixels.

        Raises:
            FieldError: the picture has another size.
        """
        action = reply.recorded.action
        in_pixels = reply.recorded.dialect == PYAUTOGUI and self.choice in (None, PIXELS)
        is_known = not in_pixels or self.stated_space is not None
        if not is_known and (action.point or action.end) and len(self.pictures) == 1:
            fields.check_stated_size(self.record, size)

    def _add(self, image: str, reply: ModelReply) -> None:
        recorded_action = reply.recorded
        step = RecordedStep(
            index=self.replies,
            image=image,
            action=recorded_action.action,
            action_code=recorded_action.code,
            target_box=reply.box,
            dialect=recorded_action.dialect,
        )
        self.steps.append(step)

    def _called(self, call: tuple[str, JsonObject], calls: object, size: Size) -> ParsedAction:
        """Read structured calls, in 0..1000 unless the user chose another space."""
        space = self.choice or THOUSAND
        action = parse_call(*call, size, space_scaling(space, size))
        if space in (THOUSAND, FRACTIONS):
            return ParsedAction(action, raw_action_text(calls, "tool_calls"), SIZELESS)
        return ParsedAction(action, "", PYAUTOGUI)


def messages_in(value: object, key: str) -> list[JsonObject]:
    """Return the messages in a field, a list or JSON text; others are a `FieldError`."""
    record = {key: parse_embedded(value, key)}
    return fields.mappings(fields.items(record, key), key)


def _with_calls(message: JsonObject, text: str) -> tuple[str, object]:
    """Return the text of a reply, and its structured calls: those of Qwen's tools become text."""
    calls: object = message.get("tool_calls")
    functions = fields.objects([call.get("function") for call in fields.objects(calls)])
    tool_functions = [function for function in functions if function.get("name") in TOOLS]
    if not tool_functions:
        return text, calls
    texts = [tool_call_text(tool["name"], _recorded_arguments(tool)) for tool in tool_functions]
    return "\n".join([text, *texts]).strip(), None


def _recorded_arguments(function: JsonObject) -> dict[str, Any]:
    # Parquet stores null for arguments that an action does not have.
    return {key: value for key, value in call_arguments(function).items() if value is not None}


def _space(space: Space | None, size: Size) -> Space | None:
    """Return the space of a stated resolution: resized, thousandths, or a grid of its own."""
    if space == (1000, 1000):
        return THOUSAND
    if isinstance(space, tuple) and space == _resized(size):
        return RESIZED
    return space


def _resized(size: Size) -> Size | None:
    try:
        return smart_resize(*size)
    except ParameterError:
        return None


def _shows(message: JsonObject) -> bool:
    content: object = _content(message)
    if isinstance(content, str):
        return IMAGE in content and _role(message) != ASSISTANT
    for part in fields.objects(content):
        if part.get("type") in IMAGE_PARTS or IMAGE in str(part.get("text")):
            return True
    return False


def _replies(message: JsonObject) -> bool:
    """Return whether a message is a reply in words; a call may also only look."""
    role = str(message.get("role", message.get("from")))
    return _ROLES.get(role, role) == ASSISTANT and not message.get("tool_calls")


def _part_picture(part: JsonObject) -> tuple[str, object]:
    """Return the field in which a part names a picture of its own, and the name or `None`."""
    for field in _NAMES:
        name: object = part.get(field)
        if isinstance(name, dict):
            name = cast("dict[str, object]", name).get("url")
        if name is not None:
            return field, name
    return "", None


def _role(message: JsonObject) -> str:
    key = "role" if "role" in message else "from"
    role = fields.text(message, key)
    return _ROLES.get(role, role)


def _content(message: JsonObject) -> object:
    return message.get("content") if "content" in message else message.get("value")


def _task(text: str) -> str:
    for pattern in _TASKS:
        match = pattern.search(text)
        if match:
            return match[1].strip()
    return text.strip()


def _picture_index(index: object) -> int:
    # Parquet turns an index that only some parts have into a float.
    if isinstance(index, float) and index.is_integer():
        index = int(index)
    return fields.step_number({"index": index}, "index")
