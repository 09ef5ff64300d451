"""The server of the page: read-only, on the loopback interface, with the standard library.

Other users of the machine can connect to the loopback interface, too. So each request needs a
token, which is part of the address that `hijack view` prints; opening that address stores the token
as a cookie. The check of the Host header prevents that a web site reaches the server through a name
of its own (DNS rebinding). No other origin is allowed.
"""

import hmac
import secrets
import sys
from collections.abc import Callable, Mapping
from http.cookies import CookieError, SimpleCookie
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import TYPE_CHECKING, Any, cast
from urllib.parse import parse_qs

from hijack_data.errors import HijackError

from .routes import make_pages

if TYPE_CHECKING:
    from .dataset_source import DatasetSource
    from .runs import RunSource

HOSTS = ("127.0.0.1", "localhost")
IDLE_SECONDS = 60
_HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": (
        "default-src 'none'; img-src 'self' data:; style-src 'self'; script-src 'self'; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


class ViewServer(ThreadingHTTPServer):
    """Serves the page of one source on 127.0.0.1.

    Args:
        source: the dataset or the run.
        port: where to listen; 0 picks a free one.

    Raises:
        HijackError: the port is taken.
    """

    daemon_threads = True

    def __init__(self, source: "DatasetSource | RunSource", port: int = 0) -> None:
        self.pages = make_pages(source)
        self.token = secrets.token_urlsafe(16)
        try:
            super().__init__((HOSTS[0], port), _Handler)
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or error
            raise HijackError(
                f"cannot listen on {HOSTS[0]} port {port}: {reason}; give another --port"
            ) from None

    @property
    def url(self) -> str:
        """The address to open, with the token."""
        return f"http://{HOSTS[0]}:{self.server_address[1]}/?token={self.token}"

    @property
    def cookie(self) -> str:
        """The name of the cookie; cookies of all ports of a host are in one place."""
        return f"hijack-view-{self.server_address[1]}"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore a browser that hangs up before its answer is complete."""
        if not isinstance(sys.exc_info()[1], ConnectionError | TimeoutError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    timeout = IDLE_SECONDS

    def do_GET(self) -> None:
        if self.headers.get("Host", "").partition(":")[0].lower() not in HOSTS:
            self._answer(403, b"open this page as 127.0.0.1 or localhost", "text/plain")
            return
        path, _, query = self.path.partition("?")
        server = cast("ViewServer", self.server)
        if _is_equal(parse_qs(query).get("token", [""])[-1], server.token):
            cookie = f"{server.cookie}={server.token}; Path=/; HttpOnly; SameSite=Strict"
            location = "/" + path.lstrip("/")  # a path of two slashes would be another host
            self._answer(303, b"", "text/plain", {"Location": location, "Set-Cookie": cookie})
            return
        if not _is_equal(self._cookie(server.cookie), server.token):
            self._answer(401, b"open the address that hijack view printed", "text/plain")
            return
        try:
            self._route(path, query)
        except HijackError as error:
            self._answer(422, str(error).encode("utf-8", "replace"), "text/plain")

    def _cookie(self, name: str) -> str:
        try:
            morsel = SimpleCookie(self.headers.get("Cookie", "")).get(name)
        except CookieError:
            return ""
        return "" if morsel is None else morsel.value

    def _route(self, path: str, query: str) -> None:
        answer = cast("ViewServer", self.server).pages.answer(path, query)
        if answer is None:
            self._answer(404, b"there is nothing here", "text/plain")
        else:
            self._answer(200, answer.body, answer.kind, answer.headers)

    def _answer(
        self, status: int, body: bytes, kind: str, extra: Mapping[str, str] | None = None
    ) -> None:
        self.send_response(status)
        text = "" if kind.startswith("image/") else "; charset=utf-8"
        for name, value in {
            **_HEADERS,
            "Content-Type": kind + text,
            "Content-Length": str(len(body)),
            **(extra or {}),
        }.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:
        """Log nothing: the terminal is for the address and for problems."""


def _is_equal(value: str, token: str) -> bool:
    return hmac.compare_digest(value.encode("utf-8", "replace"), token.encode())


def serve(source: "DatasetSource | RunSource", port: int, say: Callable[[str], object]) -> None:
    """Serve the page until Ctrl-C; `say` is called with the address."""
    with ViewServer(source, port) as server:
        pages = server.pages
        say(f"{pages.title}: {pages.description} at {server.url}  (Ctrl-C ends)")
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            say("the page has ended")
