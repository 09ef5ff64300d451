"""What an agent of a model costs beside its endpoint, and how fast replies are read.

    python benchmarks/chat_agent.py

An agent file asks a server on this machine that answers at once. Its steps are compared with
sending as many bytes to the same server by the HTTP library below the official client, with nothing
else around: the limit of any client. The pictures are recorded screens of 1920x1080, PNG, of which
the last fifteen are sent again with each step, as in the paper.

Each parser reads a reply of its dialect; the limit is Python's own parser of JSON or of code, for
the same text.
"""

import ast
import json
import multiprocessing
import statistics
import tempfile
import time
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from multiprocessing.connection import Connection
from pathlib import Path
from typing import ClassVar

import httpx
import numpy as np
from common import SHARED, machine, seconds, spread, table
from PIL import Image

from hijack_data import png
from hijack_data.types import UInt8Array
from online_env.agents.agent_files import read_agent
from online_env.agents.chat.agent import make_agent
from online_env.agents.chat.parsing import ReplyParser
from online_env.agents.chat.query import Reply

SIZE = (1080, 1920)
STEPS = 20
RUNS = 5
CODE = "I click the button.\n```python\nimport pyautogui\npyautogui.click(960, 540)\n```"
CALL = {"action": "left_click", "coordinate": [960, 540]}
REPLIES = {
    "pyautogui": Reply(text=CODE),
    "computer_13": Reply(
        text='{"action_type": "CLICK", "parameters": {"button": "left", "x": 960, "y": 540}}'
    ),
    "ui_tars": Reply(text="Thought: a button.\nAction: click(start_box='(500,500)')"),
    "ui_tars_1.5": Reply(text="Thought: a button.\nAction: click(start_box='(960,540)')"),
    "qwen2.5_vl": Reply(
        text="<tool_call>\n"
        + json.dumps({"name": "computer_use", "arguments": CALL})
        + "\n</tool_call>"
    ),
    "qwen3_vl": Reply(
        text="<tool_call>\n"
        + json.dumps({"name": "computer_use", "arguments": CALL})
        + "\n</tool_call>"
    ),
    "anthropic": Reply(text="", calls=({"name": "computer", "arguments": CALL},)),
    "openai": Reply(
        text="",
        calls=(
            {
                "name": "computer",
                "arguments": {"type": "click", "button": "left", "x": 960, "y": 540},
            },
        ),
    ),
}
READ = 300  # replies at a time


class Answering(BaseHTTPRequestHandler):
    """Answers every request with the same words."""

    protocol_version = "HTTP/1.1"
    wbufsize = 65536  # head and body in one packet: two would wait 40 ms for an acknowledgement
    lengths: ClassVar[list[int]] = []

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing."""

    def do_POST(self) -> None:
        """Read the request to its end, then answer."""
        length = int(self.headers["content-length"])
        self.rfile.read(length)
        self.lengths.append(length)
        message = {"role": "assistant", "content": CODE}
        choice = {"index": 0, "finish_reason": "stop", "message": message}
        usage = {"prompt_tokens": 1, "completion_tokens": 1, "total_tokens": 2}
        answer = {"id": "1", "object": "chat.completion", "created": 0, "model": "m"}
        self._send({**answer, "choices": [choice], "usage": usage})

    def do_GET(self) -> None:
        """Answer with the lengths of all requests."""
        self._send(self.lengths)

    def _send(self, data: object) -> None:
        body = json.dumps(data).encode()
        self.send_response(200)
        self.send_header("content-type", "application/json")
        self.send_header("content-length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)


def serve(connection: Connection) -> None:
    """Serve on the loopback until the process is ended; send the port first."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), Answering)
    connection.send(server.server_address[1])
    server.serve_forever()


def screens() -> list[UInt8Array]:
    """Return recorded screens, as many as an episode has steps."""
    value = sorted(SHARED.glob("*.png"))[:STEPS]
    shape = (SIZE[1], SIZE[0])
    return [np.asarray(Image.open(path).convert("RGB").resize(shape)) for path in value]


