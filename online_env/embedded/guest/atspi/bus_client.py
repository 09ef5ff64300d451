"""Thousands of D-Bus calls in flight at once (D-Bus specification 1.0, "Message Protocol").

Applications on GTK, LibreOffice and Chromium can be asked directly, which spares the bus's daemon
two messages a call: a third of the processor time of reading a spreadsheet.

jeepney opens the connection. Its general marshalling takes 0.1 ms a call, most of the time of
reading a tree, so the few signatures of AT-SPI are read here directly: little endian, replies only.
For one tree of 3,300 nodes (the cache, and the place of each) this takes 68 ms, jeepney 640 ms and
dbus-fast, although compiled, 70 ms; with the other questions a tree needs, less than half of
dbus-fast's time.
"""

import select
import socket
import struct
import time
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from jeepney.bus import get_bus
from jeepney.io.blocking import DBusConnection, open_dbus_connection, prep_socket

from ....errors import DesktopError

IN_FLIGHT = 96  # calls to one application
GREETING = 0.5  # s that an application has to let us in
METHOD_RETURN = 2
ERROR = 3
REPLY_SERIAL = 5
_HEADER = struct.Struct("<BBBBIII")
_UINT = struct.Struct("<I")
_DOUBLE = struct.Struct("<d")

Reference = tuple[str, str]  # bus name, object path


class Cursor:
    """A place in the body of a reply; alignment counts from the start of the body."""

    __slots__ = ("data", "end", "position", "start")

    def __init__(self, data: bytes | bytearray, start: int, end: int) -> None:
        self.data = data
        self.start = start
        self.position = start
        self.end = end

    def align(self, size: int) -> None:
        """Go on to the next multiple of `size`."""
        self.position += -(self.position - self.start) % size

    def uint(self) -> int:
        """Read a 32-bit unsigned integer."""
        self.position += -(self.position - self.start) & 3
        value: int = _UINT.unpack_from(self.data, self.position)[0]
        self.position += 4
        return value

    def sint(self) -> int:
        """Read a 32-bit signed integer."""
        value = self.uint()
        return value - (value >> 31 << 32)

    def text(self) -> str:
        """Read a string or an object path."""
        length = self.uint()
        start = self.position
        self.position = start + length + 1
        return self.data[start : start + length].decode("utf-8", "replace")

    def reference(self) -> Reference:
        """Read `(so)`."""
        self.position += -(self.position - self.start) & 7
        return self.text(), self.text()

    def array(self, alignment: int) -> int:
        """Read an array's length and return where it ends."""
        length = self.uint()
        self.align(alignment)
        return self.position + length

    def variant(self) -> Any:
        """Read a variant that holds a text, a path, a number or a reference; otherwise None."""
        length = self.data[self.position]
        signature = self.data[self.position + 1 : self.position + 1 + length].decode(
            "ascii", "replace"
        )
        self.position += length + 2
        if signature in ("s", "o"):
            return self.text()
        if signature == "(so)":
            return self.reference()
        if signature == "i":
            return self.sint()
        if signature == "u":
            return self.uint()
        if signature == "d":
            self.align(8)
            self.position += 8
            return _DOUBLE.unpack_from(self.data, self.position - 8)[0]
        self.position = self.end
        return None


@dataclass(frozen=True, eq=False)
class Method:
    """A method with fixed arguments (`body`, marshalled) and the way to read its answer."""

    interface: str
    member: str
    read: Callable[[Cursor], Any]
    signature: str = ""
    body: bytes = b""
    heads: dict[str, bytes] = field(default_factory=dict[str, bytes])

    def message(self, reference: Reference, serial: int) -> bytes:
        """Return the call as bytes.

        The path comes last, so that the rest is made once for each application.
        """
        name, path = reference
        head = self.heads.get(name)
        if head is None:
            fields = [
                _text_field(6, b"s", name),
                _text_field(2, b"s", self.interface),
                _text_field(3, b"s", self.member),
            ]
            if self.signature:
                signature = self.signature.encode()
                fields.append(_pad(b"\x08\x01g\0" + bytes((len(signature),)) + signature + b"\0"))
            if len(self.heads) > 256:
                self.heads.clear()
            head = self.heads[name] = b"".join(fields)
        encoded = path.encode()
        last = b"\x01\x01o\0" + _UINT.pack(len(encoded)) + encoded + b"\0"
        size = len(head) + len(last)
        return (
            _HEADER.pack(0x6C, 1, 0, 1, len(self.body), serial, size)
            + head
            + _pad(last)
            + self.body
        )


