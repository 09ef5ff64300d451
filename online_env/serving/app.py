"""The web application: OpenEnv's routes, the token, `/health` and `/metrics`."""

import hmac
import ipaddress
from collections.abc import Iterable
from functools import partial
from urllib.parse import urlsplit

from openenv.core.env_server.http_server import create_app  # pyright: ignore[reportMissingImports]
from openenv.core.env_server.types import ConcurrencyConfig  # pyright: ignore[reportMissingImports]
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from hijack_data.errors import HijackError

from .errors import ServerBusyError
from .limits import RequestLimits
from .openenv_env import NAME, DesktopAction, DesktopEnvironment, DesktopObservation, DesktopState
from .service import DesktopService

HEALTH = "/health"
METRICS = "/metrics"
PROMETHEUS = "text/plain; version=0.0.4; charset=utf-8"
SESSION_TIMEOUT_LEASES = 4  # number of leases after which OpenEnv ends a session without a desktop
MIN_SESSION_TIMEOUT_S = 3600.0  # seconds
CLOSE_UNAUTHORIZED = 4401  # the close code for a WebSocket without the token


def make_app(service: DesktopService, *, sessions: int, token: str | None) -> ASGIApp:
    """Return the application of a server.

    Args:
        service: What the sessions share.
        sessions: How many clients may be connected at a time.
        token: The token that clients must send; without one only programs of this machine are
            answered.
    """
    app = create_app(
        partial(DesktopEnvironment, service),
        DesktopAction,
        DesktopObservation,
        env_name=NAME,
        state_cls=DesktopState,
        concurrency_config=ConcurrencyConfig(
            max_concurrent_envs=sessions,
            session_timeout=max(MIN_SESSION_TIMEOUT_S, SESSION_TIMEOUT_LEASES * service.lease),
        ),
    )

    async def health(_: Request) -> Response:
        return _health(service)

    async def metrics(_: Request) -> Response:
        return Response(service.metrics.text(), media_type=PROMETHEUS)

    # Placed before OpenEnv's own route, which would call a server without a desktop healthy.
    app.router.routes.insert(0, Route(HEALTH, health))
    app.router.routes.insert(0, Route(METRICS, metrics))
    app.add_exception_handler(HijackError, _answer_error)
    return AccessGuard(RequestLimits(app), token)


def _health(service: DesktopService) -> Response:
    counts = service.pool.counts()
    is_healthy = counts.free + counts.lent > 0
    content = {
        "status": "healthy" if is_healthy else "unhealthy",
        "desktops": {"free": counts.free, "lent": counts.lent, "starting": counts.starting},
        "waiting": counts.waiting,
    }
    return JSONResponse(content, 200 if is_healthy else 503)


async def _answer_error(_: Request, error: Exception) -> Response:
    """Answer OpenEnv's HTTP routes, which do not support sessions, with the error."""
    if isinstance(error, ServerBusyError):
        headers = {"Retry-After": str(error.retry_after)}
        return JSONResponse({"detail": str(error)}, 503, headers)
    return JSONResponse({"detail": str(error)}, 400)


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
