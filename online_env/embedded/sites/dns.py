"""A DNS responder for a handful of names (RFC 1035): it answers from memory and asks nobody.

A query for one of our names gives our address, any other type of the same name an empty answer (so
that a browser falls back from AAAA and HTTPS records at once), any other name NXDOMAIN. A packet
that is not a query is dropped without an answer.
"""

import asyncio
import struct
from collections.abc import Collection
from ipaddress import IPv4Address
from typing import Any, cast

TTL = 5
MAX_LABEL = 63
MAX_NAME = 254
_A = 1
_ANY = 255
_IN = 1
_NO_ERROR = 0
_FORMAT_ERROR = 1
_NAME_ERROR = 3
_NOT_IMPLEMENTED = 4
_HEADER = struct.Struct("!6H")
_QUESTION = struct.Struct("!2H")
_RECORD = struct.Struct("!3HIH")
_RESPONSE = 0x8000
_OPCODE = 0x7800
_AUTHORITATIVE = 0x0400
_RECURSION_DESIRED = 0x0100
_RECURSION_AVAILABLE = 0x0080
_POINTER = 0xC000 | _HEADER.size  # back to the name in the question


def answer(packet: bytes, names: Collection[str], address: IPv4Address) -> bytes | None:
    """The reply to a packet; `None` if it deserves none (too short, or a response itself)."""
    if len(packet) < _HEADER.size:
        return None
    ident, flags, questions, *_ = _HEADER.unpack_from(packet)
    if flags & _RESPONSE:
        return None
    if flags & _OPCODE:
        return _reply(ident, flags, _NOT_IMPLEMENTED)
    end = _find_name_end(packet)
    if questions != 1 or end is None or end + _QUESTION.size > len(packet):
        return _reply(ident, flags, _FORMAT_ERROR)
    question = packet[_HEADER.size : end + _QUESTION.size]
    if _name(question) not in names:
        return _reply(ident, flags, _NAME_ERROR, question)
    kind, family = _QUESTION.unpack_from(packet, end)
    if kind not in (_A, _ANY) or family not in (_IN, _ANY):
        return _reply(ident, flags, _NO_ERROR, question)
    packed = address.packed
    record = _RECORD.pack(_POINTER, _A, _IN, TTL, len(packed)) + packed
    return _reply(ident, flags, _NO_ERROR, question, record)


def _find_name_end(packet: bytes) -> int | None:
    """Return where the name of the first question ends.

    `None` if it is cut short, too long or compressed.
    """
    position = _HEADER.size
    while position < len(packet):
        length = packet[position]
        position += 1 + length
        if length == 0:
            return position
        if length > MAX_LABEL or position - _HEADER.size > MAX_NAME:
            return None
    return None


def _name(question: bytes) -> str:
    labels: list[str] = []
    position = 0
    length = question[position]
    while length:
        start = position + 1
        position = start + length
        label = question[start:position].decode("latin-1")
        labels.append(label.replace(".", "\\."))  # a dot inside must not make two labels of it
        length = question[position]
    return ".".join(labels).lower()


def _reply(ident: int, flags: int, code: int, question: bytes = b"", record: bytes = b"") -> bytes:
    copied = flags & (_OPCODE | _RECURSION_DESIRED)
    set_here = _RESPONSE | _AUTHORITATIVE | _RECURSION_AVAILABLE
    header = _HEADER.pack(ident, set_here | copied | code, bool(question), bool(record), 0, 0)
    return header + question + record


class Responder(asyncio.DatagramProtocol):
    """`answer` on a UDP socket."""

    def __init__(self, names: Collection[str], address: IPv4Address) -> None:
        self._names = frozenset(names)
        self._address = address

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Keep the way back."""
        self._transport = cast(asyncio.DatagramTransport, transport)

    def datagram_received(self, data: bytes, addr: Any) -> None:
        """Answer a packet."""
        reply = answer(data, self._names, self._address)
        if reply is not None:
            self._transport.sendto(reply, addr)

    def error_received(self, exc: Exception) -> None:
        """Ignore a client that went away before its answer (ICMP)."""
