"""OpenAI's Responses with its computer tool; the conversation is kept at OpenAI."""

from collections.abc import Iterator, Mapping
from typing import Any

from ...settings import ModelSettings
from ..query import EmbeddedPicture, ModelQuery, Reply, ScreenPicture
from .common import broken, items, label, openai_client, sampled, texts, tokens

PREVIEW = "computer_use_preview"
NAME = "computer"
# The values of `status` with which an answer is whole; endpoints of others may leave it out.
WHOLE = (None, "", "completed")


class OpenAIResponses:
    """Responses by the official client `openai`."""

    def connect(self, settings: ModelSettings, key: str) -> Any:
        """Return the client."""
        return openai_client(settings, key)

    def body(self, query: ModelQuery, settings: ModelSettings) -> dict[str, Any]:
        """Return the request with everything new since the last answer."""
        body: dict[str, Any] = {
            "model": settings.model,
            "tools": [_tool(settings.tool, query.picture)],
            "truncation": "auto",
        }
        if query.prompt.system:
            body["instructions"] = query.prompt.system
        last = query.turns[-1].raw if query.turns else None
        if last is None:
            body["input"] = [_message(query.prompt.first, query)]
        else:
            body["previous_response_id"] = last["id"]
            body["input"] = list(_outputs(last["calls"], query)) or [_message("Go on.", query)]
        return {**body, **sampled(settings, "max_output_tokens")}

    def send(self, client: Any, body: Mapping[str, Any]) -> str:
        """Send it."""
        typed = ("model", "input", "tools")
        arguments = {key: body[key] for key in typed}
        extra_body = {key: value for key, value in body.items() if key not in typed}
        return client.responses.with_raw_response.create(**arguments, extra_body=extra_body).text

    def read(self, answer: Mapping[str, Any]) -> Reply:
        """Read the items of the answer.

        Raises:
            broken: The model failed, or is not ready.
        """
        status = answer.get("status")
        if status not in WHOLE and status != "incomplete":
            raise broken(f"is {status!r:.40}", answer.get("error"))
        output = items(answer.get("output"), "output")
        words: list[str] = []
        refused = False
        for item in output:
            if item.get("type") != "message":
                continue
            for part in items(item.get("content"), "content"):
                refused = refused or part.get("type") == "refusal"
                words += texts([part])
                words += texts(part.get("refusal"))
        calls = [item for item in output if item.get("type") == "computer_call"]
        usage = answer.get("usage")
        return Reply(
            text="\n".join(words),
            calls=tuple({"name": NAME, "arguments": action} for action in _actions(calls)),
            raw={"id": label(answer, "id"), "calls": [_call_data(call) for call in calls]},
            input_tokens=tokens(usage, "input_tokens"),
            output_tokens=tokens(usage, "output_tokens"),
            refused=refused,
            cut="" if status in WHOLE else _incomplete_reason(answer),
        )


def _incomplete_reason(answer: Mapping[str, Any]) -> str:
    details = answer.get("incomplete_details")
    reason = details.get("reason") if isinstance(details, Mapping) else None
    return str(reason or "incomplete")


def _actions(calls: list[Mapping[str, Any]]) -> Iterator[object]:
    """Yield the actions of all calls; newer models give several actions per call."""
    for call in calls:
        several = call.get("actions")
        if several is None:
            yield call.get("action")
        else:
            yield from items(several, "actions")


def _call_data(call: Mapping[str, Any]) -> dict[str, Any]:
    checks = items(call.get("pending_safety_checks") or [], "pending_safety_checks")
    return {"call_id": label(call, "call_id"), "checks": checks}


def _tool(kind: str | None, picture: ScreenPicture) -> dict[str, Any]:
    if kind != PREVIEW:
        return {"type": NAME}
    height, width = picture.size
    return {
        "type": PREVIEW,
        "display_width": width,
        "display_height": height,
        "environment": "linux",
    }


def _message(text: str, query: ModelQuery) -> dict[str, Any]:
    content = [
        {"type": "input_text", "text": text},
        {"type": "input_image", "image_url": EmbeddedPicture(query.picture), "detail": "high"},
    ]
    return {"role": "user", "content": content}


def _outputs(calls: list[Mapping[str, Any]], query: ModelQuery) -> Iterator[dict[str, Any]]:
    """Yield a result for each call; all results have the same picture."""
    for call in calls:
        yield {
            "type": "computer_call_output",
            "call_id": call["call_id"],
            "output": {"type": "computer_screenshot", "image_url": EmbeddedPicture(query.picture)},
            "acknowledged_safety_checks": call["checks"],
        }
