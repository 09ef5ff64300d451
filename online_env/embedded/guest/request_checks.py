"""The checks that every request passes, and the answers to a wrong one.

The checks are the token and the limit on its size; the answers are JSON.
"""

import hmac
import json
from collections.abc import Mapping
from typing import Any

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ...errors import DesktopError, DesktopTimeoutError, GuestError

BODY_LIMIT = 64 * 2**20
OWN = "/ah/"
BAD_REQUEST = 400
NO_TOKEN = 401
TOO_LARGE = 413
FAILED = 500
TIMED_OUT = 504
_CLOSE = {"Connection": "close"}


class JsonAnswer(JSONResponse):
    """JSON in which names of files that are no text stay escaped, as in OSWorld's answers."""

    def render(self, content: Any) -> bytes:
        """Return the body."""
        try:
            return super().render(content)
        except UnicodeEncodeError:  # half of a surrogate pair
            return json.dumps(content).encode()


def problem(message: str, status: int, headers: Mapping[str, str] | None = None) -> JSONResponse:
    """An error as OSWorld's clients read it: the text is under `message` and under `error`."""
    body = {"status": "error", "message": message, "error": message}
    return JsonAnswer(body, status, dict(headers or {}))


class TokenMiddleware:
    """Lets a request pass that has the token.

    Without one (OSWorld's mode) it must not be for a route of ours.
    """

    def __init__(self, app: ASGIApp, token: str | None, osworld: bool) -> None:
        self._app = app
        self._token = token.encode() if token else None
        self._osworld = osworld

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one connection (ASGI); a body over the limit is a `GuestError`."""
        if scope["type"] != "http":
            return
        refusal = self._refusal(scope)
        if refusal is not None:
            await refusal(scope, receive, send)
            return
        read = 0

        async def limited() -> Message:
            nonlocal read
            message = await receive()
            read += len(message.get("body", b""))
            if read > BODY_LIMIT:
                raise GuestError(f"the body is larger than {BODY_LIMIT} bytes", TOO_LARGE)
            return message

        await self._app(scope, limited, send)

    def _refusal(self, scope: Scope) -> JSONResponse | None:
        headers = dict(scope["headers"])
        is_free = self._osworld and not scope["path"].startswith(OWN)
        if not is_free and not self._has_token(headers):
            message = (
                "a token is needed: send it as `Authorization: Bearer <token>` or as `X-Token`"
            )
            return problem(message, NO_TOKEN, {"WWW-Authenticate": "Bearer"})
        length = headers.get(b"content-length", b"0")
        if length.isdigit() and int(length[:20]) > BODY_LIMIT:
            return problem(f"the body is larger than {BODY_LIMIT} bytes", TOO_LARGE, _CLOSE)
        return None

    def _has_token(self, headers: Mapping[bytes, bytes]) -> bool:
        if self._token is None:
            return False
        token = headers.get(b"x-token", b"")
        scheme, _, credentials = headers.get(b"authorization", b"").partition(b" ")
        if scheme.lower() == b"bearer":
            token = credentials.strip()
        return hmac.compare_digest(token, self._token)


async def on_http(_: Request, error: Exception) -> JSONResponse:
    """Answer an unknown path, a wrong method or a form that can't be read."""
    if not isinstance(error, HTTPException):
        raise error
    return problem(str(error.detail), error.status_code, error.headers)


async def on_desktop(_: Request, error: Exception) -> JSONResponse:
    """Answer what a route refused or what failed in the desktop."""
    status = FAILED
    if isinstance(error, DesktopTimeoutError):
        status = TIMED_OUT
    elif isinstance(error, GuestError) and error.status:
        status = error.status
    headers = _CLOSE if status == TOO_LARGE else None
    return problem(str(error), status, headers)


async def on_value(_: Request, error: Exception) -> JSONResponse:
    """Answer a field with a wrong value."""
    return problem(str(error), BAD_REQUEST)


async def on_bug(request: Request, error: Exception) -> JSONResponse:
    """Answer any other failure; the traceback is in the server's log."""
    kind = type(error).__name__
    return problem(f"{request.url.path} failed: {kind}: {error}", FAILED)


HANDLERS: dict[Any, Any] = {
    HTTPException: on_http,
    DesktopError: on_desktop,
    ValueError: on_value,
    Exception: on_bug,
}
