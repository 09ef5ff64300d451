"""What `hijack serve` allows a client before and after the token: real sockets, a small app."""

import contextlib
import json
import socket
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse
from starlette.routing import Route, WebSocketRoute
from starlette.testclient import TestClient
from starlette.websockets import WebSocket

from online_env.serving import limits

from support import needs

CONNECTIONS = 5
REQUEST = b"GET / HTTP/1.1\r\nHost: a\r\n\r\n"


async def size(request: Request) -> PlainTextResponse:
    return PlainTextResponse(str(len(await request.body())))


async def echo(socket: WebSocket) -> None:
    await socket.accept()
    async for text in socket.iter_text():
        await socket.send_text(text)


APP = limits.RequestLimits(
    Starlette(routes=[Route("/", size, methods=["GET", "POST"]), WebSocketRoute("/ws", echo)])
)


@pytest.fixture
def port(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """The port of a server whose requests have half a second."""
    monkeypatch.setattr(limits, "REQUEST_TIMEOUT_S", 0.5)
    config = uvicorn.Config(APP, http=limits.bounded_protocol(CONNECTIONS), log_level="critical")
    server = uvicorn.Server(config)
    listener = socket.create_server(("127.0.0.1", 0))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
    thread.start()
    yield listener.getsockname()[1]
    server.should_exit = True
    thread.join(30)


def connect(port: int) -> socket.socket:
    return socket.create_connection(("127.0.0.1", port), timeout=20)


def ask(connection: socket.socket) -> bytes:
    """Send a request, and return the whole answer, whose body is "0"."""
    connection.sendall(REQUEST)
    answer = b""
    while not answer.endswith(b"\r\n\r\n0"):
        part = connection.recv(4096)
        assert part, answer
        answer += part
    return answer


def ended(connection: socket.socket) -> bool:
    """Whether the server ends a connection without a word."""
    try:
        return connection.recv(1) == b""
    except ConnectionResetError:
        return True


def test_a_request_that_does_not_end_loses_its_connection(port: int) -> None:
    for sent in (b"", b"GET / HT", b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 9\r\n\r\nabc"):
        with connect(port) as connection:
            connection.sendall(sent)
            assert ended(connection), sent


def test_a_connection_is_kept_between_requests_but_not_in_the_middle_of_one(port: int) -> None:
    with connect(port) as connection:
        ask(connection)
        time.sleep(1)  # longer than a request may take
        ask(connection)
        connection.sendall(b"GET / HTT")
        assert ended(connection)


def test_connections_without_a_request_cannot_use_up_the_descriptors(port: int) -> None:
    with contextlib.ExitStack() as stack:
        values = [stack.enter_context(connect(port)) for _ in range(CONNECTIONS)]
        time.sleep(0.1)
        with connect(port) as one_more:
            with contextlib.suppress(OSError):  # it is closed already
                one_more.sendall(REQUEST)
            assert ended(one_more)
        assert all(ended(connection) for connection in values)  # when their time is over
    with connect(port) as connection:
        assert b"200 OK" in ask(connection)


def test_a_session_may_wait_longer_than_a_request(port: int) -> None:
    """A reset takes minutes on a virtual machine."""
    client = pytest.importorskip("websockets.sync.client", reason=needs.SERVE)
    with client.connect(f"ws://127.0.0.1:{port}/ws") as session:
        time.sleep(1)
        session.send('{"type": "state"}')
        assert session.recv(timeout=20) == '{"type": "state"}'


def test_a_body_has_a_limit_whether_its_size_is_declared_or_not() -> None:
    client = TestClient(APP)
    most = b"x" * limits.MAX_BODY_BYTES
    assert client.post("/", content=most).text == str(len(most))
    too_large = client.post("/", content=most + b"x")
    assert (too_large.status_code, str(limits.MAX_BODY_BYTES) in too_large.text) == (413, True)
    assert client.post("/", content=iter([most, b"x"])).status_code == 413


@pytest.mark.parametrize(
    ("frame", "words"),
    [
        ("null", "not JSON of type NoneType"),
        ("5", "not JSON of type int"),
        ("[]", "not JSON of type list"),
        ("{", "no JSON"),
        ("[" * 100_000, "no JSON"),
        ('{"a":' * 80 + "1" + "}" * 80, "64 levels deep"),
        (b"\x00\x01", "binary frames"),
    ],
    ids=["null", "number", "list", "half", "brackets", "deep", "binary"],
)
def test_a_malformed_frame_is_answered_in_words_and_the_session_goes_on(
    frame: Any, words: str
) -> None:
    with TestClient(APP).websocket_connect("/ws") as session:
        if isinstance(frame, bytes):
            session.send_bytes(frame)
        else:
            session.send_text(frame)
        answer = json.loads(session.receive_text())
        assert (answer["type"], answer["data"]["code"]) == ("error", "INVALID_JSON")
        assert words in answer["data"]["message"]
        good = json.dumps({"type": "state", "text": "[" * 100})
        session.send_text(good)
        assert session.receive_text() == good
