"""A port of this machine that relays DevTools clients to a Chromium, and knows when they go."""

import contextlib
import re
import socket
import threading
from collections.abc import Callable
from socketserver import BaseRequestHandler, ThreadingTCPServer

HOST = "127.0.0.1"
CHUNK_BYTES = 1 << 16
_MAX_HEAD_BYTES = 1 << 16
_UPGRADE = re.compile(rb"^upgrade:[ \t]*websocket", re.I | re.M)


class CdpRelay:
    """Listens on the loopback interface; `address` is what clients connect to.

    Args:
        get_port: Returns the port of the Chromium of this moment; it may wait for it.
        port: The port to listen on; 0 for a free one.

    Raises:
        OSError: The port is in use.
    """

    def __init__(self, get_port: Callable[[], int], port: int = 0) -> None:
        self.clients_left = threading.Event()  # set when the last websocket has ended
        self._get_port = get_port
        self._lock = threading.Lock()
        self._clients = 0
        relay = self

        class Handler(BaseRequestHandler):
            """One connection."""

            def handle(self) -> None:
                """Relay until one side ends."""
                relay._relay(self.request)

        class Server(ThreadingTCPServer):
            """Ends without waiting for its connections."""

            daemon_threads = True
            allow_reuse_address = True
            block_on_close = False

        self._server = Server((HOST, port), Handler)
        self.address = f"http://{HOST}:{self._server.server_address[1]}"
        self._thread = threading.Thread(
            target=self._server.serve_forever, args=(0.05,), name="cdp-relay", daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        """Stop listening."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    def _relay(self, client: socket.socket) -> None:
        head = b""
        while b"\r\n\r\n" not in head and len(head) < _MAX_HEAD_BYTES:
            data = _receive(client)
            if not data:
                return
            head += data
        is_session = _UPGRADE.search(head) is not None
        if is_session:
            with self._lock:
                self._clients += 1
        try:
            with socket.create_connection((HOST, self._get_port())) as chromium:
                chromium.sendall(head)
                answers = threading.Thread(target=_copy, args=(chromium, client), daemon=True)
                answers.start()
                _copy(client, chromium)
                answers.join()
        except OSError:
            return
        finally:
            if is_session:
                with self._lock:
                    self._clients -= 1
                    if not self._clients:
                        self.clients_left.set()


def _receive(source: socket.socket) -> bytes:
    """Return the next bytes; none at the end, also where the other side broke off."""
    try:
        return source.recv(CHUNK_BYTES)
    except OSError:
        return b""


def _copy(source: socket.socket, target: socket.socket) -> None:
    """Copy bytes until one side ends, then end both."""
    with contextlib.suppress(OSError):
        while data := _receive(source):
            target.sendall(data)
    for end in (source, target):
        with contextlib.suppress(OSError):
            end.shutdown(socket.SHUT_RDWR)
