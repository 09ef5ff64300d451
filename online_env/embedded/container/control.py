"""The control port of a container, on which the holder of the token requests a pristine desktop.

Process 1 has no threads, because it forks: it serves one request at a time, between two checks for
processes that have ended.
"""

import hmac
import json
from collections.abc import Callable, Iterable
from http.server import BaseHTTPRequestHandler, HTTPServer
from typing import Any, cast

CONTROL_PORT = 5001
READ_TIMEOUT_S = 5.0  # s for a request to be read
ATTEND_S = 60.0  # s for which the desktop is looked after at a time
RESET = "/reset"


class _Request(BaseHTTPRequestHandler):
    timeout = READ_TIMEOUT_S

    def do_POST(self) -> None:
        """Note that a reset was asked for; the answer follows when it is done."""
        server = cast("_Server", self.server)
        token = self.headers.get("X-Token", "").encode("utf-8", "replace")
        if not hmac.compare_digest(token, server.token):
            self.send_error(401, "a token is needed: send it as X-Token")
            return
        if self.path != RESET:
            self.send_error(404, f"there is only {RESET}")
            return
        server.asked = self.request.dup()

    def log_message(self, format: str, *arguments: Any) -> None:
        """Write nothing: who asks is not of interest."""


class _Server(HTTPServer):
    def __init__(self, port: int, token: bytes) -> None:
        super().__init__(("0.0.0.0", port), _Request)
        self.token = token
        self.asked: Any = None

    def shutdown_request(self, request: Any) -> None:
        """Close a connection, but not for who waits for a reset."""
        if self.asked is None:
            super().shutdown_request(request)
        else:
            request.close()


class Control:
    """The control port.

    Args:
        port: its number.
        token: what a request must show.
    """

    def __init__(self, port: int, token: str) -> None:
        self._server = _Server(port, token.encode())

    def load(self) -> None:
        """Import what requests need, while files can still be trusted."""
        import email.parser
        import http.client

        email.parser.Parser(_class=http.client.HTTPMessage).parsestr("X-Token: x\r\n\r\n")

    def wait(self, attend: Callable[[float, Iterable[int]], set[int]]) -> None:
        """Wait for a request for a reset, which `answer` answers.

        Args:
            attend: looks after the desktop until one of some descriptors can be read.
        """
        while self._server.asked is None:
            if attend(ATTEND_S, (self._server.fileno(),)):
                self._server.handle_request()

    def answer(self, outcome: dict[str, Any]) -> None:
        """Answer the request for a reset, if there is one: the first session has none."""
        request = self._server.asked
        self._server.asked = None
        if request is None:
            return
        body = json.dumps(outcome).encode()
        status = "500 Internal Server Error" if "error" in outcome else "200 OK"
        head = f"HTTP/1.0 {status}\r\nContent-Type: application/json\r\n"
        with request:
            try:
                request.sendall(f"{head}Content-Length: {len(body)}\r\n\r\n".encode() + body)
            except OSError:
                return  # it waits no more
