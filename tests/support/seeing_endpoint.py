"""A local endpoint that looks: it clicks the dark square of the last picture, and is done when
there is none. Where it gets no picture it asks for one.

It speaks chat completions, Responses and Messages, streamed or not, over real HTTP on the loopback.
"""

import base64
import io
import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import numpy as np
from PIL import Image

from support.squares import middle_of_square

DONE = "The task is done."
USAGE = {"input_tokens": 1, "output_tokens": 1, "total_tokens": 2}


@dataclass
class Endpoint:
    """What an endpoint is asked for, and how it answers."""

    url: str = ""
    requests: list[dict[str, Any]] = field(default_factory=list)
    paths: list[str] = field(default_factory=list)
    pictures: list[list[tuple[int, int]]] = field(default_factory=list)  # sizes, of each request
    never_done: bool = False  # clicks for ever
    unknown_tool: bool = False  # calls a tool that nobody has


@contextmanager
def serve(**how: Any) -> Iterator[Endpoint]:
    """Serve while the block runs."""
    endpoint = Endpoint(**how)

    class Handler(_Handler):
        seen = endpoint

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    endpoint.url = f"http://127.0.0.1:{server.server_address[1]}"
    try:
        yield endpoint
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def pictures_in(node: Any) -> Iterator[np.ndarray]:
    """The pictures of a request, in order, as any of the three APIs writes them."""
    if isinstance(node, dict):
        if node.get("type") == "base64":
            yield _decoded(node["data"])
        for value in node.values():
            yield from pictures_in(value)
    elif isinstance(node, list):
        for value in node:
            yield from pictures_in(value)
    elif isinstance(node, str) and node.startswith("data:image/"):
        yield _decoded(node.partition(";base64,")[2])


