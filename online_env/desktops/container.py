"""Reset a container that is a desktop, for `HttpDesktop` (docs/desktop_image.md)."""

import json
import urllib.error
import urllib.request
from urllib.parse import urlsplit

from ..errors import DesktopError, GuestError
from .protocol import TaskConfig

CONTROL_PORT = 5001
PATIENCE = 120.0  # s for a reset


class ContainerResetter:
    """Asks a container for a fresh home and session: the `resetter` of an `HttpDesktop`.

    Args:
        url: the address of the container's port 5001, such as `http://127.0.0.1:5001`; 5001 is the
            default port.
        token: the token with which the container was started.
        timeout: seconds that a reset may take.
    """

    def __init__(
        self,
        url: str,
        token: str,
        timeout: float = PATIENCE,
    ) -> None:
        parts = urlsplit(url if "//" in url else f"http://{url}")
        self._url = f"http://{parts.hostname}:{parts.port or CONTROL_PORT}/reset"
        self._token = token
        self._timeout = timeout

    def __call__(self, task: TaskConfig | None = None) -> None:
        """Make the desktop pristine; the runner sets up the task itself.

        Raises:
            DesktopError: That is not possible; the message has the reason and the remedy.
            GuestError: The container does not answer, or the token is wrong.
        """
        request = urllib.request.Request(
            self._url,
            method="POST",
            data=b"",
            headers={"X-Token": self._token},
        )
        try:
            with urllib.request.urlopen(request, timeout=self._timeout) as answer:
                answer.read()
        except urllib.error.HTTPError as error:
            text = error.read().decode("utf-8", "replace")
            if error.code == 500:
                raise DesktopError(json.loads(text)["error"]) from None
            raise GuestError(f"{self._url}: {error.code} {error.reason}") from None
        except OSError as error:
            raise GuestError(f"{self._url}: no reset ({error}); does the container run?") from None
