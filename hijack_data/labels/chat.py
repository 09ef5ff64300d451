"""Labels in conversations: `messages` as OpenAI has them, `conversations` as LLaVA has them.

>>> import hijack_data as hj
>>> from hijack_data.labels import Labels, chat
>>> half = hj.Resolution(scale=0.5).plan(hj.Scene(size=(1080, 1920)), seed=1)
>>> talk = [{"role": "user", "content": "Press OK."},
...         {"role": "assistant", "content": "pyautogui.click(100, 200)"}]
>>> Labels({"messages": chat("pyautogui")}).follow(half, {"messages": talk})["messages"][1]
{'role': 'assistant', 'content': 'pyautogui.click(50, 100)'}
"""

import json
import pickle
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias, cast

from ..errors import HijackError, LabelError, ParameterError, short_repr
from ..types import Size
from .base import LEAVE, Format, Location, Move
from .grounding_text import could_be_point

TextMapper: TypeAlias = Callable[[Any, Move], Any]
# The names of roles in LLaVA's, ShareGPT's and LLaMA-Factory's records.
ROLES = {
    "human": "user",
    "gpt": "assistant",
    "model": "assistant",
    "function_call": "assistant",
    "observation": "tool",
}
_PICTURES = frozenset(
    ["image", "image_url", "input_image", "video", "video_url", "audio", "input_audio"]
)
_TEXTS = frozenset(["text", "input_text", "output_text"])
# A number that does not stand in a sentence, as in an action that was cut off: `[994`, `x=994`.
_WRITTEN = re.compile(r"[(\[{<=:,\"']\s*-?\d", re.ASCII)
_CONTENT = (("role", "content"), ("from", "value"))


@dataclass(frozen=True)
class ChatLabels:
    """The declaration of a conversation; `chat` makes it, and documents it.

    It holds names and functions only, so that it can be pickled for the workers of loaders, and has
    the same fingerprint in every process.
    """

    form: str | TextMapper
    roles: tuple[str, ...]
    indices: tuple[int, ...] | None
    others: str | TextMapper | None


def check_picklable(function: Any) -> None:
    """Check that a function can be found by its name, as the workers of loaders find it.

    Raises:
        ParameterError: it is a lambda or a local function.
    """
    try:
        pickle.dumps(function)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise ParameterError(
            f"the format {function!r} cannot be sent to the workers of a loader ({error}); define"
            " it with def at the top level of a module"
        ) from None


def function_format(function: TextMapper) -> Format:
    """Return the format of entries that a function `(value, move) -> value` maps."""
    check_picklable(function)
    name = getattr(function, "__qualname__", None) or type(function).__qualname__
    return Format(str(name), function, declaration=function)


def chat_format(declaration: ChatLabels, form: Format, others: Format | None) -> Format:
    """Return the format of a declared conversation.

    Args:
        declaration: the declaration.
        form: the format that `declaration.form` names.
        others: the format that `declaration.others` names.
    """

    def walk(value: Any, change: Callable[[Format, Any], Any]) -> Any:
        return _Walker(declaration, form, others, change).conversation(value)

    def map_value(value: Any, move: Move) -> Any:
        return walk(value, lambda kind, part: kind.map_value(part, move))

    def locate(value: Any, size: Size) -> list[Location]:
        locations: list[Location] = []

        def collect(kind: Format, part: Any) -> Any:
            if kind.name != LEAVE:
                locations.extend(kind.locate(part, size))
            return part

        walk(value, collect)
        return locations

    return Format(f"chat({form.name})", map_value, locate, declaration=declaration)


def _is_prose(text: str) -> bool:
    """Return whether a text between actions holds no point: one number in a sentence is none."""
    return not could_be_point(text) and _WRITTEN.search(text) is None