def step_costs(pictures: list[UInt8Array]) -> list[list[str]]:
    """Return rows: step, bytes, the agent, the limit, and the difference, in milliseconds."""
    ours, peer_end = multiprocessing.Pipe()
    server = multiprocessing.get_context("spawn").Process(
        target=serve, args=(peer_end,), daemon=True
    )
    server.start()
    url = f"http://127.0.0.1:{ours.recv()}"
    with tempfile.TemporaryDirectory() as scratch:
        file = Path(scratch, "agent.yaml")
        file.write_text(
            f"model: m\nbase_url: {url}/v1\nprompt: pyautogui\nparser: pyautogui\nhistory: 15\n"
        )
        agent = make_agent(read_agent(str(file)))
        times_by_picture: list[list[float]] = [[] for _ in pictures]
        for _ in range(RUNS):
            agent.reset()
            for step, picture in enumerate(pictures):
                begun = time.perf_counter()
                agent.predict("Click the button.", {"screenshot": picture})
                times_by_picture[step].append((time.perf_counter() - begun) * 1e3)
    with httpx.Client(base_url=url) as client:
        lengths: list[int] = client.get("/").json()[: len(pictures)]
        rows = [
            _row(step, pictures[step], lengths[step], times_by_picture[step], client)
            for step in (0, 5, 10, 15, len(pictures) - 1)
        ]
    server.terminate()
    server.join()
    return rows


def _row(
    step: int, picture: UInt8Array, length: int, agent: list[float], client: httpx.Client
) -> list[str]:
    body = b"x" * length
    encoded = [seconds(lambda: png.encode(picture)) * 1e3 for _ in range(RUNS)]
    sending_times = [seconds(lambda: client.post("/", content=body)) * 1e3 for _ in range(RUNS)]
    value = statistics.median(agent) - statistics.median(sending_times)
    return [
        str(step),
        f"{length / 1e6:.2f}",
        spread(agent, 1),
        spread(sending_times, 1),
        f"{value:.1f}",
        f"{statistics.median(encoded):.1f}",
    ]


def parser_rates() -> list[list[str]]:
    """Return rows: parser, replies a second, and the ratio of its time to the limit's."""
    rows: list[list[str]] = []
    for dialect, reply in REPLIES.items():
        parser = ReplyParser(dialect=dialect)
        actions = parser.read(reply, SIZE)
        limit = _limit(reply)
        result = _per_reply(lambda parser=parser, reply=reply: parser.read(reply, SIZE))
        least = _per_reply(limit)
        times = statistics.median(result) / statistics.median(least)
        rates = [1 / item for item in result]
        action = actions[0].splitlines()[-1]
        rows.append([dialect, f"`{action}`", spread(rates, 0), f"{times:.1f}x"])
    return rows


def _limit(reply: Reply) -> Callable[[], object]:
    if reply.text == CODE:
        return lambda: ast.parse("import pyautogui\npyautogui.click(960, 540)")
    text = json.dumps(dict(reply.calls[0]) if reply.calls else CALL)
    return lambda: json.loads(text)


def _per_reply(work: Callable[[], object]) -> list[float]:
    """Return seconds a call, of several rounds."""

    def many() -> None:
        for _ in range(READ):
            work()

    return [seconds(many) / READ for _ in range(RUNS)]


def main() -> None:
    """Measure, and print two tables."""
    print(f"{machine()}\n")
    print(f"A step of an agent whose endpoint answers at once; 1920x1080, {RUNS} episodes.\n")
    heading = ["step", "MB sent", "agent, ms", "the same bytes, ms", "agent alone, ms"]
    print(table([*heading, "of it: PNG, ms"], step_costs(screens())))
    print("\nReplies that click once, read by each parser:\n")
    print(table(["parser", "action", "replies/s", "time, to JSON's or Python's"], parser_rates()))


if __name__ == "__main__":
    main()
