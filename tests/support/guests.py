"""A guest server without a screen, in a thread, and what its errors look like."""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from support import needs

httpx = pytest.importorskip("httpx", reason=needs.ONLINE)
pytest.importorskip("starlette", reason=needs.ONLINE)

from online_env.embedded.guest.machine import GuestMachine  # noqa: E402
from online_env.embedded.guest.server import make_app  # noqa: E402

from support.loopback import served  # noqa: E402

TOKEN = "a secret"


@contextlib.contextmanager
def at_home(folder: Path) -> Iterator[None]:
    """Let `folder` be the user's home, in a session that has neither display nor bus."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HOME", str(folder))
        patch.setenv("PYTHONPATH", "/not/for/the/user")
        for name in ("DISPLAY", "DBUS_SESSION_BUS_ADDRESS"):
            patch.delenv(name, raising=False)
        yield


@contextlib.contextmanager
def guest_client(token: str | None = TOKEN, osworld: bool = False) -> Iterator[Any]:
    """A client of a guest server; it sends the token, if there is one."""
    headers = {} if token is None else {"X-Token": token}
    with (
        served(make_app(GuestMachine(), token, osworld)) as url,
        httpx.Client(
            base_url=url, headers=headers, timeout=60, verify=False, trust_env=False
        ) as client,
    ):
        yield client


def said(answer: Any) -> tuple[int, str]:
    """The status and the message of an error, which is under both names."""
    body = answer.json()
    assert body["status"] == "error"
    assert body["message"] == body["error"]
    return answer.status_code, body["message"]
