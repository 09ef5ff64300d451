"""What the X server gets from pointer and keyboard, by its RECORD extension."""

import threading
from collections.abc import Callable
from typing import Any

from Xlib import X
from Xlib.display import Display
from Xlib.ext import record
from Xlib.protocol import rq

from .ewmh import Screen

START_TIMEOUT_S = 5.0
STOP_TIMEOUT_S = 5.0
MAX_EVENTS = 100_000
NAMES = {
    X.KeyPress: "key_down",
    X.KeyRelease: "key_up",
    X.ButtonPress: "button_down",
    X.ButtonRelease: "button_up",
}
_NO_EVENTS = (0, 0)
_NO_REQUESTS = (0, 0, 0, 0)
_Facts = dict[str, Any]


class InputWatch:
    """Records the events of pointer and keyboard from `start` to `stop`."""

    def __init__(self, name: str | None) -> None:
        self._control = Display(name)
        self._data = Display(name)
        self._events: list[_Facts] = []
        self._started = threading.Event()
        self._thread = threading.Thread(target=self._read, daemon=True)
        ranges = {
            "core_requests": _NO_EVENTS,
            "core_replies": _NO_EVENTS,
            "ext_requests": _NO_REQUESTS,
            "ext_replies": _NO_REQUESTS,
            "delivered_events": _NO_EVENTS,
            "device_events": (X.KeyPress, X.ButtonRelease),
            "errors": _NO_EVENTS,
            "client_started": False,
            "client_died": False,
        }
        self._context = self._control.record_create_context(0, [record.AllClients], [ranges])
        self._control.sync()

    def start(self) -> None:
        """Begin to record; return when the X server does.

        Raises:
            RuntimeError: It does not begin in time.
        """
        self._thread.start()
        if not self._started.wait(START_TIMEOUT_S):
            raise RuntimeError("the X server does not begin to record input")

    def stop(self) -> list[_Facts]:
        """End the record and return the events.

        Raises:
            RuntimeError: It does not end in time.
        """
        self._control.record_disable_context(self._context)
        self._control.sync()
        self._thread.join(STOP_TIMEOUT_S)
        if self._thread.is_alive():
            raise RuntimeError("the X server does not end its record of input")
        self._control.record_free_context(self._context)
        self._control.close()
        self._data.close()
        return self._events

    def _read(self) -> None:
        self._data.record_enable_context(self._context, self._note)

    def _note(self, reply: Any) -> None:
        if reply.category == record.StartOfData:
            self._started.set()
        data = reply.data if reply.category == record.FromServer else b""
        while data and len(self._events) < MAX_EVENTS:
            event, data = rq.EventField("event").parse_binary_value(
                data, self._data.display, None, None
            )
            if event.type in NAMES:
                at = [event.root_x, event.root_y]
                self._events.append({"event": NAMES[event.type], "code": event.detail, "at": at})


_watches: list[InputWatch] = []  # one at most


def start(screen: Screen) -> _Facts:
    """Begin to record the input of a screen; a record under way is dropped."""
    stop(screen)
    watch = InputWatch(screen.display.get_display_name())
    watch.start()
    _watches.append(watch)
    return {}


def stop(screen: Screen) -> _Facts:
    """End the record, and return its events; `None` if there was none."""
    if not _watches:
        return {"events": None}
    return {"events": _watches.pop().stop()}


OPERATIONS: dict[str, Callable[..., _Facts]] = {"start": start, "stop": stop}
