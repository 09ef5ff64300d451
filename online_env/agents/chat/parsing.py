"""Convert a model's replies to actions, in pixels of the picture that the agent was shown.

A reply that cannot be read does not raise: it is handed on as a text with the reason, in the words
of its dialect, that the environment counts as malformed.
"""

import json
import re
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hijack_data.actions import (
    RESIZED_DIALECTS,
    Scaling,
    code_of,
    fenced_blocks,
    map_code,
    read_action,
    unreadable_action,
)
from hijack_data.actions.dialects.answer_text import answer_text
from hijack_data.actions.dialects.opencua import plain_code
from hijack_data.actions.dialects.qwen import tool_call_text
from hijack_data.errors import ActionError, HijackError
from hijack_data.smart_resize import MAX_PIXELS, MIN_PIXELS, smart_resize
from hijack_data.types import Size

from ..base import DONE, FAIL, WAIT
from ..settings import TOOL_PARSERS, AgentSettings
from .query import Reply

WORDS = (WAIT, DONE, FAIL)
# Dialects whose calls an endpoint may return as tool calls of its API: those of Qwen's tools, which
# become text, and those with a name for each action.
_QWEN_DIALECTS = ("qwen2.5_vl", "qwen3_vl", "gui_owl", "mai_ui")
_NAMED_CALL_DIALECTS = ("gemini",)
# A fence after prose on the same line, and a word in fences after prose at the very end.
_OPENS_LATE = re.compile(r"(?<=[^\s`])[ \t]*(```(?:python|py|json)[ \t]*\r?\n)")
_LAST_WORD = re.compile(rf"```\s*({'|'.join(WORDS)})\s*```\s*\Z")
_AGENTNET = re.compile(r"\bcomputer\s*\.\s*\w+\s*\(")
_MAX_EXCERPT_CHARS = 2000  # characters of an unreadable reply that are kept in the record