def _pad(data: bytes) -> bytes:
    return data + b"\0" * (-len(data) % 8)


def _text_field(code: int, kind: bytes, value: str) -> bytes:
    encoded = value.encode()
    return _pad(bytes((code, 1)) + kind + b"\0" + _UINT.pack(len(encoded)) + encoded + b"\0")


_Call = tuple[Reference, Method]


class _Channel:
    """A socket that D-Bus messages come from: of an application, or of the bus, without a name."""

    def __init__(self, connection: socket.socket, name: str = "") -> None:
        self.socket = connection
        self.name = name
        self._buffer = bytearray()

    def fileno(self) -> int:
        """Return the descriptor, for `select`."""
        return self.socket.fileno()

    def replies(self) -> Iterator[tuple[int, Cursor | None]]:
        """Yield the serial and the body of each reply that has come; errors have no body.

        Raises:
            EOFError: The other side has closed the connection.
        """
        data = self.socket.recv(1 << 18)
        if not data:
            raise EOFError("the other side has closed the connection")
        buffer = self._buffer
        buffer += data
        position = 0
        while len(buffer) - position >= 16:
            _, kind, _, _, body, _, fields = _HEADER.unpack_from(buffer, position)
            start = position + 16 + fields + -fields % 8
            if len(buffer) < start + body:
                break
            if kind in (METHOD_RETURN, ERROR):
                serial = _reply_serial(buffer, position + 16, position + 16 + fields)
                cursor = Cursor(buffer, start, start + body)
                yield serial, cursor if kind == METHOD_RETURN else None
            position = start + body
        del buffer[:position]


class BusClient:
    """A connection to a bus, and to those applications on it that take calls directly.

    An application that does not answer for `timeout` seconds, or is not done `budget` seconds
    after `begin`, is left alone from then on: it is in `silent`.
    """

    def __init__(self, address: str, timeout: float, budget: float) -> None:
        self._connection: DBusConnection = open_dbus_connection(address)
        self._bus = _Channel(self._connection.sock)
        self._direct: dict[str, _Channel] = {}
        self._patience = timeout
        self._budget = budget
        self._end = 0.0
        self._serial = 1000  # jeepney counts from 1 and makes a few calls only
        self.silent: set[str] = set()

    def begin(self) -> None:
        """Forget who was silent and start the budget of time."""
        self.silent.clear()
        self._end = time.monotonic() + self._budget

    def close(self) -> None:
        """Close the connections."""
        self.keep(())
        self._connection.close()

    def connect(self, name: str, address: str) -> None:
        """Ask the application `name` at `address` from now on, if it lets us in."""
        try:
            self._direct[name] = _Channel(prep_socket(get_bus(address), timeout=GREETING), name)
        except (OSError, RuntimeError, ValueError, StopIteration):
            return

    def is_direct(self, name: str) -> bool:
        """Return whether an application is asked directly, so it is on AT-SPI's bridge for ATK."""
        return name in self._direct

    def keep(self, names: Collection[str]) -> None:
        """Let go of the applications that are not in `names`; the bus carries calls to them."""
        for name in self._direct.keys() - set(names):
            self._direct.pop(name).socket.close()

    def ask(self, calls: Iterable[_Call]) -> list[Any]:
        """Return the answer to each call, None if it failed or its application is silent.

        A `DesktopError` means that the bus itself has gone.
        """
        run = _Run(list(calls), self.silent)
        while run.open:
            self._send(run)
            if not run.waiting:
                continue
            remaining_s = self._end - time.monotonic()
            if remaining_s <= 0:
                self._give_up(run, 0.0)
                continue
            channels = [self._bus, *self._direct.values()]
            ready = select.select(
                channels, [], [], min(remaining_s, run.time_left(self._patience))
            )[0]
            if not ready:
                self._give_up(run, self._patience)
            for channel in ready:
                self._receive(channel, run)
        return run.answers

    def _give_up(self, run: "_Run", timeout: float) -> None:
        """Leave alone who is silent; its direct connection would fill up, the bus drops calls."""
        run.give_up(timeout)
        self.keep(self._direct.keys() - self.silent)

    def _send(self, run: "_Run") -> None:
        parts: dict[_Channel, list[bytes]] = {}
        for position in run.next_calls():
            reference, method = run.calls[position]
            self._serial = self._serial % 0x7FFFFFFF + 1
            message = method.message(reference, self._serial)
            channel = self._direct.get(reference[0], self._bus)
            parts.setdefault(channel, []).append(message)
            run.waiting[self._serial] = position
        for channel, messages in parts.items():
            try:
                channel.socket.sendall(b"".join(messages))
            except OSError as error:
                self._lost(channel, run, error)

    def _receive(self, channel: _Channel, run: "_Run") -> None:
        try:
            for serial, cursor in channel.replies():
                run.answer(serial, cursor)
        except (OSError, EOFError) as error:
            self._lost(channel, run, error)

    def _lost(self, channel: _Channel, run: "_Run", error: Exception) -> None:
        """Ask again over the bus what an application that has gone was asked directly.

        Raises:
            DesktopError: The bus itself has gone.
        """
        if channel is self._bus:
            raise DesktopError(
                f"the accessibility bus does not answer: {error}; has the session ended?"
            ) from None
        self.keep(self._direct.keys() - {channel.name})
        run.again(channel.name)