@dataclass(frozen=True)
class _Walker:
    """Goes through a conversation and changes the parts that may hold coordinates."""

    declaration: ChatLabels
    form: Format
    others: Format | None
    change: Callable[[Format, Any], Any]

    def conversation(self, value: Any) -> Any:
        """Return a conversation, several, or the JSON text of one, changed.

        Raises:
            LabelError: the value is no conversation, or a message in it cannot be changed.
        """
        if value is None:
            return None
        if isinstance(value, str):
            try:
                data = json.loads(value)
            except (ValueError, RecursionError):
                data = None
            if not isinstance(data, list):
                raise LabelError(f"must be a list of messages, got {short_repr(value)}")
            return json.dumps(self.conversation(data), ensure_ascii=False)
        if not isinstance(value, list | tuple):
            raise LabelError(f"must be a list of messages, got {short_repr(value)}")
        parts = cast("list[Any]", value)
        if parts and all(isinstance(part, list | tuple) for part in parts):
            messages = [self.conversation(part) for part in parts]
        else:
            self._check_indices(len(parts))
            messages = [self._message(part, index, len(parts)) for index, part in enumerate(parts)]
        return tuple(messages) if isinstance(value, tuple) else messages

    def _check_indices(self, count: int) -> None:
        for index in self.declaration.indices or ():
            if not -count <= index < count:
                raise LabelError(
                    f"has {count} messages, and chat(indices=...) names message {index}"
                )

    def _message(self, message: Any, index: int, count: int) -> Any:
        if not isinstance(message, Mapping):
            raise LabelError(f"message {index} must be a dictionary, got {short_repr(message)}")
        original = cast("Mapping[str, Any]", message)
        fields = dict(original)
        keys = next((pair for pair in _CONTENT if pair[0] in fields), None)
        if keys is None or not isinstance(fields[keys[0]], str):
            raise LabelError(
                f"message {index} has neither a role and content nor a from and value:"
                f" {short_repr(original)}"
            )
        role = ROLES.get(fields[keys[0]], fields[keys[0]])
        indices = self.declaration.indices
        is_addressed = role in self.declaration.roles and (
            indices is None or index in indices or index - count in indices
        )
        for key, part in fields.items():
            if key in keys[:1] or part is None:
                continue
            try:
                if key == keys[1]:
                    fields[key] = self._content(part, is_addressed)
                elif key in ("tool_calls", "function_call"):
                    fields[key] = self._calls(part, is_addressed)
                else:
                    self._pass(part)
            except HijackError as error:
                raise LabelError(f"message {index} ({fields[keys[0]]}), {key!r}: {error}") from None
        return fields

    def _content(self, content: Any, is_addressed: bool) -> Any:
        if isinstance(content, str):
            return self._text(content, is_addressed)
        if not isinstance(content, list | tuple):
            raise LabelError(f"must be text or a list of parts, got {short_repr(content)}")
        parts = [self._part(part, is_addressed) for part in cast("list[Any]", content)]
        return tuple(parts) if isinstance(content, tuple) else parts

    def _part(self, part: Any, is_addressed: bool) -> Any:
        if isinstance(part, str):
            return self._text(part, is_addressed)
        if not isinstance(part, Mapping):
            raise LabelError(
                f"has a part that is neither text nor a dictionary: {short_repr(part)}"
            )
        block = cast("Mapping[str, Any]", part)
        fields = dict(block)
        kind: Any = fields.get("type")
        # Columns of datasets have every field in every part, None where it has none.
        if isinstance(fields.get("text"), str) and (kind is None or kind in _TEXTS):
            return {**fields, "text": self._text(fields["text"], is_addressed)}
        if kind in _PICTURES:
            return block
        if is_addressed:
            return self.change(self.form, block)
        self._pass(block)
        return block

    def _text(self, text: str, is_addressed: bool) -> str:
        if not is_addressed:
            if self.others is not None:
                return self.change(self.others, text)
            self._pass(text)
            return text
        try:
            return self.change(self.form, text)
        except HijackError:
            if not _is_prose(text):
                raise
            return text

    def _calls(self, calls: Any, is_addressed: bool) -> Any:
        if not is_addressed:
            self._pass(calls)
            return calls
        if isinstance(calls, list | tuple):
            changed_calls = [self._call(call) for call in cast("list[Any]", calls)]
            return tuple(changed_calls) if isinstance(calls, tuple) else changed_calls
        return self._call(calls)

    def _call(self, call: Any) -> Any:
        if not isinstance(call, Mapping):
            raise LabelError(f"must be a dictionary, got {short_repr(call)}")
        fields: dict[str, Any] = dict(cast("Mapping[str, Any]", call))
        inner = fields.get("function")
        if isinstance(inner, Mapping):
            return {**fields, "function": self.change(self.form, inner)}
        return self.change(self.form, call)

    def _pass(self, part: Any) -> None:
        """Check what stays as it is.

        Raises:
            LabelError: it could hold a point, and nobody said that it does not.
        """
        if self.others is not None and self.others.name == LEAVE:
            return
        text = part if isinstance(part, str) else json.dumps(part, default=str, ensure_ascii=False)
        if could_be_point(text):
            raise LabelError(
                "is not among the messages that chat(...) maps, and its numbers could be a point or"
                f" the size of the screen: {short_repr(text)}; name its role in roles=, its format"
                " in others=, or others='leave' if it must not change"
            )
