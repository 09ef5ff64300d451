"""What a client may cost the server before and after its token is checked.

uvicorn waits without end for the rest of a request, and reads bodies of any size. OpenEnv drops the
session of a client whose frame is binary, too deep, no object, or holds a number of over 4300
digits. Such a frame is refused here instead. OpenEnv takes text only and parses it again; frames
are short, since pictures go the other way.
"""

import asyncio
import json
from typing import Any

import h11
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

REQUEST_TIMEOUT_S = 20.0  # from the first byte that is awaited to the end of the request
MAX_BODY_BYTES = 2**20  # bytes
MAX_DEPTH = 64  # of lists and objects in a frame
SPARE_CONNECTIONS = 64  # for clients that have no session: health, metrics, refused ones


def bounded_protocol(max_connections: int) -> type[H11Protocol]:
    """Return uvicorn's HTTP protocol with a limit of connections and of the time of a request.

    Both hold before the token is read: who has no token must not be able to use up the descriptors.
    A connection that became a WebSocket is counted, but has no time limit here.

    Args:
        max_connections: A connection beyond this number is closed at once.
    """

    class BoundedProtocol(H11Protocol):
        _timer: asyncio.TimerHandle | None = None

        def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
            super().connection_made(transport)
            if len(self.connections) > max_connections:
                transport.abort()
                return
            self._watch()

        def data_received(self, data: bytes) -> None:
            super().data_received(data)
            self._watch()

        def on_response_complete(self) -> None:
            super().on_response_complete()
            self._watch()

        def connection_lost(self, exc: Exception | None) -> None:
            self._cancel()
            super().connection_lost(exc)

        def _watch(self) -> None:
            """Run the timer exactly while a request is incomplete."""
            if not self._is_incomplete():
                self._cancel()
            elif self._timer is None:
                self._timer = self.loop.call_later(REQUEST_TIMEOUT_S, self._end)

        def _is_incomplete(self) -> bool:
            # A connection that became a WebSocket has another protocol; h11 still awaits a body.
            if self.transport.is_closing() or self.transport.get_protocol() is not self:
                return False
            state = self.conn.their_state
            is_first = self.cycle is None
            return state is h11.SEND_BODY or (
                state is h11.IDLE and (is_first or bool(self.conn.trailing_data[0]))
            )

        def _cancel(self) -> None:
            if self._timer is not None:
                self._timer.cancel()
                self._timer = None

        def _end(self) -> None:
            self._timer = None
            if self._is_incomplete():
                self.transport.abort()

    return BoundedProtocol


class RequestLimits:
    """Refuses bodies that are too large, and answers malformed frames itself.

    Args:
        app: The limited application; it gets JSON objects only.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on within the limits."""
        if scope["type"] == "http":
            await self._http(scope, receive, send)
        elif scope["type"] == "websocket":
            await self._app(scope, _checked_frames(scope["path"], receive, send), send)
        else:
            await self._app(scope, receive, send)

    async def _http(self, scope: Scope, receive: Receive, send: Send) -> None:
        length = dict(scope["headers"]).get(b"content-length", b"0")
        body = bytearray()
        is_too_large = not length.isdigit() or int(length) > MAX_BODY_BYTES
        is_incomplete = not is_too_large
        while is_incomplete:
            message = await receive()
            if message["type"] == "http.disconnect":
                return
            body += message.get("body", b"")
            is_incomplete = message.get("more_body", False)
            if len(body) > MAX_BODY_BYTES:
                is_too_large, is_incomplete = True, False
        if is_too_large:
            text = f"the body of a request may have at most {MAX_BODY_BYTES} bytes\n"
            await PlainTextResponse(text, 413, {"Connection": "close"})(scope, receive, send)
            return
        first: list[Message] = [{"type": "http.request", "body": bytes(body), "more_body": False}]

        async def replay() -> Message:
            return first.pop() if first else await receive()

        await self._app(scope, replay, send)


def _checked_frames(path: str, receive: Receive, send: Send) -> Receive:
    """Return a `receive` that answers what is no JSON object, and waits for the next frame."""

    async def checked() -> Message:
        while True:
            message = await receive()
            if message["type"] != "websocket.receive":
                return message
            problem = frame_problem(message.get("text"))
            if not problem:
                return message
            await send({"type": "websocket.send", "text": _error(path, problem)})

    return checked


def frame_problem(text: str | None) -> str:
    """Return why a frame is not passed on; empty for a JSON object that is not too deep."""
    if text is None:
        return "a frame is text with a JSON object; binary frames are not read"
    try:
        value: object = json.loads(text)
    except (ValueError, RecursionError) as error:
        return f'a frame is a JSON object such as {{"type": "state"}}; this is no JSON: {error}'
    if not isinstance(value, dict):
        kind = type(value).__name__
        return f'a frame is a JSON object such as {{"type": "state"}}, not JSON of type {kind}'
    if _depth(value) > MAX_DEPTH:
        return f"the JSON object of a frame may be {MAX_DEPTH} levels deep at most"
    return ""


def _depth(value: object) -> int:
    """Return how many lists and objects lie in each other."""
    depth = 0
    level = [value]
    while level:
        inner: list[object] = []
        for part in level:
            if isinstance(part, dict):
                inner.extend(part.values())
            elif isinstance(part, list):
                inner.extend(part)
        depth += any(isinstance(part, dict | list) for part in level)
        level = inner
    return depth


def _error(path: str, problem: str) -> str:
    """Return an error in the form of OpenEnv's WebSocket, or of JSON-RPC for its route `/mcp`."""
    if path.rstrip("/").endswith("/mcp"):
        error: dict[str, Any] = {"code": -32600, "message": problem}
        return json.dumps({"jsonrpc": "2.0", "error": error, "id": None})
    return json.dumps({"type": "error", "data": {"message": problem, "code": "INVALID_JSON"}})
