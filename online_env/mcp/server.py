"""Serves an episode to one MCP client, over standard input and output or over HTTP."""

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NoReturn

import anyio
import uvicorn
from mcp.server import MCPServer
from mcp.types import UNSUPPORTED_PROTOCOL_VERSION
from mcp_types.version import HANDSHAKE_PROTOCOL_VERSIONS
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from hijack_data.errors import ParameterError

from ..serving.access import AccessGuard, bind, is_loopback
from .episode import POLL_S, McpEpisode, McpOptions
from .tools import make_tool_server

TOKEN = "AGENTHIJACK_MCP_TOKEN"
PATH = "/mcp"
RECONNECT_S = 2.0  # within which a client whose stream broke must come back
MAX_MESSAGE_BYTES = 2**20
SHUTDOWN_GRACE_S = 2


def serve_stdio(options: McpOptions) -> None:
    """Serve a client that started this process, until it closes standard input.

    Raises:
        HijackError: The episode cannot be played.
    """
    with _interrupted_by_sigterm(), McpEpisode(options) as episode:
        server = _make_server(episode, options)
        with _watch(episode.end_if_silent):
            anyio.run(server.run_stdio_async)


def serve_http(
    options: McpOptions, host: str, port: int, token: str | None, say: Callable[[str], object]
) -> None:
    """Serve the first client that comes, until it leaves or vanishes.

    Args:
        options: What is played.
        host: The address to listen at.
        port: 0 takes a free one.
        token: What the client has to send; `None` for nothing.
        say: Called with a line for the user, once the server listens.

    Raises:
        ParameterError: The address is taken, or reachable from elsewhere without a token.
        HijackError: The episode cannot be played.
    """
    if token is None and not is_loopback(host):
        raise ParameterError(
            f"{host} can be reached from other machines, which needs a token: set {TOKEN}, or give"
            " --token-file"
        )
    with _interrupted_by_sigterm(), bind(host, port) as listener, McpEpisode(options) as episode:
        server = _make_server(episode, options)
        presence = ClientPresence(episode)
        app = presence.watch(
            server.streamable_http_app(
                streamable_http_path=PATH,
                session_idle_timeout=options.lease,
                max_sessions=1,
                max_request_body_size=MAX_MESSAGE_BYTES,
                host=host,
            )
        )
        config = uvicorn.Config(
            AccessGuard(app, token),
            log_level="warning",
            access_log=False,
            timeout_graceful_shutdown=SHUTDOWN_GRACE_S,
        )
        web_server = uvicorn.Server(config)

        def end_if_gone() -> bool:
            if episode.end_if_silent() or presence.is_gone():
                web_server.should_exit = True
            return web_server.should_exit

        listener.listen()
        name = f"[{host}]" if ":" in host else host
        access = "with a token" if token else "without a token"
        say(f"one episode at http://{name}:{listener.getsockname()[1]}{PATH}, {access}")
        with _watch(end_if_gone):
            web_server.run(sockets=[listener])


class ClientPresence:
    """Whether the client of an HTTP server is still there.

    The revisions of the protocol from 2026-07-28 on have no sessions, so nothing tells a second
    client from the first, or a client that thinks from one that has ended. Only revisions with
    sessions are served. Their clients keep a stream open, which breaks when they end.

    Args:
        episode: Learns when the client calls.
    """

    def __init__(self, episode: McpEpisode) -> None:
        self._episode = episode
        self._open = 0  # requests that are being answered
        self._had_stream = False
        self._is_deleted = False
        self._last_seen = time.monotonic()

    def is_gone(self) -> bool:
        """Return whether the client has ended its session, or vanished."""
        if self._is_deleted:
            return True
        is_away = self._open == 0 and time.monotonic() - self._last_seen > RECONNECT_S
        return self._had_stream and is_away

    def watch(self, app: ASGIApp) -> ASGIApp:
        """Return an application that answers as `app`, and notes what the client does."""

        async def watched(scope: Scope, receive: Receive, send: Send) -> None:
            if scope["type"] != "http":
                await app(scope, receive, send)
                return
            version = dict(scope["headers"]).get(b"mcp-protocol-version", b"").decode("latin-1")
            if version and version not in HANDSHAKE_PROTOCOL_VERSIONS:
                await _refuse_version(version)(scope, receive, send)
                return

            async def note_answer(message: Message) -> None:
                if message["type"] == "http.response.start" and message["status"] < 300:
                    self._had_stream |= scope["method"] == "GET"
                    self._is_deleted |= scope["method"] == "DELETE"
                    self._episode.note_call()
                await send(message)

            self._open += 1
            try:
                await app(scope, receive, note_answer)
            finally:
                self._open -= 1
                self._last_seen = time.monotonic()

        return watched


def _refuse_version(version: str) -> JSONResponse:
    """Return the protocol's error for a revision that is not served; clients then use another."""
    data = {"supported": list(HANDSHAKE_PROTOCOL_VERSIONS), "requested": version}
    error = {
        "code": UNSUPPORTED_PROTOCOL_VERSION,
        "message": "only revisions with sessions are served",
        "data": data,
    }
    return JSONResponse({"jsonrpc": "2.0", "id": None, "error": error}, 400)


def _make_server(episode: McpEpisode, options: McpOptions) -> MCPServer[Any]:
    read_score = episode.read_score if options.tell_score else None
    return make_tool_server(
        episode.client,
        with_tree=options.with_tree,
        read_score=read_score,
        note_call=episode.note_call,
    )


@contextmanager
def _watch(check: Callable[[], bool]) -> Iterator[None]:
    """Call `check` again and again during the block, until it returns true."""
    is_done = threading.Event()

    def run() -> None:
        while not is_done.wait(POLL_S) and not check():
            pass

    thread = threading.Thread(target=run, name="watch")
    thread.start()
    try:
        yield
    finally:
        is_done.set()
        thread.join()


@contextmanager
def _interrupted_by_sigterm() -> Iterator[None]:
    """End the block at SIGTERM or Ctrl-C, without an error; nothing interrupts its own end."""
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        yield
    except KeyboardInterrupt:
        pass
    finally:
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, signal.SIG_IGN)


def _interrupt(*_: object) -> NoReturn:
    """End as Ctrl-C does, once.

    Raises:
        KeyboardInterrupt: Always.
    """
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, signal.SIG_IGN)
    raise KeyboardInterrupt