class _Run:
    """Calls under way: a queue for each application, so that a silent one holds up no other."""

    def __init__(self, calls: list[_Call], silent: set[str]) -> None:
        self.calls = calls
        self.answers: list[Any] = [None] * len(calls)
        self.waiting: dict[int, int] = {}
        self._silent = silent
        self._queues: dict[str, deque[int]] = {}
        self._flying: dict[str, int] = {}
        self._heard: dict[str, float] = {}
        for position, ((name, _), _) in enumerate(calls):
            if name not in silent:
                self._queues.setdefault(name, deque()).append(position)

    @property
    def open(self) -> bool:
        """Whether something is still to be sent or awaited."""
        return bool(self.waiting) or any(self._queues.values())

    def next_calls(self) -> Iterable[int]:
        """Positions of the calls that may be sent now."""
        for name, queue in self._queues.items():
            while queue and self._flying.get(name, 0) < IN_FLIGHT:
                if not self._flying.get(name):
                    self._heard[name] = time.monotonic()
                self._flying[name] = self._flying.get(name, 0) + 1
                yield queue.popleft()

    def answer(self, serial: int, cursor: Cursor | None) -> None:
        """Take an answer in; one that nobody waits for any more is dropped."""
        position = self.waiting.pop(serial, None)
        if position is None:
            return
        (name, _), method = self.calls[position]
        self._flying[name] -= 1
        self._heard[name] = time.monotonic()
        if cursor is not None:
            try:
                self.answers[position] = method.read(cursor)
            except (struct.error, IndexError):  # an application that answers with another signature
                self.answers[position] = None

    def again(self, name: str) -> None:
        """Put the calls to `name` that are under way, if any, back into its queue."""
        if name not in self._queues:
            return
        serials = [serial for serial, at in self.waiting.items() if self.calls[at][0][0] == name]
        self._flying[name] = 0
        self._queues[name].extendleft(self.waiting.pop(serial) for serial in reversed(serials))

    def time_left(self, timeout: float) -> float:
        """Seconds until the next application has been silent for too long."""
        last = min(self._heard[name] for name, count in self._flying.items() if count)
        return max(0.0, last + timeout - time.monotonic())

    def give_up(self, timeout: float) -> None:
        """Leave the applications alone that have not answered for `timeout` seconds."""
        now_s = time.monotonic()
        for name in [
            name
            for name, count in self._flying.items()
            if count and now_s - self._heard[name] >= timeout
        ]:
            self._silent.add(name)
            self._queues.pop(name, None)
            self._flying[name] = 0
            self.waiting = {s: p for s, p in self.waiting.items() if self.calls[p][0][0] != name}


def _reply_serial(buffer: bytearray, start: int, end: int) -> int:
    """Return the header field with the number of the call that is answered.

    Fields begin at multiples of 8 from `start`.
    """
    position = start
    while position < end:
        code = buffer[position]
        kind = buffer[position + 2]
        if code == REPLY_SERIAL:
            serial: int = _UINT.unpack_from(buffer, position + 4)[0]
            return serial
        if kind in b"so":
            position += 8 + _UINT.unpack_from(buffer, position + 4)[0] + 1
        elif kind in b"g":
            position += 5 + buffer[position + 4] + 1
        else:
            position += 8
        position += -(position - start) % 8
    return 0