@dataclass(frozen=True, kw_only=True)
class ReplyParser:
    """Reads the replies of one model.

    Args:
        dialect: one of `hijack_data.actions.DIALECTS`.
        coordinates: one of `settings.COORDINATES`, for pyautogui code.
        min_pixels: the smallest picture that the model's image processor makes.
        max_pixels: the largest one.
    """

    dialect: str
    coordinates: str = "pixels"
    min_pixels: int = MIN_PIXELS
    max_pixels: int = MAX_PIXELS

    @classmethod
    def of(cls, settings: AgentSettings) -> "ReplyParser":
        """Return the parser for the model of an agent file."""
        return cls(
            dialect=settings.parser,
            coordinates=settings.coordinates,
            min_pixels=settings.min_pixels or MIN_PIXELS,
            max_pixels=settings.max_pixels or MAX_PIXELS,
        )

    def read(self, reply: Reply, size: Size) -> list[str]:
        """Return the actions of a reply.

        Args:
            reply: the model's reply.
            size: `(height, width)` of the picture that the agent was shown.
        """
        try:
            return self._read(reply, size)
        except HijackError as error:
            return [unreadable_action(error, reply.transcript[:_MAX_EXCERPT_CHARS])]

    def _read(self, reply: Reply, size: Size) -> list[str]:
        # Calls of the API stand for themselves, whatever the words beside them.
        has_calls = bool(reply.calls) and self.dialect in (
            *TOOL_PARSERS,
            *_QWEN_DIALECTS,
            *_NAMED_CALL_DIALECTS,
        )
        text = "" if has_calls else answer_text(reply.text, self.dialect).strip()
        if self.dialect in TOOL_PARSERS:
            return self._read_calls(reply, text, size)
        if reply.refused:
            return [self._malformed(reply.text)]
        if self.dialect == "pyautogui":
            return self._pyautogui(reply, text, size)
        if self.dialect == "computer_13":
            return _computer_13(text, size)
        if self.dialect in _QWEN_DIALECTS and reply.calls:
            calls = [tool_call_text(str(c["name"]), c["arguments"]) for c in reply.calls]
            text = "\n".join(calls)
        if self.dialect in _NAMED_CALL_DIALECTS and reply.calls:
            codes_by_call = [code_of(dict(c), self.dialect, size) for c in reply.calls]
            return [code for codes in codes_by_call for code in codes]
        return code_of(text, self.dialect, size, self._resized_size(size))

    def model_size(self, size: Size) -> Size:
        """Return the (height, width) in whose pixels the model points, for a picture of `size`."""
        pixels = self.dialect not in RESIZED_DIALECTS and self.coordinates != "resized"
        return size if pixels else self._resized_size(size)

    def _resized_size(self, size: Size) -> Size:
        return smart_resize(*size, min_pixels=self.min_pixels, max_pixels=self.max_pixels)

    def _read_calls(self, reply: Reply, text: str, size: Size) -> list[str]:
        """Return the calls of a computer tool; a whole reply without any ends the episode.

        Raises:
            ActionError: the reply is not whole, or a call is no action.
        """
        if reply.refused:
            return [self._malformed(reply.transcript)]
        if reply.cut:
            raise ActionError(
                f"the answer was cut off ({reply.cut:.40}); a higher sampling.max_tokens may help"
            )
        if reply.calls:
            actions: list[str] = []
            for call in reply.calls:
                actions += code_of(call["arguments"], self.dialect, size)
            return actions
        if not text:
            return [""]
        last = re.findall(r"\w+", text)[-1:]
        return [FAIL] if last == [FAIL] else [DONE]

    def _pyautogui(self, reply: Reply, text: str, size: Size) -> list[str]:
        """Return each block of code as an action; text without a block is an action itself."""
        if reply.calls and not text:
            return [self._malformed(reply.transcript)]
        blocks = _blocks(text)
        last = _LAST_WORD.search(text)
        if last is not None and not blocks:
            return [last[1]]
        actions: list[str] = []
        for block in blocks or [text]:
            code, word = _split_block(textwrap.dedent(block).strip())
            if code or not word:
                actions.append(self._in_pixels(code, size))
            if word:
                actions.append(word)
        return actions

    def _in_pixels(self, code: str, size: Size) -> str:
        """Return code with its coordinates in pixels of the picture.

        Code that is not parsed here is passed on unchanged, but never in the wrong coordinates.

        Raises:
            ActionError: the code cannot be mapped.
        """
        if self.coordinates == "resized":
            source = self._resized_size(size)
            code = map_code(code, Scaling(source, size, recorded=True))
        elif self.coordinates == "thousandths":
            code = map_code(code, Scaling.fractions(size, 1000))
        elif self.coordinates == "fractions":
            code = map_code(code, Scaling.fractions(size))
        # AgentNet's `computer.wait()`, `.terminate(status='success')` and `.tripleClick(x, y)`
        return plain_code(code, Scaling.pixels(size)) if _AGENTNET.search(code) else code

    def _malformed(self, text: str) -> str:
        """Return an action that counts as malformed: the text itself unless that would be valid."""
        excerpt = text[:_MAX_EXCERPT_CHARS]
        try:
            read_action(excerpt)
        except ActionError:
            return excerpt
        return f"not an action of {self.dialect}: {excerpt!r}"


def _blocks(text: str) -> list[str]:
    """Return the fenced blocks; a fence that names Python or JSON may begin within a line."""
    return fenced_blocks(_OPENS_LATE.sub(r"\n\1", text))


def _split_block(block: str) -> tuple[str, str]:
    """Return the code of a block and the word that may follow it on a line of its own."""
    code, _, last = block.rpartition("\n")
    word = last.strip()
    if word in WORDS:
        return code.strip(), word
    return block, ""


def _computer_13(text: str, size: Size) -> list[str]:
    """Return the dicts of a reply as code: each in a fence, or the whole text.

    Raises:
        ActionError: the reply is not JSON.
    """
    actions: list[str] = []
    for block in _blocks(text) or [text]:
        inner = block.strip()
        if inner in WORDS:
            actions.append(inner)
            continue
        try:
            data: Any = json.loads(inner)
        except (ValueError, RecursionError) as error:
            raise ActionError(f"computer_13 is JSON ({error})") from None
        for item in data if isinstance(data, list) else [data]:
            if not isinstance(item, Mapping | str):
                raise ActionError("computer_13 is a dict with action_type")
            actions += code_of(item, "computer_13", size)
    return actions
