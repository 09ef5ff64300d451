"""The web server of the local internet: one ASGI application for all sites.

The Host header picks the site.
"""

import stat
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any, TypeAlias

from starlette.applications import Starlette
from starlette.responses import PlainTextResponse, Response
from starlette.staticfiles import StaticFiles

from .hosts import docs, forms, mail, news, search, shop, wiki
from .hosts_and_dates import host_name
from .pages import HERE
from .state import SiteState

AsgiScope: TypeAlias = MutableMapping[str, Any]
Receive: TypeAlias = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send: TypeAlias = Callable[[MutableMapping[str, Any]], Awaitable[None]]

MAX_BODY = 256 * 1024
_HEADERS = [
    (
        b"content-security-policy",
        (
            b"default-src 'self'; style-src 'self' 'unsafe-inline'; form-action 'self'; base-uri"
            b" 'none'; frame-src 'none'"
        ),
    ),
    (b"x-content-type-options", b"nosniff"),
    # A page from the cache would hide that the network is gone.
    (b"cache-control", b"no-store"),
]


class SitesApp:
    """Serves every site of `HOSTS`.

    An unknown name gets 421, a body beyond `MAX_BODY` bytes 413.
    """

    def __init__(self, sites: SiteState) -> None:
        makers = (search, shop, docs, mail, forms, wiki, news)
        self._sites: dict[str, Starlette] = {module.HOST: module.make(sites) for module in makers}
        self._static = StaticFiles(directory=HERE / "static")

    async def __call__(self, scope: AsgiScope, receive: Receive, send: Send) -> None:
        """Serve one request (ASGI)."""
        if scope["type"] != "http":
            return
        body = await _read_body(scope, receive)
        app = Response(status_code=413) if body is None else self._pick(scope)
        await app(scope, _replay(body or b"", receive), _with_headers(send))

    def _pick(self, scope: AsgiScope) -> Any:
        host = dict(scope["headers"]).get(b"host", b"").decode("latin-1")
        app = self._sites.get(host_name(host))
        if app is None:
            return PlainTextResponse("No such site is served here.\n", 421)
        if scope["path"] == "/generate_204" and scope["method"] in ("GET", "HEAD"):
            return Response(status_code=204)
        if scope["path"].startswith("/static/"):
            scope["root_path"] = "/static"
            return _Static(self._static, app)
        return app


class _Static:
    """Static files, and the site's own page where there is no such file."""

    def __init__(self, files: StaticFiles, site: Starlette) -> None:
        self._files = files
        self._site = site

    async def __call__(self, scope: AsgiScope, receive: Receive, send: Send) -> None:
        path = self._files.get_path(scope)
        file_path = (
            "\0" not in path
            and (status := self._files.lookup_path(path)[1])
            and stat.S_ISREG(status.st_mode)
        )
        if file_path and scope["method"] in ("GET", "HEAD"):
            await self._files(scope, receive, send)
        else:
            scope["root_path"] = ""
            await self._site(scope, receive, send)


async def _read_body(scope: AsgiScope, receive: Receive) -> bytes | None:
    """Return the body of a request, or `None` for one beyond `MAX_BODY`."""
    length = dict(scope["headers"]).get(b"content-length", b"0")
    if not length.isdigit() or len(length) > 12 or int(length) > MAX_BODY:
        return None
    body = bytearray()
    while True:
        message = await receive()
        body += message.get("body", b"")
        if len(body) > MAX_BODY:
            return None
        if message["type"] != "http.request" or not message.get("more_body", False):
            return bytes(body)


def _replay(body: bytes, receive: Receive) -> Receive:
    waiting = [{"type": "http.request", "body": body, "more_body": False}]

    async def again() -> MutableMapping[str, Any]:
        return waiting.pop() if waiting else await receive()

    return again


def _with_headers(send: Send) -> Send:
    async def sender(message: MutableMapping[str, Any]) -> None:
        if message["type"] == "http.response.start":
            headers = [
                (k, v)
                for k, v in message["headers"]
                if k.lower() not in (b"cache-control", b"etag", b"last-modified")
            ]
            message = {**message, "headers": [*headers, *_HEADERS]}
        await send(message)

    return sender
