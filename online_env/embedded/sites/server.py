"""One process: DNS over UDP and the web server, on one address."""

import asyncio
import socket
from dataclasses import dataclass
from ipaddress import IPv4Address
from typing import NoReturn

import uvicorn

from .app import SitesApp
from .dns import Responder
from .hosts_and_dates import HOSTS
from .state import SiteState


@dataclass(frozen=True)
class Bound:
    """The two open sockets, and the ports that they really have (a port of 0 picks a free one)."""

    dns: socket.socket
    http: socket.socket

    @property
    def ports(self) -> tuple[int, int]:
        """`(dns, http)`."""
        return self.dns.getsockname()[1], self.http.getsockname()[1]


def bind(address: IPv4Address, dns_port: int, http_port: int) -> Bound:
    """Open both sockets.

    A `DesktopError` means that the address is not here, or a port is taken or forbidden.
    """
    dns = _open(socket.SOCK_DGRAM, address, dns_port, "DNS")
    try:
        http = _open(socket.SOCK_STREAM, address, http_port, "HTTP")
    except BaseException:
        dns.close()
        raise
    return Bound(dns, http)


def _open(kind: socket.SocketKind, address: IPv4Address, port: int, role: str) -> socket.socket:
    # Named, or asyncio does not know that it is TCP, leaves out TCP_NODELAY, and every page takes
    # 40 ms.
    protocol = socket.IPPROTO_TCP if kind == socket.SOCK_STREAM else socket.IPPROTO_UDP
    listener = socket.socket(socket.AF_INET, kind, protocol)
    try:
        if kind == socket.SOCK_STREAM:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((str(address), port))
        if kind == socket.SOCK_STREAM:
            listener.listen(128)
    except OSError as error:
        listener.close()
        _refuse(role, address, port, error)
    listener.setblocking(False)
    return listener


def _refuse(role: str, address: IPv4Address, port: int, error: OSError) -> NoReturn:
    from online_env.errors import DesktopError  # loads NumPy

    raise DesktopError(
        f"{role} of the local internet cannot listen on {address} port {port}: {error.strerror}; "
        "give another --address or port (ports below 1024 need root)"
    ) from error


def web_server(sites: SiteState) -> uvicorn.Server:
    """Return the web server of the sites, which has not begun."""
    config = uvicorn.Config(
        SitesApp(sites),
        http="h11",
        ws="none",
        lifespan="off",
        log_level="warning",
        access_log=False,
        server_header=False,
        date_header=False,
        timeout_graceful_shutdown=1,
    )
    return uvicorn.Server(config)


async def serve(sockets: Bound, address: IPv4Address, sites: SiteState) -> None:
    """Serve until SIGINT or SIGTERM. `address` is what DNS answers with."""
    loop = asyncio.get_running_loop()
    transport, _ = await loop.create_datagram_endpoint(
        lambda: Responder(HOSTS, address), sock=sockets.dns
    )
    try:
        await web_server(sites).serve(sockets=[sockets.http])
    finally:
        transport.close()
        sockets.http.close()
