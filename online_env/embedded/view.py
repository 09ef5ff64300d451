"""A local web page that shows a desktop live.

It passes mouse and keyboard on to the desktop, and corrupts it on request.
"""

import hashlib
import hmac
import html
import io
import json
import os
import secrets
import sys
import tempfile
import webbrowser
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, Protocol, cast
from urllib.parse import parse_qs, urlsplit

import numpy as np
from PIL import Image

from hijack_data.types import UInt8Array

from ..errors import DesktopError
from .recording import guest_client

PAGE = Path(__file__).with_name("view.html")
QUALITY = 85
MOST_INPUT = 1 << 20


class ButtonPanel(Protocol):
    """Buttons beside the picture: dataclasses with a `name` each.

    `online_env.corrupting.page_buttons.Buttons` is one.
    """

    def all(self) -> Sequence[Any]:
        """Return the buttons in their order."""
        ...

    def press(self, name: str) -> Any:
        """Press a button; an unknown name is a `DesktopError`.

        Returns:
            The button after that.
        """
        ...

    def frame(self, screen: UInt8Array) -> tuple[UInt8Array, str]:
        """Return the picture that the page shows of the screen, uint8 RGB `[H, W, 3]`.

        With it comes a text for what was drawn into it.
        """
        ...


class Viewer(ThreadingHTTPServer):
    """Serves the page of one desktop on the loopback interface.

    Only those who know the token in its address get it.

    Args:
        record: the desktop's record, with the address and the token file of its guest server.
        port: where to listen; 0 picks a free port.
        buttons: what can be done to the desktop from the page; nothing if it is None.
    """

    daemon_threads = True

    def __init__(
        self, record: dict[str, Any], port: int = 0, buttons: ButtonPanel | None = None
    ) -> None:
        self.record = record
        self.token = secrets.token_urlsafe(24)
        self.guest = guest_client(record)
        self.buttons = buttons
        try:
            super().__init__(("127.0.0.1", port), _Handler)
        except (OSError, OverflowError) as error:
            raise DesktopError(
                f"cannot listen on 127.0.0.1 port {port}: {error}; give another --port"
            ) from None

    @property
    def url(self) -> str:
        """The address to open, with its token."""
        return f"http://127.0.0.1:{self.server_address[1]}/?token={self.token}"

    def page(self) -> bytes:
        """Return the page itself."""
        width, height = self.record["screen"]
        text = PAGE.read_text(encoding="utf-8").replace("@NAME@", self.record["id"])
        return text.replace("@WIDTH@", str(width)).replace("@HEIGHT@", str(height)).encode()

    def frame(self, last_seen: str) -> tuple[str, bytes]:
        """Return the present picture's name and JPEG bytes, empty if that is `last_seen`."""
        answer = self.guest.get("/ah/frame").raise_for_status()
        width = int(answer.headers["X-Width"])
        height = int(answer.headers["X-Height"])
        screen = np.frombuffer(answer.content, np.uint8).reshape(height, width, 3)
        pointer = ""
        if self.buttons is not None:
            screen, pointer = self.buttons.frame(screen)
        name = hashlib.blake2b(answer.content + pointer.encode(), digest_size=8).hexdigest()
        if name == last_seen:
            return name, b""
        out = io.BytesIO()
        Image.fromarray(screen).save(out, "JPEG", quality=QUALITY, subsampling=0)
        return name, out.getvalue()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a page that was closed or loaded anew while it was being answered."""
        if not isinstance(sys.exc_info()[1], ConnectionError | TimeoutError):
            super().handle_error(request, client_address)

    def server_close(self) -> None:
        """Stop listening."""
        super().server_close()
        self.guest.close()


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def do_GET(self) -> None:
        parts = urlsplit(self.path)
        token = parse_qs(parts.query).get("token", [self.headers.get("X-Token", "")])[0]
        if not self._is_allowed(token):
            return
        if parts.path == "/":
            self._answer(200, self._viewer.page(), "text/html; charset=utf-8")
        elif parts.path == "/frame":
            self._pass(self._frame)
        elif parts.path == "/buttons":
            panel = self._viewer.buttons
            self._answer_json(
                200, [] if panel is None else [vars(button) for button in panel.all()]
            )
        else:
            self._answer(404, b"there is only / here")

    def do_POST(self) -> None:
        length = self.headers.get("Content-Length", "")
        size = (
            int(length)
            if length.isascii() and length.isdigit() and len(length) < 9
            else MOST_INPUT + 1
        )
        if size > MOST_INPUT:
            self.close_connection = True
            self._answer(413, b"too much input")
            return
        body = self.rfile.read(size)
        if not self._is_allowed(self.headers.get("X-Token", "")):
            return
        if urlsplit(self.path).path == "/press":
            self._press(body)
        else:
            self._pass(lambda: self._input(body))

    @property
    def _viewer(self) -> Viewer:
        return cast("Viewer", self.server)

    def _frame(self) -> None:
        name, jpeg = self._viewer.frame(self.headers.get("X-Seen", ""))
        self._answer(200 if jpeg else 204, jpeg, "image/jpeg", {"X-Frame": name})

    def _press(self, body: bytes) -> None:
        panel = self._viewer.buttons
        if panel is None:
            self._answer(404, b"this page has no buttons")
            return
        try:
            button = panel.press(body.decode("utf-8", "replace"))
        except DesktopError as error:
            self._answer(400, str(error).encode())
            return
        self._answer_json(200, vars(button))

    def _input(self, body: bytes) -> None:
        answer = self._viewer.guest.post(
            "/ah/input", content=body, headers={"Content-Type": "application/json"}
        )
        self._answer(answer.status_code, answer.content, "application/json")

    def _pass(self, work: Callable[[], None]) -> None:
        import httpx

        try:
            work()
        except httpx.HTTPError as error:
            self._answer(502, f"the desktop does not answer: {error}".encode())

    def _is_allowed(self, token: str) -> bool:
        # The Host check keeps other web sites from reaching us through a name of their own (DNS
        # rebinding).
        host = self.headers.get("Host", "").rpartition(":")[0]
        if host in ("127.0.0.1", "localhost") and hmac.compare_digest(
            token.encode(), self._viewer.token.encode()
        ):
            return True
        self._answer(401, b"the address needs the token that `hijack desktop view` printed")
        return False

    def _answer_json(self, status: int, data: Any) -> None:
        self._answer(status, json.dumps(data).encode(), "application/json")

    def _answer(
        self,
        status: int,
        body: bytes,
        kind: str = "text/plain",
        extra_headers: dict[str, str] | None = None,
    ) -> None:
        self.send_response(status)
        headers = {
            "Content-Type": kind,
            "Content-Length": str(len(body)),
            "Cache-Control": "no-store",
            "Referrer-Policy": "no-referrer",
            "X-Content-Type-Options": "nosniff",
        } | (extra_headers or {})
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing: the address holds the token."""


