"""The way to a guest."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Way:
    """Where the server of a guest is reached.

    Attributes:
        host: its name or address.
        port: of its server.
        is_https: whether the connection is encrypted.
        source: the address of this machine that it leaves from, if that matters.
        door: a socket in the file system that leads there instead of the network.
    """

    host: str
    port: int
    is_https: bool
    source: str | None
    door: str | None
