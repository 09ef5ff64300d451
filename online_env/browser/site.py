"""A site of this machine's that serves a folder to one browser, under a host name of its own."""

import threading
from collections.abc import Iterable
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

# Chromium takes pages that name no encoding for Windows-1252.
_TYPES = {
    **SimpleHTTPRequestHandler.extensions_map,
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
}


class _Handler(SimpleHTTPRequestHandler):
    extensions_map = _TYPES

    def log_message(self, format: str, *args: Any) -> None:
        """Print nothing."""

    def end_headers(self) -> None:
        """Let no browser keep a page: a page that was kept would outlive a network error."""
        self.send_header("Cache-Control", "no-store")
        super().end_headers()


def resolver_arguments(hosts: Iterable[str], port: int) -> tuple[str, ...]:
    """Return the arguments of a browser that finds some hosts at 127.0.0.1, and nothing else.

    Args:
        hosts: Their names.
        port: Where they are served.
    """
    rules = [f"MAP {host}:80 127.0.0.1:{port}" for host in hosts]
    return (f"--host-resolver-rules={', '.join([*rules, 'MAP * ~NOTFOUND'])}",)


class FolderSite:
    """Serves the files of a folder as `http://HOST/`, for the browser that gets `arguments`.

    That browser resolves no other name, so pages reach nothing but this folder.

    Args:
        host: The name of the site.
        folder: The folder, which may be set later.
    """

    def __init__(self, host: str, folder: Path | None = None) -> None:
        self.folder = folder
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), self._handle)
        self._thread = threading.Thread(
            target=self._server.serve_forever, args=(0.05,), name="site", daemon=True
        )
        self._thread.start()
        self.host = host

    @property
    def port(self) -> int:
        """The port at 127.0.0.1 where other browsers find the folder."""
        return self._server.server_address[1]

    @property
    def arguments(self) -> tuple[str, ...]:
        """Return the arguments of the browser's command line."""
        return resolver_arguments([self.host], self.port)

    def url(self, path: str) -> str:
        """Return the address of a file of the folder."""
        return f"http://{self.host}/{path}"

    def _handle(self, *request: Any) -> _Handler:
        """Answer a request from the folder of this moment."""
        return _Handler(*request, directory=str(self.folder or "/nonexistent"))

    def close(self) -> None:
        """End the site."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()
