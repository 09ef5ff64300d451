"""The DevTools protocol over the two pipes of a Chromium that this process has started.

Pipes rather than a port: no other program of the machine can connect, and Chromium ends when its
pipes close, however this process ends.
"""

import itertools
import json
import os
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from typing import Any, TypeAlias

from ..errors import DesktopError, DesktopTimeoutError

CALL_TIMEOUT_S = 20.0
_CHUNK_BYTES = 1 << 20

# Called in the reading thread with method, parameters and session: it must not wait for answers.
EventHandler: TypeAlias = Callable[[str, Mapping[str, Any], str], None]


class DevToolsError(DesktopError):
    """Chromium refused a command; the message has the command and its reason."""


class DevTools:
    """A connection to one Chromium; its methods may be called from any thread.

    Args:
        reader: The descriptor of the pipe that Chromium writes.
        writer: The descriptor of the pipe that it reads.
        on_event: Called with each event.
        explain: Returns why Chromium ended, for the message of an error.
    """

    def __init__(
        self, reader: int, writer: int, on_event: EventHandler, explain: Callable[[], str]
    ) -> None:
        self._reader = reader
        self._writer = writer
        self._on_event = on_event
        self._explain = explain
        self._numbers = itertools.count(1)
        self._lock = threading.Lock()
        self._pending: dict[int, tuple[str, str, Future[dict[str, Any]]]] = {}
        self._is_open = True
        self._thread = threading.Thread(target=self._read, name="devtools", daemon=True)
        self._thread.start()

    @property
    def is_open(self) -> bool:
        """Whether Chromium still answers."""
        return self._is_open

    def call(
        self, method: str, session: str = "", timeout: float = CALL_TIMEOUT_S, **params: Any
    ) -> dict[str, Any]:
        """Send a command and return its result.

        Args:
            method: Such as `Page.navigate`.
            session: The session of a page; "" for the browser.
            timeout: In seconds.
            **params: The parameters of the command.

        Raises:
            DevToolsError: Chromium refuses the command.
            DesktopTimeoutError: No answer came in time: the page hangs.
            DesktopError: Chromium has ended, or the page has crashed.
        """
        future = self.send(method, session, **params)
        try:
            return future.result(timeout)
        except FutureTimeoutError:
            raise DesktopTimeoutError(
                f"the browser did not answer {method} within {timeout:g} s: its page hangs"
            ) from None

    def send(self, method: str, session: str = "", **params: Any) -> "Future[dict[str, Any]]":
        """Send a command without waiting; commands of one session are carried out in order."""
        future: Future[dict[str, Any]] = Future()
        number = next(self._numbers)
        message: dict[str, Any] = {"id": number, "method": method, "params": params}
        if session:
            message["sessionId"] = session
        data = json.dumps(message).encode() + b"\0"
        with self._lock:
            if not self._is_open:
                future.set_exception(DesktopError(f"{method}: {self._explain()}"))
                return future
            self._pending[number] = session, method, future
            try:
                while data:
                    data = data[os.write(self._writer, data) :]
            except OSError:
                self._pending.pop(number, None)
                future.set_exception(DesktopError(f"{method}: {self._explain()}"))
        return future

    def fail_session(self, session: str, problem: str) -> None:
        """Make the pending commands of a page fail, which will not be answered any more."""
        with self._lock:
            numbers = [number for number, (name, *_) in self._pending.items() if name == session]
            futures = [self._pending.pop(number)[-1] for number in numbers]
        for future in futures:
            future.set_exception(DesktopError(problem))

    def close(self) -> None:
        """Close the pipe to Chromium, which ends it; closing twice is allowed."""
        with self._lock:
            if self._is_open:
                self._is_open = False
                os.close(self._writer)
        self._thread.join(CALL_TIMEOUT_S)

    def _read(self) -> None:
        buffer = b""
        while True:
            try:
                data = os.read(self._reader, _CHUNK_BYTES)
            except OSError:
                data = b""
            if not data:
                break
            *messages, buffer = (buffer + data).split(b"\0")
            for message in messages:
                self._receive(json.loads(message))
        with self._lock:
            if self._is_open:
                self._is_open = False
                os.close(self._writer)
            futures = [future for *_, future in self._pending.values()]
            self._pending.clear()
        os.close(self._reader)
        for future in futures:
            future.set_exception(DesktopError(self._explain()))

    def _receive(self, message: dict[str, Any]) -> None:
        if "id" not in message:
            self._on_event(message["method"], message["params"], message.get("sessionId", ""))
            return
        with self._lock:
            _, method, future = self._pending.pop(message["id"], ("", "", None))
        if future is None:
            return
        if "error" in message:
            error = message["error"]
            reason = f"{error.get('message')} {error.get('data', '')}".strip()
            future.set_exception(DevToolsError(f"the browser refused {method}: {reason}"))
        else:
            future.set_result(message["result"])
