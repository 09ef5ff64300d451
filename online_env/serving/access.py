"""Who may use a server: the token of HTTP requests, and sockets that listen for them."""

import hmac
import ipaddress
import os
import socket
import stat
from collections.abc import Iterable
from pathlib import Path
from urllib.parse import urlsplit

from starlette.responses import PlainTextResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from hijack_data.errors import ParameterError

HEALTH = "/health"  # answered without a token
CLOSE_UNAUTHORIZED = 4401  # the close code for a WebSocket without the token
MIN_TOKEN_CHARS = 16  # least characters of a token


class AccessGuard:
    """Admits clients with the token; without a token, programs of this machine but no web page.

    A page in a browser of this machine could reach the server as well. Browsers send the page in
    the header `Origin`, and the requested host in `Host`.

    Args:
        app: The guarded application.
        token: The token, or `None`.
    """

    def __init__(self, app: ASGIApp, token: str | None) -> None:
        self._app = app
        self._expected = None if token is None else f"Bearer {token}".encode()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse a request, or pass it on."""
        if scope["type"] not in ("http", "websocket") or scope.get("path") == HEALTH:
            await self._app(scope, receive, send)
            return
        refusal = self._refusal(scope["headers"])
        if not refusal:
            await self._app(scope, receive, send)
            return
        answer = PlainTextResponse(f"{refusal}\n", 403 if self._expected is None else 401)
        if scope["type"] == "http":
            await answer(scope, receive, send)
        else:
            await _refuse_socket(scope, receive, send, answer)

    def _refusal(self, headers: Iterable[tuple[bytes, bytes]]) -> str:
        """Return why a request is refused; empty if it is allowed."""
        values = dict(headers)
        if self._expected is not None:
            authorization = values.get(b"authorization", b"")
            if hmac.compare_digest(authorization, self._expected):
                return ""
            return "the token is missing or wrong: send the header Authorization: Bearer TOKEN"
        if b"origin" in values or not is_loopback(_read_host(values.get(b"host", b""))):
            return "without a token, only programs of this machine are answered, and no web page"
        return ""


def _read_host(header: bytes) -> str:
    """Return the name or address in a header `Host`; "" if there is none."""
    try:
        return urlsplit(f"//{header.decode('latin-1')}").hostname or ""
    except ValueError:  # half an IPv6 address
        return ""


def is_loopback(host: str) -> bool:
    """Return whether a name or an address means this machine itself."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


async def _refuse_socket(scope: Scope, receive: Receive, send: Send, answer: Response) -> None:
    """Refuse a WebSocket: by an HTTP answer if the web server can, else by closing it."""
    if "websocket.http.response" in scope.get("extensions", {}):

        async def renamed(message: Message) -> None:
            await send({**message, "type": f"websocket.{message['type']}"})

        await answer({**scope, "type": "http"}, receive, renamed)
        return
    await send({"type": "websocket.close", "code": CLOSE_UNAUTHORIZED})


def read_token(file: Path | None, variable: str) -> str | None:
    """Return the token of a file or of an environment variable, and remove it from the latter.

    Desktops are started by this process: they would inherit the variable.

    Raises:
        ParameterError: The file cannot be read, others may read it, or the token is too short.
    """
    token = os.environ.pop(variable, None)
    source = variable
    if file is not None:
        source = str(file)
        try:
            mode = file.stat().st_mode
            token = file.read_text(encoding="utf-8").strip()
        except (OSError, UnicodeError) as error:
            reason = getattr(error, "strerror", None) or "it is no text"
            raise ParameterError(f"--token-file {file}: cannot be read: {reason}") from None
        if stat.S_IMODE(mode) & 0o077:
            raise ParameterError(f"--token-file {file}: others may read it; chmod 600 {file}")
    if token is None:
        return None
    if (
        len(token) < MIN_TOKEN_CHARS
        or not token.isascii()
        or not token.isprintable()
        or " " in token
    ):
        raise ParameterError(
            f"{source}: a token is at least {MIN_TOKEN_CHARS} printable characters without spaces,"
            " such as: openssl rand -hex 32"
        )
    return token


def bind(host: str, port: int) -> socket.socket:
    """Return a socket at an address; nobody is answered yet.

    Raises:
        ParameterError: The address is taken, or does not belong to this machine.
    """
    try:
        addresses = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
        family, kind, protocol, _, address = addresses[0]
        listener = socket.socket(family, kind, protocol)
    except OSError as error:
        raise ParameterError(f"--host {host}: {error}") from None
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
    except OSError as error:
        listener.close()
        raise ParameterError(f"--host {host} --port {port}: {error}") from None
    return listener
