"""The HTTP connection to a guest."""

import json
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

from ..errors import GuestError
from ..extra import require
from .guest_address import AnswerTooLargeError, GuestAddress, split_address

if TYPE_CHECKING:
    from .client import Client

MAX_TRIES, PAUSE_S = 3, 0.3  # tries of requests that change nothing in the guest
PORT = 5000


@dataclass(frozen=True)
class GuestResponse:
    """An answer of the guest.

    Attributes:
        status: the HTTP status code.
        headers: the headers by lower-case names.
        body: its content.
    """

    status: int
    headers: Mapping[str, str]
    body: bytes | bytearray

    def json(self) -> dict[str, Any]:
        """The JSON object in the body; empty if it is not one."""
        try:
            value: object = json.loads(self.body)
        except (ValueError, RecursionError):
            return {}
        return cast("dict[str, Any]", value) if isinstance(value, dict) else {}

    @property
    def complaint(self) -> str:
        """The guest's own description of the problem."""
        fields = self.json()
        text = fields.get("message") or fields.get("error")
        if not text:
            text = self.body[:500].decode("utf-8", "replace")
        return str(text)[:2000]


class GuestConnection:
    """One persistent HTTP connection to a guest, whose users take turns.

    Redirects are not followed, and no proxy is used.

    Args:
        url: address of the guest; the port is 5000 if it is left out.
        token: sent with each request.
        timeout: seconds that connecting, and each wait for data, may take.
        source: the local address from which to connect; if the address disappears, so does the
            guest.
        restart_timeout: seconds for which a connection may be refused, for example while the server
            restarts.
        door: a socket in the file system that leads to the guest, used instead of the network.

    Raises:
        GuestError: The URL is not the address of a guest.
    """

    def __init__(
        self,
        url: str,
        token: str | None,
        timeout: float,
        source: str | None = None,
        restart_timeout: float = 0.0,
        door: str | None = None,
    ) -> None:
        parts = split_address(url, "guest", "http://10.0.0.2:5000")
        self.url = f"{parts.scheme}://{parts.netloc}"
        self._way = GuestAddress(
            host=parts.hostname or "",
            port=parts.port or PORT,
            is_https=parts.scheme == "https",
            source=source,
            door=door,
        )
        self._lock = threading.Lock()
        self._client: Client | None = None
        self._headers = {"Authorization": f"Bearer {token}"} if token else {}
        self._timeout = timeout
        self._restart_timeout = restart_timeout

    def close(self) -> None:
        """Close the connection; the next request opens it again."""
        with self._lock:
            if self._client is not None:
                self._client.close()
            self._client = None

    def ask(
        self,
        method: str,
        path: str,
        body: bytes | None = None,
        kind: str = "",
        timeout: float | None = None,
    ) -> GuestResponse:
        """Send a request and wait for the answer.

        A GET is repeated if the connection fails; other requests are not, since they may have been
        carried out. A request whose connection was refused has not been sent, and is repeated for
        up to `restart_timeout` seconds.

        Args:
            method: such as GET.
            path: with its query.
            body: content to send.
            kind: its media type.
            timeout: in seconds, instead of the connection's own.

        Raises:
            GuestError: There is no answer.
        """
        headers = self._headers | ({"Content-Type": kind} if kind else {})
        limit = timeout or self._timeout
        tries = MAX_TRIES if method == "GET" else 1
        end = time.monotonic() + self._restart_timeout
        attempt = 0
        while True:
            attempt += 1
            try:
                with self._lock:
                    return self._once(method, path, body, headers, limit)
            except TimeoutError:
                raise GuestError(
                    f"{method} {self.url}{path} was not answered within {limit:g} s"
                ) from None
            except AnswerTooLargeError as error:
                raise GuestError(f"{method} {self.url}{path}: {error}") from None
            except OSError as error:
                is_refused = isinstance(error, ConnectionRefusedError) and time.monotonic() < end
                if attempt >= tries and not is_refused:
                    raise GuestError(
                        f"{method} {self.url}{path} failed: {error or type(error).__name__}; does"
                        " the guest server run?"
                    ) from None
            time.sleep(PAUSE_S * min(attempt, MAX_TRIES))

    def _once(
        self, method: str, path: str, body: bytes | None, headers: dict[str, str], timeout: float
    ) -> GuestResponse:
        if self._client is None:
            require("a connection to a guest", ("urllib3",))
            from .client import Client  # urllib3 comes with the extra

            self._client = Client(self._way)
        status, response_headers, content = self._client.exchange(
            method, path, body, headers, timeout
        )
        return GuestResponse(status, response_headers, content)
