"""Anthropic's Messages: a conversation in text, or its computer tool."""

from collections.abc import Mapping
from typing import Any

from ...settings import ModelSettings
from ..query import (
    LEFT_OUT,
    ChatMessage,
    EmbeddedPicture,
    ModelQuery,
    Reply,
    ScreenPicture,
    messages,
)
from .common import items, label, load, sampled, texts, tokens

# Needs no size and no beta header; its calls have the names of actions.
TOOLSET = "computer_toolset_20260801"
BETAS = {
    "computer_20251124": "computer-use-2025-11-24",
    "computer_20250124": "computer-use-2025-01-24",
}
NAME = "computer"
# The values of `stop_reason` with which an answer is whole; endpoints of others may leave it out.
WHOLE = (None, "", "end_turn", "stop_sequence", "tool_use", "refusal")


class AnthropicMessages:
    """Messages by the official client `anthropic`."""

    def connect(self, settings: ModelSettings, key: str) -> Any:
        """Return the client."""
        anthropic = load("anthropic", settings)
        return anthropic.Anthropic(
            api_key=key or "none",
            base_url=settings.base_url,
            timeout=settings.timeout,
            max_retries=0,
        )

    def body(self, query: ModelQuery, settings: ModelSettings) -> dict[str, Any]:
        """Return the request; `betas` among its fields goes into a header."""
        body: dict[str, Any] = {"model": settings.model}
        if query.prompt.system:
            body["system"] = query.prompt.system
        if settings.tool is None:
            body["messages"] = [_message(message) for message in messages(query)]
        else:
            body["messages"] = _with_calls(query)
            body["tools"] = [_tool(settings.tool, query.picture)]
            if settings.tool in BETAS:
                body["betas"] = [BETAS[settings.tool]]
        return {**body, **sampled(settings, "max_tokens")}

    def send(self, client: Any, body: Mapping[str, Any]) -> str:
        """Send it."""
        typed = ("model", "messages", "max_tokens", "betas")
        arguments = {key: body[key] for key in typed if key in body}
        extra_body = {key: value for key, value in body.items() if key not in typed}
        api = client.beta.messages if "betas" in body else client.messages
        return str(api.with_raw_response.create(**arguments, extra_body=extra_body).text())

    def read(self, answer: Mapping[str, Any]) -> Reply:
        """Read the blocks of the answer."""
        blocks = items(answer.get("content"), "content")
        words = list(texts(blocks))
        uses = [block for block in blocks if block.get("type") == "tool_use"]
        for use in uses:
            label(use, "id")  # the next request has a result for each
        usage = answer.get("usage")
        stop_reason = answer.get("stop_reason")
        return Reply(
            text="\n".join(words),
            calls=tuple(_call(block) for block in uses),
            raw=list(blocks),
            input_tokens=tokens(
                usage, "input_tokens", "cache_creation_input_tokens", "cache_read_input_tokens"
            ),
            output_tokens=tokens(usage, "output_tokens"),
            refused=stop_reason == "refusal",
            cut="" if stop_reason in WHOLE else str(stop_reason),
        )


def _call(block: Mapping[str, Any]) -> dict[str, Any]:
    """Return a call of the tool; a call of the toolset has the name of its action."""
    name = block.get("name")
    arguments = block.get("input")
    if name == NAME or not isinstance(arguments, Mapping):
        return {"name": name, "arguments": arguments}
    return {"name": NAME, "arguments": {**arguments, "action": name}}


def _message(message: ChatMessage) -> dict[str, Any]:
    return {"role": message.role, "content": [_part(part) for part in message.parts]}


def _tool(kind: str, picture: ScreenPicture) -> dict[str, Any]:
    if kind == TOOLSET:
        return {"type": kind}
    height, width = picture.size
    return {"type": kind, "name": NAME, "display_width_px": width, "display_height_px": height}


def _part(part: str | ScreenPicture) -> dict[str, Any]:
    if isinstance(part, str):
        return {"type": "text", "text": part or "(nothing)"}  # an empty text is refused
    source = {"type": "base64", "media_type": "image/png", "data": EmbeddedPicture(part, prefix="")}
    return {"type": "image", "source": source}


def _with_calls(query: ModelQuery) -> list[dict[str, Any]]:
    """Return messages in which each picture is the result of the calls before it."""
    conversation: list[dict[str, Any]] = []
    opening = [_part(query.prompt.first)] if query.prompt.first else []
    answered: list[Mapping[str, Any]] = []
    pictures = [turn.picture for turn in query.turns] + [query.picture]
    for index, picture in enumerate(pictures):
        is_last = index == len(query.turns)
        part = _part(picture if is_last or query.is_shown(index) else LEFT_OUT)
        conversation.append(
            {"role": "user", "content": [*opening, *_results(answered, part, query)]}
        )
        opening = []
        if is_last:
            break
        answered = query.turns[index].raw or [_part(query.turns[index].answer)]
        conversation.append({"role": "assistant", "content": list(answered)})
    return conversation


def _results(
    answered: list[Mapping[str, Any]], picture_part: dict[str, Any], query: ModelQuery
) -> list[dict[str, Any]]:
    """Return the results of calls; all belong to one picture, which is part of the last result."""
    ids = [block["id"] for block in answered if block.get("type") == "tool_use"]
    prompt_parts = [_part(query.prompt.each)] if query.prompt.each else []
    if not ids:
        return [*prompt_parts, picture_part]
    *early, last = ids
    done_part = {"type": "text", "text": "Done."}
    results = [_result(name, done_part) for name in early]
    return [*results, _result(last, picture_part), *prompt_parts]


def _result(name: str, content: dict[str, Any]) -> dict[str, Any]:
    return {"type": "tool_result", "tool_use_id": name, "content": [content]}
