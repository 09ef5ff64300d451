"""Logs of a desktop's programs, which cannot fill the machine's disk.

A program writes to a pipe, and whoever started it reads the other end and keeps the last part of
what came. So nothing inside holds a file of the machine's; a program that writes without end only
replaces its own older lines. Light on purpose: the first process of a desktop imports it.
"""

import contextlib
import os
import select
from collections.abc import Iterable
from dataclasses import dataclass

MAX_BYTES = 16 << 20  # of all logs of a desktop
MAX_LOGS = 32
MAX_LOG_BYTES = MAX_BYTES // MAX_LOGS
NOTE = b"[older lines were left out]\n"
TAIL_BYTES = 800
_KEPT_BYTES = MAX_LOG_BYTES // 2  # when a log is full
_PIECE_BYTES = 1 << 16  # what a pipe holds
_MAX_PIECES = 64  # read for a tail from a program that goes on writing


@dataclass
class _Log:
    reader: int
    writer: int
    file: int
    size: int = 0
    tail: bytes = b""


class BoundedLogs:
    """The logs that this process keeps, one for each name.

    Args:
        folder: descriptor of the folder of their files; it is closed by `close`.
    """

    def __init__(self, folder: int) -> None:
        self._folder = folder
        self._logs: dict[str, _Log] = {}
        self._names: dict[int, str] = {}

    def writer(self, name: str) -> int:
        """Return the descriptor that a program called `name` writes to; it stays ours.

        Raises:
            OSError: There is no room for another log.
        """
        if name not in self._logs:
            if len(self._logs) == MAX_LOGS:
                raise OSError(f"no room for the log of {name}: there are {MAX_LOGS} already")
            flags = os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC
            file = os.open(f"{name}.log", flags, 0o600, dir_fd=self._folder)
            reader, writer = os.pipe()
            os.set_blocking(reader, False)
            self._logs[name] = _Log(reader, writer, file)
            self._names[reader] = name
        return self._logs[name].writer

    def wait(self, timeout: float, descriptors: Iterable[int] = ()) -> set[int]:
        """Keep what programs write until a descriptor can be read or a program has written.

        Args:
            timeout: seconds that it may take at most.
            descriptors: what else to wait for.

        Returns:
            Those of `descriptors` that can be read.
        """
        poller = select.poll()
        for descriptor in (*self._names, *descriptors):
            poller.register(descriptor, select.POLLIN)
        ready = {descriptor for descriptor, _ in poller.poll(max(0.0, timeout) * 1000)}
        for descriptor in ready & self._names.keys():
            self._take(self._logs[self._names[descriptor]])
        return ready - self._names.keys()

    def tail(self, name: str) -> str:
        """Return the end of a log, as text without control characters; empty if there is none."""
        log = self._logs.get(name)
        if log is None:
            return ""
        for _ in range(_MAX_PIECES):
            if not self._take(log):
                break
        return printable(log.tail)

    def close(self) -> None:
        """Close all descriptors."""
        for log in self._logs.values():
            for descriptor in (log.reader, log.writer, log.file):
                os.close(descriptor)
        os.close(self._folder)
        self._logs = {}
        self._names = {}

    def _take(self, log: _Log) -> bool:
        """Move a piece from the pipe to the file; return whether there was one."""
        try:
            data = os.read(log.reader, _PIECE_BYTES)
        except BlockingIOError:
            return False
        log.tail = (log.tail + data)[-TAIL_BYTES:]
        with contextlib.suppress(OSError):  # the machine's disk is full: the program goes on
            if log.size + len(data) > MAX_LOG_BYTES:
                tail = NOTE + os.pread(log.file, _KEPT_BYTES, max(0, log.size - _KEPT_BYTES))
                os.ftruncate(log.file, 0)
                log.size = os.pwrite(log.file, tail, 0)
            log.size += os.pwrite(log.file, data, log.size)
        return True


def printable(data: bytes) -> str:
    """Return bytes as text for a terminal: what could steer it becomes a question mark."""
    text = data.decode("utf-8", "replace")
    return "".join(c if c.isprintable() or c in "\n\t" else "?" for c in text).strip()