def _decoded(text: str) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(text))).convert("RGB"))


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    seen: Endpoint
    blind = False  # there is no picture in the request

    def log_message(self, *_: Any) -> None:
        """Nothing is printed."""

    def do_POST(self) -> None:
        length = int(self.headers.get("content-length", 0))
        body = json.loads(self.rfile.read(length))
        items = list(pictures_in(body))
        self.seen.requests.append(body)
        self.seen.paths.append(self.path.partition("?")[0])
        self.seen.pictures.append([picture.shape[:2] for picture in items])
        self.blind = not items
        point = middle_of_square(items[-1]) if items else None
        if self.seen.never_done and items:
            point = point or (5, 5)
        number = len(self.seen.requests)
        answers = {
            "completions": self._chat,
            "responses": self._responses,
            "messages": self._messages,
        }
        answers[self.seen.paths[-1].rpartition("/")[2]](body, point, number)

    # Chat completions

    def _chat(self, body: dict[str, Any], place: Any, number: int) -> None:
        names = [tool["function"]["name"] for tool in body.get("tools", ())]
        message: dict[str, Any] = {"role": "assistant", "content": None}
        requests = json.dumps(body["messages"])
        if "computer" in names or self.seen.unknown_tool:
            message["tool_calls"] = [_function_call(names, place, number, self.seen)]
        elif "coordinate of one point" in requests:
            message["content"] = str(place)
        elif "agent-s" in body["model"]:
            message["content"] = _grounded(place)
        elif place is None:
            message["content"] = DONE
        else:
            message["content"] = f"```python\npyautogui.click{place}\n```"
        reason = "tool_calls" if message.get("tool_calls") else "stop"
        answer = {
            "id": f"chatcmpl-{number}",
            "object": "chat.completion",
            "created": 0,
            "model": body["model"],
            "choices": [{"index": 0, "message": message, "finish_reason": reason}],
            "usage": {"prompt_tokens": 1, "completion_tokens": 1, "total_tokens": 2},
        }
        self._answer(answer)

    # Responses

    def _responses(self, body: dict[str, Any], place: Any, number: int) -> None:
        kinds = {tool["type"] for tool in body.get("tools", ())}
        names = [tool.get("name") for tool in body.get("tools", ())]
        call = {
            "id": f"item_{number}",
            "call_id": f"call_{number}",
            "status": "completed",
            "pending_safety_checks": [],
        }
        click = None
        if self.blind:
            click = {"type": "screenshot"}
        elif place is not None:
            click = {"type": "click", "button": "left", "x": place[0], "y": place[1]}
        output: dict[str, Any]
        if self.seen.unknown_tool:
            output = {**call, "type": "function_call", "name": "no_such_tool", "arguments": "{}"}
        elif click is None and "submit" in names:
            output = {**call, "type": "function_call", "name": "submit"}
            output["arguments"] = json.dumps({"answer": "DONE"})
        elif click is None:
            text = {"type": "output_text", "text": DONE, "annotations": []}
            output = {**call, "type": "message", "role": "assistant", "content": [text]}
        elif "computer" in kinds:
            output = {**call, "type": "computer_call", "actions": [click]}
        else:
            assert "computer_use_preview" in kinds, kinds
            output = {**call, "type": "computer_call", "action": click}
        answer = {
            "id": f"resp_{number}",
            "object": "response",
            "created_at": 0,
            "model": body["model"],
            "status": "completed",
            "output": [output],
            "error": None,
            "incomplete_details": None,
            "instructions": None,
            "metadata": {},
            "parallel_tool_calls": True,
            "tool_choice": "auto",
            "tools": [],
            "usage": {
                **USAGE,
                "input_tokens_details": {"cached_tokens": 0},
                "output_tokens_details": {"reasoning_tokens": 0},
            },
        }
        self._answer(answer)

    # Messages

    def _messages(self, body: dict[str, Any], place: Any, number: int) -> None:
        tools = body.get("tools", ())
        names = [tool.get("name") for tool in tools]
        use: dict[str, Any] = {"type": "tool_use", "id": f"toolu_{number}"}
        block: dict[str, Any]
        if self.blind:
            block = {**use, "name": "computer", "input": {"action": "screenshot"}}
        elif place is None and "submit" in names:
            block = {**use, "name": "submit", "input": {"answer": "DONE"}}
        elif place is None:
            block = {"type": "text", "text": DONE}
        elif any("toolset" in (tool.get("type") or "") for tool in tools):
            arguments = {"coordinate": place}
            block = {**use, "name": "left_click", "toolset_name": "computer", "input": arguments}
        else:
            options = {"action": "left_click", "coordinate": place}
            block = {**use, "name": "computer", "input": options}
        answer = {
            "id": f"msg_{number}",
            "type": "message",
            "role": "assistant",
            "model": body["model"],
            "content": [block],
            "stop_reason": "tool_use" if block["type"] == "tool_use" else "end_turn",
            "stop_sequence": None,
            "usage": USAGE,
        }
        if body.get("stream"):
            self._stream(answer)
        else:
            self._answer(answer)

    def _stream(self, answer: dict[str, Any]) -> None:
        [block] = answer["content"]
        empty = {**block, "input": {}} if "input" in block else {**block, "text": ""}
        delta: dict[str, Any] = {"type": "text_delta", "text": block.get("text", "")}
        if "input" in block:
            delta = {"type": "input_json_delta", "partial_json": json.dumps(block["input"])}
        end = {"stop_reason": answer["stop_reason"], "stop_sequence": None}
        events = [
            {"type": "message_start", "message": {**answer, "content": [], "stop_reason": None}},
            {"type": "content_block_start", "index": 0, "content_block": empty},
            {"type": "content_block_delta", "index": 0, "delta": delta},
            {"type": "content_block_stop", "index": 0},
            {"type": "message_delta", "delta": end, "usage": USAGE},
            {"type": "message_stop"},
        ]
        lines = [f"event: {event['type']}\ndata: {json.dumps(event)}\n\n" for event in events]
        self._send("".join(lines), "text/event-stream")

    def _answer(self, answer: dict[str, Any]) -> None:
        self._send(json.dumps(answer), "application/json")

    def _send(self, text: str, kind: str) -> None:
        data = text.encode()
        self.send_response(200)
        self.send_header("content-type", kind)
        self.send_header("content-length", str(len(data)))
        self.send_header("connection", "close")  # clients may leave open what they keep
        self.end_headers()
        self.wfile.write(data)


def _function_call(names: list[str], place: Any, number: int, seen: Endpoint) -> dict[str, Any]:
    """A call of the function `computer`, of `submit` at the end, or of one that nobody has."""
    name, entries = "computer", {"action": "left_click", "coordinate": place}
    if seen.unknown_tool:
        name = "no_such_tool"
    elif place is None and "submit" in names:
        name, entries = "submit", {"answer": "DONE"}
    return {
        "id": f"call_{number}",
        "type": "function",
        "function": {"name": name, "arguments": json.dumps(entries)},
    }


def _grounded(place: Any) -> str:
    """An answer in the form that Agent S3 asks for."""
    call = "agent.done()" if place is None else 'agent.click("the dark square", 1, "left")'
    parts = ("Previous action verification", "Screenshot Analysis", "Next Action")
    text = "\n".join(f"({part})\nA square." for part in parts)
    return f"{text}\n(Grounded Action)\n```python\n{call}\n```"
