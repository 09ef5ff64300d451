"""The page's server, on the loopback interface only, from the standard library.

It only reads. The Host check keeps other web sites from reaching it through a name of their own
(DNS rebinding); it allows no other origin.
"""

import sys
from collections.abc import Callable, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, cast

from hijack_data.errors import HijackError

from .datasets import DatasetSource
from .pages import pages_of
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

    def __init__(self, source: DatasetSource | RunSource, port: int = 0) -> None:
        self.pages = pages_of(source)
        try:
            super().__init__((HOSTS[0], port), _Handler)
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or error
            raise HijackError(
                f"cannot listen on {HOSTS[0]} port {port}: {reason}; give another --port"
            ) from None

    @property
    def url(self) -> str:
        """The address to open."""
        return f"http://{HOSTS[0]}:{self.server_address[1]}/"

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
        try:
            self._route(path, query)
        except HijackError as error:
            self._answer(422, str(error).encode("utf-8", "replace"), "text/plain")

    def _route(self, path: str, query: str) -> None:
        found = cast("ViewServer", self.server).pages.answer(path, query)
        if found is None:
            self._answer(404, b"there is nothing here", "text/plain")
        else:
            self._answer(200, found.body, found.kind, found.headers)

    def _answer(
        self, status: int, body: bytes, kind: str, more: Mapping[str, str] | None = None
    ) -> None:
        self.send_response(status)
        text = "" if kind.startswith("image/") else "; charset=utf-8"
        for name, value in {
            **_HEADERS,
            "Content-Type": kind + text,
            "Content-Length": str(len(body)),
            **(more or {}),
        }.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:
        """Log nothing: the terminal is for the address and for problems."""


def serve(source: DatasetSource | RunSource, port: int, say: Callable[[str], object]) -> None:
    """Serve the page until Ctrl-C; `say` is called with the address."""
    with ViewServer(source, port) as server:
        pages = server.pages
        say(f"{pages.title}: {pages.what} at {server.url}  (Ctrl-C ends)")
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            say("the page has ended")
