"""A health check from the machine: whether the guest server still accepts connections.

A guest server that ends is started again by process 1. One that hangs, or that has no descriptors
or memory left, does neither end nor answer: its clients would wait for their whole time-outs.
"""

import socket
import time

INTERVAL_S = 10.0  # between two questions
TIMEOUT_S = 15.0  # for one answer
MAX_FAILURES = 2  # in a row, before the server counts as stuck
MAX_GAP_S = 5.0  # between two calls; after a longer one we were stopped, and know nothing
# Refused for want of a token, without a thread: that is answer enough.
_QUESTION = b"GET /ah/health HTTP/1.1\r\nHost: desktop\r\nConnection: close\r\n\r\n"


class GuestHealth:
    """Asks one guest server again and again; waits for nothing.

    Args:
        path: the socket that it listens on.
    """

    def __init__(self, path: str) -> None:
        self._path = path
        self._line: socket.socket | None = None
        self._failures = 0
        self._looked = time.monotonic()
        self._deadline = self._looked + INTERVAL_S  # of the answer, or until the next question

    def is_stuck(self) -> bool:
        """Return whether the server has left `MAX_FAILURES` questions unanswered; call it often."""
        now_s = time.monotonic()
        if now_s - self._looked > MAX_GAP_S:
            self._failures = 0
            self._hang_up(now_s)
        self._looked = now_s
        if self._line is None:
            if now_s >= self._deadline:
                self._ask(now_s)
        elif _has_answered(self._line):
            self._failures = 0
            self._hang_up(now_s)
        elif now_s >= self._deadline:
            self._failures += 1
            self._hang_up(now_s)
        return self._failures >= MAX_FAILURES

    def close(self) -> None:
        """Close the connection of a question that is open."""
        if self._line is not None:
            self._line.close()
        self._line = None

    def _ask(self, now_s: float) -> None:
        self._deadline = now_s + TIMEOUT_S
        self._line = socket.socket(socket.AF_UNIX)
        self._line.setblocking(False)
        try:
            self._line.connect(self._path)
            self._line.send(_QUESTION)
        except OSError:  # nobody accepts, and the queue is full: no answer will come
            return

    def _hang_up(self, now_s: float) -> None:
        self.close()
        self._deadline = now_s + (0.0 if self._failures else INTERVAL_S)


def _has_answered(line: socket.socket) -> bool:
    try:
        line.recv(1)
    except ConnectionError:
        return True  # it has ended, and is being started again
    except OSError:  # nothing yet, or not connected
        return False
    return True
