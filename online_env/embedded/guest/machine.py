"""The desktop as the routes see it: screen, input, windows, tree and commands of one session."""

import os
from typing import Any, cast

from jeepney.io.blocking import open_dbus_connection

from hijack_data.types import Box

from ...errors import DesktopError, GuestError
from .accessibility_tree import AccessibilityTree
from .commands import TOOLS, Runner
from .display import SharedDisplay
from .events import Input
from .recorder import Recorder
from .request_fields import BAD_REQUEST, flag, number, text
from .screen import ScreenCapture
from .tools import Tools
from .windows import Windows, require

LOWEST, HIGHEST = -32768, 32767  # of a coordinate in X
MAX_WINDOW = 2**32


class GuestMachine:
    """All parts of one session.

    Its environment leads to it (`DISPLAY`, `DBUS_SESSION_BUS_ADDRESS`).
    """

    def __init__(self, tools: str = TOOLS) -> None:
        self.name = os.environ.get("DISPLAY", "")
        self.bus = os.environ.get("DBUS_SESSION_BUS_ADDRESS", "")
        self.display = SharedDisplay(self.name)
        self.screen = ScreenCapture(self.name, self.display)
        self.windows = Windows(self.display)
        self.tools = Tools(self.name, self.display)
        # typing takes a while and must not hold up the rest
        self.input = Input(SharedDisplay(self.name))
        self.tree = AccessibilityTree(self.bus, self.windows)
        self.runner = Runner(tools)
        self.recorder = Recorder(self.name, self.runner)

    def health(self) -> dict[str, object]:
        """Return which parts of the session answer; `ready` if all do."""
        display_answers = self._display_answers()
        parts = {
            "display": display_answers,
            "bus": self._bus_answers(),
            "window_manager": display_answers and self._has_window_manager(),
        }
        down = [part for part, is_up in parts.items() if not is_up]
        return {
            "ready": not down,
            "down": down,
            "display": self.name,
            "pid": os.getpid(),
            "uid": os.getuid(),
        }

    def act(self, body: dict[str, Any]) -> None:
        """Act on a window.

        Args:
            body: the request (see `Observe.act_on_windows`).

        Raises:
            GuestError: The request is wrong (400).
        """
        action = text(body, "action")
        if action == "show_desktop":
            self.windows.show_desktop(flag(body, "on", True))
            return
        acts = {
            "activate": self.windows.activate,
            "close": self.windows.close,
            "minimise": self.windows.minimise,
        }
        window = require(self.windows, int(number(body, "id", None, 0, MAX_WINDOW)))
        if action == "place":
            self.windows.place(window.id, _box(body.get("box")))
        elif action in acts:
            acts[action](window.id)
        else:
            action_names = ", ".join((*acts, "place", "show_desktop"))
            raise GuestError(f"action must be one of {action_names}", BAD_REQUEST)

    def _display_answers(self) -> bool:
        try:
            with self.display.use() as connection:
                connection.sync()
        except DesktopError:
            return False
        return True

    def _has_window_manager(self) -> bool:
        try:
            return self.windows.manager_is_there()
        except DesktopError:
            return False

    def _bus_answers(self) -> bool:
        try:
            open_dbus_connection(self.bus).close()
        except (OSError, ValueError, RuntimeError, EOFError):
            return False
        return True


def _box(value: object) -> Box:
    if not isinstance(value, list) or len(cast("list[object]", value)) != 4:
        raise GuestError(f"box must be [x1, y1, x2, y2], got {value!r:.200}", BAD_REQUEST)
    corners = cast("list[Any]", value)
    numbers: dict[str, Any] = dict(zip(("x1", "y1", "x2", "y2"), corners, strict=True))
    x1, y1, x2, y2 = (int(number(numbers, name, None, LOWEST, HIGHEST)) for name in numbers)
    if x2 <= x1 or y2 <= y1:
        raise GuestError(f"box {value!r} is empty: it must be [x1, y1, x2, y2]", BAD_REQUEST)
    return x1, y1, x2, y2
