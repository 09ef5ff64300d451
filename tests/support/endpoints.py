"""A real HTTP server on the loopback that answers as models' endpoints do, well or badly.

It speaks chat completions, Responses and Messages. `answers` are given one after the other, the
last one for ever: a text, a `Call` or several, or a `Raw` answer with status, headers and delay.
"""

import json
import threading
import time
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any


@dataclass(frozen=True)
class Call:
    """A call of a tool."""

    name: str
    arguments: Any


@dataclass(frozen=True)
class Raw:
    """What is sent as it is."""

    body: bytes = b"{}"
    status: int = 200
    headers: dict[str, str] = field(default_factory=dict)
    delay: float = 0.0


@dataclass(frozen=True)
class Refusal:
    """The model refuses."""

    text: str


class Endpoint:
    """The server: what it answers, and what it was asked."""

    def __init__(self, *answers):
        self.answers = list(answers)
        self.asked: list[dict] = []
        self.headers: list[dict] = []
        self.url = ""

    def next(self):
        if len(self.answers) > 1:
            return self.answers.pop(0)
        answer = self.answers[0]
        return answer(self.asked[-1]) if callable(answer) else answer

    @property
    def pictures(self):
        """How many pictures each request had."""
        return [json.dumps(body).count("iVBORw0KGgo") for body in self.asked]


@contextmanager
def serving(*answers):
    """Serve in a thread."""
    endpoint = Endpoint(*answers)

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def log_message(self, *_):
            pass

        def do_POST(self):
            length = int(self.headers.get("content-length", 0))
            endpoint.asked.append(json.loads(self.rfile.read(length)))
            endpoint.headers.append({k.lower(): v for k, v in self.headers.items()})
            answer = endpoint.next()
            if not isinstance(answer, Raw):
                answer = Raw(json.dumps(said(self.path, answer)).encode())
            time.sleep(answer.delay)
            self.send_response(answer.status)
            self.send_header("content-type", "application/json")
            self.send_header("content-length", str(len(answer.body)))
            for name, value in answer.headers.items():
                self.send_header(name, value)
            self.end_headers()
            with suppress(OSError):  # the client did not wait so long
                self.wfile.write(answer.body)

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    endpoint.url = f"http://127.0.0.1:{server.server_address[1]}/v1"
    try:
        yield endpoint
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def said(path, answer):
    """An answer in the form of an API."""
    if path.endswith("/chat/completions"):
        return chat(answer)
    return responses(answer) if path.endswith("/responses") else messages(answer)


def parts(answer):
    return list(answer) if isinstance(answer, list | tuple) else [answer]


def chat(answer):
    message: dict[str, Any] = {"role": "assistant", "content": None}
    calls = []
    for number, part in enumerate(parts(answer)):
        if isinstance(part, Call):
            function = {"name": part.name, "arguments": json.dumps(part.arguments)}
            calls.append({"id": f"call_{number}", "type": "function", "function": function})
        elif isinstance(part, Refusal):
            message["refusal"] = part.text
        else:
            message["content"] = part
    if calls:
        message["tool_calls"] = calls
    return {
        "id": "chatcmpl-1",
        "object": "chat.completion",
        "created": 0,
        "model": "m",
        "choices": [{"index": 0, "message": message, "finish_reason": "stop"}],
        "usage": {"prompt_tokens": 1000, "completion_tokens": 20, "total_tokens": 1020},
    }


def messages(answer):
    content = []
    stop = "end_turn"
    for number, part in enumerate(parts(answer)):
        if isinstance(part, Call):
            content.append(
                {
                    "type": "tool_use",
                    "id": f"toolu_{number}",
                    "name": part.name,
                    "input": part.arguments,
                }
            )
            stop = "tool_use"
        elif isinstance(part, Refusal):
            content.append({"type": "text", "text": part.text})
            stop = "refusal"
        elif part:
            content.append({"type": "text", "text": part})
    return {
        "id": "msg_1",
        "type": "message",
        "role": "assistant",
        "model": "m",
        "content": content,
        "stop_reason": stop,
        "stop_sequence": None,
        "usage": {"input_tokens": 1000, "output_tokens": 20},
    }


def responses(answer):
    """A `Call` whose arguments are a list is one call with several actions."""
    output = []
    for number, part in enumerate(parts(answer)):
        if isinstance(part, Call):
            several = isinstance(part.arguments, list)
            output.append(
                {
                    "type": "computer_call",
                    "id": f"cu_{number}",
                    "call_id": f"call_{number}",
                    "status": "completed",
                    "pending_safety_checks": [{"id": "s1", "code": "c", "message": "m"}],
                    **({"actions": part.arguments} if several else {"action": part.arguments}),
                }
            )
        else:
            refused = isinstance(part, Refusal)
            text = part.text if refused else part
            inner = (
                {"type": "refusal", "refusal": text}
                if refused
                else {"type": "output_text", "text": text, "annotations": []}
            )
            output.append(
                {
                    "type": "message",
                    "id": "msg_1",
                    "role": "assistant",
                    "status": "completed",
                    "content": [inner] if text else [],
                }
            )
    return {
        "id": "resp_1",
        "object": "response",
        "created_at": 0,
        "model": "m",
        "status": "completed",
        "output": output,
        "usage": {"input_tokens": 1000, "output_tokens": 20, "total_tokens": 1020},
    }
