"""Reset a container that is a desktop, for `HttpDesktop` (docs/embedded_desktop.md)."""

import urllib.error
import urllib.request
from http.client import HTTPException
from typing import Any

from ..errors import DesktopError, GuestError
from .connection import GuestResponse
from .guest_address import split_address
from .protocol import TaskConfig

CONTROL_PORT = 5001
RESET_TIMEOUT_S = 120.0  # s for a reset
SERVER_ERROR = 500


class ContainerResetter:
    """Asks a container for a fresh home and session: the `resetter` of an `HttpDesktop`.

    Args:
        url: the address of the container's port 5001, such as `http://127.0.0.1:5001`; 5001 is the
            default port.
        token: the token with which the container was started.
        timeout: seconds that a reset may take.

    Redirects are not followed, and no proxy is used: the token is for the container alone.

    Raises:
        GuestError: The URL is not the address of a container.
    """

    def __init__(self, url: str, token: str, timeout: float = RESET_TIMEOUT_S) -> None:
        parts = split_address(url, "container", "http://127.0.0.1:5001")
        name = parts.hostname or ""
        host = f"[{name}]" if ":" in name else name
        self._url = f"{parts.scheme}://{host}:{parts.port or CONTROL_PORT}/reset"
        self._token = token
        self._timeout = timeout

    def __call__(self, task: TaskConfig | None = None) -> None:
        """Make the desktop pristine; the runner sets up the task itself.

        Raises:
            DesktopError: That is not possible; the message has the reason and the remedy.
            GuestError: The container does not answer, or the token is wrong.
        """
        request = urllib.request.Request(
            self._url, method="POST", data=b"", headers={"X-Token": self._token}
        )
        try:
            with _DIRECT_OPENER.open(request, timeout=self._timeout) as answer:
                answer.read()
        except urllib.error.HTTPError as error:
            reply = GuestResponse(error.code, {}, error.read())
            if error.code == SERVER_ERROR and reply.complaint:
                raise DesktopError(reply.complaint) from None
            raise GuestError(f"{self._url}: {error.code} {error.reason}", error.code) from None
        except (OSError, HTTPException) as error:
            raise GuestError(f"{self._url}: no reset ({error}); does the container run?") from None


class _NoRedirect(urllib.request.HTTPRedirectHandler):
    def redirect_request(self, *_: Any, **__: Any) -> None:
        """Leave the answer as it is: it becomes an error."""


_DIRECT_OPENER = urllib.request.build_opener(urllib.request.ProxyHandler({}), _NoRedirect)
