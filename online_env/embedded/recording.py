"""Recording a desktop to a video, with the guest server's recorder."""

import contextlib
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import GuestError

if TYPE_CHECKING:
    import httpx

# Encoding goes on for a while after a long recording.
RECORD_TIMEOUT_S = 120.0


def guest_client(record: dict[str, Any], timeout: float = 20.0) -> "httpx.Client":
    """An HTTP client of a desktop's guest server, with its token; `timeout` is in seconds."""
    import httpx

    secret = Path(record["token_file"]).read_text(encoding="ascii")
    way = httpx.HTTPTransport(uds=record["door"])
    return httpx.Client(
        base_url=record["guest"], headers={"X-Token": secret}, timeout=timeout, transport=way
    )


def record(record: dict[str, Any], seconds: float | None) -> bytes:
    """Record for `seconds`, or until Ctrl-C.

    Returns:
        The MP4.

    Raises:
        GuestError: The guest cannot record.
    """
    import httpx

    with guest_client(record, RECORD_TIMEOUT_S) as client:
        try:
            _ask(client, "/start_recording")
            with contextlib.suppress(KeyboardInterrupt):
                time.sleep(86400.0 if seconds is None else seconds)
            return _ask(client, "/end_recording")
        except httpx.HTTPError as error:
            raise GuestError(f"desktop {record['id']} does not answer: {error}") from None


def _ask(client: "httpx.Client", path: str) -> bytes:
    answer = client.post(path)
    if answer.status_code != 200:
        raise GuestError(
            f"{path} answered {answer.status_code}: {answer.text[:500]}", answer.status_code
        )
    return answer.content
