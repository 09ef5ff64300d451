"""The address of a guest, and how long its answers may be."""

from dataclasses import dataclass
from urllib.parse import SplitResult, urlsplit

from ..errors import GuestError

MAX_PIXELS = 2**26  # of a screen, such as 8192x8192
# A raw frame, uint8 RGB, is the longest answer. A file or a video that is longer is refused.
MAX_ANSWER_BYTES = 3 * MAX_PIXELS


class AnswerTooLargeError(OSError):
    """A guest's answer is longer than any that it may give."""


@dataclass(frozen=True, kw_only=True)
class GuestAddress:
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


def split_address(url: str, owner: str, example: str) -> SplitResult:
    """Return the parts of the address of a server; it must not have a path.

    Args:
        url: such as `http://10.0.0.2:5000`; `http://` may be left out.
        owner: whose address it must be, for the error.
        example: an address that is right, for the error.

    Raises:
        GuestError: It is none.
    """
    problem = GuestError(f"{url!r} is not the address of a {owner}; it must be like {example}")
    try:
        parts = urlsplit(url if "//" in url else f"http://{url}")
        port = parts.port
    except ValueError:  # a port that is no number, half an IPv6 address
        raise problem from None
    is_server = parts.scheme in ("http", "https") and bool(parts.hostname) and port != 0
    # What is not sent, such as a name and a password, must not be left out in silence.
    has_more = parts.path.strip("/") or parts.query or parts.fragment or "@" in parts.netloc
    if not is_server or has_more:
        raise problem
    return parts