def serve(
    record: dict[str, Any],
    port: int,
    say: Callable[[str], object],
    *,
    lasting: bool = True,
    buttons: ButtonPanel | None = None,
) -> None:
    """Show a desktop until Ctrl-C, in the user's browser if there is a display.

    `say` is called with the address, with what can be pressed, and at the end with whether the
    desktop goes on.
    """
    end = "the page, not the desktop" if lasting else "the page and its desktop"
    with Viewer(record, port, buttons) as viewer:
        say(f"watch desktop {record['id']} at {viewer.url}  (Ctrl-C ends {end})")
        with opened_page(viewer.url):
            if buttons is not None:
                say(
                    "in the page: press one of the buttons to corrupt the desktop, press it again"
                    " to take that back; mouse and keyboard go to the desktop"
                )
            try:
                viewer.serve_forever()
            except KeyboardInterrupt:
                say(
                    "the page has ended"
                    + ("; the desktop goes on" if lasting else ", and the desktop ends with it")
                )


@contextmanager
def opened_page(url: str) -> Generator[None]:
    """Open a page in the user's browser during the body; without a display, do nothing.

    The address holds a token, and other users see the arguments of a browser. So the browser gets a
    file that leads to the page and that nobody else can read.
    """
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        yield
        return
    with tempfile.TemporaryDirectory(prefix="agenthijack-") as folder:  # for this user alone
        file = Path(folder) / "desktop.html"
        file.write_text(f'<meta http-equiv="refresh" content="0;url={html.escape(url)}">')
        webbrowser.open(file.as_uri())
        yield
