"""The page's server, on the loopback interface only, from the standard library.

It only reads. Nothing in a request names a file: rows go by number, the page's own files are a
fixed table. The Host check keeps other web sites from reaching it through a name of their own (DNS
rebinding); it allows no other origin.
"""

import json
import re
import sys
from collections.abc import Callable, Mapping
from functools import lru_cache
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, cast
from urllib.parse import parse_qsl

from hijack_data.errors import HijackError
from hijack_data.gallery.markup import source as gallery_file

from . import answers
from .pictures import Pictures
from .source import ViewerSource

HOSTS = ("127.0.0.1", "localhost")
IDLE_SECONDS = 60
_PAGE = Path(__file__).parent / "page"
_FILES = {
    "/": ("text/html", "view.html"),
    "/view.css": ("text/css", "view.css"),
    "/view.js": ("text/javascript", "view.js"),
    "/gallery.js": ("text/javascript", ""),
}
_ASKED: dict[str, Callable[[ViewerSource, Mapping[str, str]], Any]] = {
    "/api/about": lambda source, _: answers.about(source),
    "/api/rows": answers.rows,
    "/api/row": answers.row,
}
_PICTURE = re.compile(r"/(thumb|picture|before)/([0-9]{1,9})")
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

    def __init__(self, source: ViewerSource, port: int = 0) -> None:
        self.source, self.pictures = source, Pictures(source)
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
        server = cast("ViewServer", self.server)
        picture = _PICTURE.fullmatch(path)
        if path in _FILES:
            self._answer(200, page_file(path), _FILES[path][0])
        elif path in _ASKED:
            data = _ASKED[path](server.source, dict(parse_qsl(query)))
            self._answer(200, json.dumps(data).encode(), "application/json")
        elif picture and server.source.index.at(int(picture[2])) is not None:
            kind = picture[1]
            row = int(picture[2])
            self._answer(
                200,
                server.pictures.get(kind, row),
                "image/jpeg" if kind == "thumb" else "image/png",
            )
        else:
            self._answer(404, b"there is nothing here", "text/plain")

    def _answer(
        self,
        status: int,
        body: bytes,
        kind: str,
    ) -> None:
        self.send_response(status)
        text = "" if kind.startswith("image/") else "; charset=utf-8"
        for name, value in {
            **_HEADERS,
            "Content-Type": kind + text,
            "Content-Length": str(len(body)),
        }.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:
        """Log nothing: the terminal is for the address and for problems."""


@lru_cache(maxsize=8)
def page_file(path: str) -> bytes:
    """Return one of the page's own files; style and divider are those of the gallery."""
    name = _FILES[path][1]
    if not name:
        return gallery_file("page.js").encode()
    own = (_PAGE / name).read_text(encoding="utf-8")
    if name == "view.css":
        own = gallery_file("page.css") + own
    return own.encode()


def serve(
    source: ViewerSource,
    port: int,
    say: Callable[[str], object],
) -> None:
    """Serve the page until Ctrl-C; `say` is called with the address."""
    with ViewServer(source, port) as server:
        say(
            f"{source.title}: {len(source.index)} rows ({source.facts}) at {server.url}  (Ctrl-C"
            " ends)"
        )
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            say("the page has ended")
