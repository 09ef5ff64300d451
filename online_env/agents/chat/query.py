"""The questions to a model, independent of the API: pictures, past turns and the present one."""

import base64
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hijack_data import png
from hijack_data.surrogates import without_halves
from hijack_data.types import Size, UInt8Array

from .prompts import Prompt

URL = "data:image/png;base64,"
LEFT_OUT = "(An older screenshot, left out.)"
# In an onlooker's summary, what follows is about a change that no action of the agent caused. The
# summaries that onlookers are trained on have the same words (pipelines/exports/onlooker).
NOT_THE_AGENT = "Not the agent's doing:"


class ScreenPicture:
    """A picture that the agent saw, encoded for sending; the pixels are not kept.

    Args:
        pixels: uint8 RGB `[H, W, 3]`.
    """

    def __init__(self, pixels: UInt8Array) -> None:
        height, width = pixels.shape[:2]
        hasher = hashlib.sha256(repr((height, width)).encode())
        hasher.update(np.ascontiguousarray(pixels).data)
        self.size: Size = (height, width)
        # The hash of the pixels, since the bytes of a PNG depend on the encoder.
        self.sha256 = hasher.hexdigest()
        self.base64 = base64.b64encode(png.encode(pixels)).decode()


@dataclass(frozen=True)
class EmbeddedPicture:
    """A picture at its place in a request, to be sent as base64 after `prefix`."""

    picture: ScreenPicture
    prefix: str = URL


@dataclass(frozen=True, kw_only=True)
class Turn:
    """A past step.

    Args:
        picture: what the agent saw.
        answer: the model's answer.
        raw: the answer in the API's form, to be sent back to the API.
        summary: what happened, in the onlooker's words; `None` without one.
        unexpected: whether `summary` is about a change that no action of the agent caused (the
            paper's o_k, d_k), and `picture` is the first that shows it; such a turn has no answer.
    """

    picture: ScreenPicture
    answer: str
    raw: Any = None
    summary: str | None = None
    unexpected: bool = False


@dataclass(frozen=True, kw_only=True)
class ModelQuery:
    """One question to a model.

    Args:
        prompt: filled in.
        picture: the current screen; `None` for a question in text only.
        turns: the past steps, the oldest first.
        pictures: how many pictures of past steps are sent; the newest ones are.
        before: pictures before `picture` that belong to no turn (for an onlooker).
        summarised: whether summaries replace the agent's own words.
    """

    prompt: Prompt
    picture: ScreenPicture
    turns: tuple[Turn, ...] = ()
    pictures: int = 15
    before: tuple[ScreenPicture, ...] = ()
    summarised: bool = False

    def is_shown(self, index: int) -> bool:
        """Return whether the picture of past step `index` is sent."""
        return index >= len(self.turns) - self.pictures


@dataclass(frozen=True, kw_only=True)
class Reply:
    """The answer of a model.

    Args:
        text: its words.
        calls: calls of tools, each with `name` and `arguments`.
        raw: the part that the API expects back in the next request.
        input_tokens: tokens of the request, as the endpoint counted them.
        output_tokens: tokens of the answer.
        refused: whether the model refused to answer.
        cut: why the answer is not whole, in the API's word, such as `max_tokens`; "" if it is.
    """

    text: str
    calls: tuple[Mapping[str, Any], ...] = ()
    raw: Any = None
    input_tokens: int = 0
    output_tokens: int = 0
    refused: bool = False
    cut: str = ""

    @property
    def transcript(self) -> str:
        """Its words and calls as one text, for the log and for people."""
        calls = [json.dumps(dict(call), ensure_ascii=False) for call in self.calls]
        return "\n".join(part for part in (self.text, *calls) if part)


@dataclass
class ChatMessage:
    """One message: a role and parts, which are texts and pictures."""

    role: str
    parts: list[str | ScreenPicture] = field(default_factory=list[str | ScreenPicture])


def messages(query: ModelQuery) -> list[ChatMessage]:
    """Return the messages of a conversation in text; no two neighbours have the same role."""
    conversation: list[ChatMessage] = []
    if query.prompt.first:
        _add(conversation, "user", query.prompt.first)
    step = 0
    for index, turn in enumerate(query.turns):
        _add(conversation, "user", query.prompt.each)
        _add(conversation, "user", turn.picture if query.is_shown(index) else LEFT_OUT)
        step += not turn.unexpected
        if turn.unexpected:
            _add(conversation, "user", f"{NOT_THE_AGENT} {turn.summary}")
        elif query.summarised:
            _add(conversation, "user", f"Step {step}: {turn.summary or turn.answer}")
        else:
            _add(conversation, "assistant", turn.answer)
    for picture in query.before:
        _add(conversation, "user", picture)
    _add(conversation, "user", query.prompt.each)
    _add(conversation, "user", query.picture)
    return conversation


def _add(conversation: list[ChatMessage], role: str, part: str | ScreenPicture) -> None:
    if part == "" and role == "user":
        return
    if not conversation or conversation[-1].role != role:
        conversation.append(ChatMessage(role))
    conversation[-1].parts.append(part)


def wired(body: Any) -> Any:
    """Return a request with its pictures as base64, in the form in which it is sent.

    Halves of surrogate pairs in earlier answers are replaced, since no request can contain them.
    """
    if isinstance(body, EmbeddedPicture):
        return f"{body.prefix}{body.picture.base64}"
    if isinstance(body, str):
        return without_halves(body)
    return _map_values(body, wired)


def logged(body: Any) -> Any:
    """Return a request with its pictures as hashes, for the log."""
    if isinstance(body, EmbeddedPicture):
        return f"sha256:{body.picture.sha256}"
    return _map_values(body, logged)


def request_digest(body: Any) -> str:
    """Return the SHA-256 of a request, which is the same on every machine."""
    text = json.dumps(logged(body), sort_keys=True, ensure_ascii=False)
    return hashlib.sha256(text.encode("utf-8", "backslashreplace")).hexdigest()


def _map_values(body: Any, convert: Any) -> Any:
    if isinstance(body, Mapping):
        return {key: convert(value) for key, value in body.items()}
    if isinstance(body, list | tuple):
        return [convert(value) for value in body]
    return body
