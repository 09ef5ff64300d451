"""A virtual machine for `desktop_env`: an address that the controlling process gives out."""

import os
from collections.abc import Callable
from typing import Any

import requests

_Address = dict[str, Any]
PORTS = ("port", "chromium_port", "vnc_port", "vlc_port")
PATH = "agenthijack"


class Manager:
    """There is one machine, and it is not a file."""

    def get_vm_path(self, **_: Any) -> str:
        """Any text would do."""
        return PATH


class Provider:
    """Reverting means asking for another desktop; its address may differ every time."""

    def __init__(self, first: _Address, fresh: Callable[[], _Address]) -> None:
        self.address = first
        self.fresh = fresh
        trust(first)

    def start_emulator(self, path_to_vm: str, headless: bool, os_type: str | None = None) -> None:
        """It runs already."""

    def get_ip_address(self, path_to_vm: str) -> str:
        """Return `host:port:chromium:vnc:vlc`, as OSWorld's Docker provider does."""
        parts = [str(self.address[key]) for key in ("host", *PORTS)]
        return ":".join(parts)

    def revert_to_snapshot(self, path_to_vm: str, snapshot_name: str) -> str:
        """Replace the desktop by a pristine one."""
        self.address = self.fresh()
        trust(self.address)
        return path_to_vm

    def save_state(self, path_to_vm: str, snapshot_name: str) -> None:
        """Never called by a run."""
        raise NotImplementedError("this desktop can't save its state")

    def stop_emulator(self, path_to_vm: str, region: str | None = None) -> None:
        """The controlling process ends the desktop."""


def trust(address: _Address) -> None:
    """Reach the guest without a proxy, and send its token to it and to nobody else."""
    host = address["host"]
    direct = f"{host},localhost,127.0.0.1"
    os.environ["NO_PROXY"] = direct
    os.environ["no_proxy"] = direct
    _tokens.clear()
    token = address.get("token")
    if token:
        origin = f"http://{host}:{address['port']}/"
        _tokens[origin] = token


_tokens: dict[str, str] = {}
_send = requests.Session.send


def _send_with_token(
    self: requests.Session, request: requests.PreparedRequest, **options: Any
) -> requests.Response:
    for origin, token in _tokens.items():
        if str(request.url).startswith(origin):
            request.headers["Authorization"] = f"Bearer {token}"
    return _send(self, request, **options)


def send_tokens() -> None:
    """Make all requests to the guest carry its token from now on."""
    requests.Session.send = _send_with_token
