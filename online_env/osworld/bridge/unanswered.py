"""Notice requests that the guest leaves without an answer while OSWorld evaluates.

OSWorld's client only logs them, and takes a file that was not sent for one that is not there.
"""

from types import TracebackType
from typing import Any

import requests


class UnansweredError(Exception):
    """The guest did not answer a request on which a score may rest."""


class UnansweredRequests:
    """A context that notes requests to the guest's server that have no answer.

    An error of the server is an answer, and so is that to a later try of the same request.

    Args:
        server: The server's address, such as `http://10.0.0.5:5000`.
    """

    def __init__(self, server: str) -> None:
        self._origin = f"{server}/"
        self._send = requests.Session.send
        self._problems: dict[Any, str] = {}

    def __enter__(self) -> "UnansweredRequests":
        send, problems, origin = self._send, self._problems, self._origin

        def send_noting(
            self: requests.Session, request: requests.PreparedRequest, **kwargs: Any
        ) -> requests.Response:
            url = str(request.url)
            is_text = isinstance(request.body, str)  # the parts of others have random borders
            key = (request.method, url, request.body if is_text else None)
            try:
                response = send(self, request, **kwargs)
            except requests.RequestException as error:
                if url.startswith(origin):
                    path = url.removeprefix(origin)
                    problems[key] = f"{request.method} /{path}: {type(error).__name__}"
                raise
            problems.pop(key, None)
            return response

        requests.Session.send = send_noting
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        requests.Session.send = self._send

    def check(self, score: float) -> None:
        """Check that the guest answered all requests.

        Args:
            score: What OSWorld's evaluator made of the answers.

        Raises:
            UnansweredError: It did not.
        """
        if self._problems:
            listed = "; ".join(self._problems.values())
            raise UnansweredError(
                f"no answer of the guest to {listed}: a score of {score} may rest on that"
            )
