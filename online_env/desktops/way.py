"""The address of a guest."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Way:
    """The address at which a guest's server is reached.

    Attributes:
        host: its name or address.
        port: of its server.
        is_https: whether the connection is encrypted.
        source: the local address from which to connect, if that matters.
        door: a socket in the file system that is used instead of the network.
    """

    host: str
    port: int
    is_https: bool
    source: str | None
    door: str | None
