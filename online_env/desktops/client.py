"""HTTP over urllib3, with its errors converted to those of the operating system."""

import socket
from collections.abc import Mapping
from functools import partial
from typing import Any, cast

import urllib3
from urllib3.connection import HTTPConnection
from urllib3.exceptions import HTTPError, NewConnectionError, ProtocolError

from .guest_address import MAX_ANSWER_BYTES, MAX_PIXELS, AnswerTooLargeError, GuestAddress

CHUNK_BYTES = 2**20

Exchange = tuple[int, Mapping[str, str], bytes | bytearray]


class _SocketFileConnection(HTTPConnection):
    """A connection over a socket in the file system."""

    def __init__(self, *args: Any, door: str, **options: Any) -> None:
        super().__init__(*args, **options)
        self._door = door

    def _new_conn(self) -> socket.socket:
        connection = socket.socket(socket.AF_UNIX)
        connection.settimeout(cast("float | None", self.timeout))
        try:
            connection.connect(self._door)
        except OSError as error:
            connection.close()
            raise NewConnectionError(self, f"{error}") from error
        return connection


class Client:
    """One persistent connection, for one request at a time.

    Redirects are not followed, no proxy is used, and content is not decompressed.
    """

    def __init__(self, way: GuestAddress) -> None:
        is_https = way.is_https and way.door is None
        kind = urllib3.HTTPSConnectionPool if is_https else urllib3.HTTPConnectionPool
        source = (way.source, 0) if way.source else None
        self._pool = kind(way.host, way.port, maxsize=1, source_address=source)
        if way.door is not None:
            self._pool.ConnectionCls = cast(Any, partial(_SocketFileConnection, door=way.door))

    def close(self) -> None:
        """Close the connection."""
        self._pool.close()

    def exchange(
        self, method: str, path: str, body: bytes | None, headers: dict[str, str], timeout: float
    ) -> Exchange:
        """Send a request and read the answer.

        Returns:
            The status, the headers by lower-case names, and the body.

        Raises:
            OSError: There is no answer; a `TimeoutError` if it is late, an `AnswerTooLargeError` if
                it has more than `MAX_ANSWER_BYTES` bytes.
        """
        try:
            response = self._pool.urlopen(
                method,
                path,
                body,
                headers,
                retries=False,
                redirect=False,
                timeout=timeout,
                preload_content=False,
                decode_content=False,
            )
            content = _read(response)
        except HTTPError as error:
            os_error = _plain(error)
            raise os_error from None
        names = {name.lower(): value for name, value in response.headers.items()}
        return response.status, names, content


def _read(response: urllib3.BaseHTTPResponse) -> bytes | bytearray:
    try:
        return _read_body(response)
    # also after an interrupt: the rest of a half-read answer must not be taken for the next answer
    except BaseException:
        response.close()
        raise
    finally:
        response.release_conn()


def _read_body(response: urllib3.BaseHTTPResponse) -> bytes | bytearray:
    """Return the body, read into its final buffer, so that a frame becomes an array without a copy.

    Raises:
        AnswerTooLargeError: The body is too long.
        ProtocolError: The body is cut short.
    """
    length = response.length_remaining
    if length is None:
        content = response.read(MAX_ANSWER_BYTES + 1)
        _check_length(len(content))
        return content
    _check_length(length)
    body = bytearray(length)
    count = 0
    while count < length:
        data = response.read1(CHUNK_BYTES)
        if not data:
            raise ProtocolError(f"the answer ended after {count} of {length} bytes")
        body[count : count + len(data)] = data
        count += len(data)
    return body


def _check_length(length: int) -> None:
    if length > MAX_ANSWER_BYTES:
        raise AnswerTooLargeError(
            f"the answer has more than {MAX_ANSWER_BYTES} bytes, which a screen of"
            f" {MAX_PIXELS} pixels takes: nothing longer is read"
        )


def _plain(error: HTTPError) -> OSError:
    """Return the operating system's error behind one of urllib3, or one with the same text."""
    cause: object = error.__cause__ or error
    if isinstance(error, ProtocolError) and len(error.args) > 1:
        cause = error.args[1]
    if isinstance(cause, urllib3.exceptions.TimeoutError):
        return TimeoutError(str(cause))
    if isinstance(cause, OSError):
        return cause
    return OSError(str(cause) or type(cause).__name__)
