"""Chat completions, as OpenAI, vLLM, SGLang and most others serve them."""

import contextlib
import json
from collections.abc import Iterator, Mapping
from typing import Any

from ...settings import ModelSettings
from ..query import ChatMessage, EmbeddedPicture, ModelQuery, Reply, ScreenPicture, messages
from .common import broken, items, openai_client, sampled, texts, tokens


class OpenAIChat:
    """Chat completions by the official client `openai`."""

    def connect(self, settings: ModelSettings, key: str) -> Any:
        """Return the client."""
        return openai_client(settings, key)

    def body(self, query: ModelQuery, settings: ModelSettings) -> dict[str, Any]:
        """Return the request."""
        conversation = [_message(message) for message in messages(query)]
        if query.prompt.system:
            conversation.insert(0, {"role": "system", "content": query.prompt.system})
        return {
            "model": settings.model,
            "messages": conversation,
            **sampled(settings, "max_tokens"),
        }

    def send(self, client: Any, body: Mapping[str, Any]) -> str:
        """Send it."""
        extra_body = dict(body)
        model = extra_body.pop("model")
        conversation = extra_body.pop("messages")
        raw = client.chat.completions.with_raw_response.create(
            model=model, messages=conversation, extra_body=extra_body
        )
        return raw.text

    def read(self, answer: Mapping[str, Any]) -> Reply:
        """Read the first choice.

        Raises:
            broken: There is none, or the endpoint says that it failed.
        """
        choices = items(answer.get("choices"), "choices")
        # Routers of several providers answer with status 200 and an empty message.
        if choices and (choices[0].get("error") or choices[0].get("finish_reason") == "error"):
            raise broken("has a choice that failed", choices[0].get("error"))
        message = choices[0].get("message") if choices else None
        if not isinstance(message, Mapping):
            raise broken("has no message", answer)
        refusal = message.get("refusal")
        words = [*texts(message.get("content")), *texts(refusal)]
        usage = answer.get("usage")
        return Reply(
            text="\n".join(words),
            calls=tuple(_calls(message)),
            input_tokens=tokens(usage, "prompt_tokens"),
            output_tokens=tokens(usage, "completion_tokens"),
            refused=bool(refusal),
        )


def _message(message: ChatMessage) -> dict[str, Any]:
    if message.role == "assistant":
        words = [part for part in message.parts if isinstance(part, str)]
        return {"role": "assistant", "content": "\n".join(words)}
    return {"role": message.role, "content": [_part(part) for part in message.parts]}


def _part(part: str | ScreenPicture) -> dict[str, Any]:
    if isinstance(part, str):
        return {"type": "text", "text": part}
    return {"type": "image_url", "image_url": {"url": EmbeddedPicture(part)}}


def _calls(message: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    if not message.get("tool_calls"):
        return
    for call in items(message["tool_calls"], "tool_calls"):
        function = call.get("function")
        if not isinstance(function, Mapping):
            continue
        arguments: Any = function.get("arguments")
        if isinstance(arguments, str):
            with contextlib.suppress(ValueError, RecursionError):  # the parser refuses the text
                arguments = json.loads(arguments)
        yield {"name": function.get("name"), "arguments": arguments}
