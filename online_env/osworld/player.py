"""Keyboard, mouse and shell for scripted solutions.

Everything goes through OSWorld's `step`, as an agent's actions do.
"""

import time
from typing import Any, Protocol

from hijack_data.elements.accessibility_nodes import AccessibleNode, nodes_from_tree
from hijack_data.types import Point

from .errors import OsworldError

PAUSE = 0.3
_VISITS = 2


class PlayError(OsworldError):
    """A script did not find an element that it needs on the screen."""


class PlayedEnv(Protocol):
    """The part of OSWorld's environment that a script needs."""

    @property
    def controller(self) -> Any:
        """It has `get_accessibility_tree`."""
        ...

    def step(self, action: str, pause: float) -> object:
        """Take one action, then wait for `pause` seconds."""
        ...


class Player:
    """Keyboard, mouse, shell and accessibility tree of the guest."""

    def __init__(self, env: PlayedEnv) -> None:
        self._env = env

    def do(self, code: str, pause: float = PAUSE) -> None:
        """Run pyautogui code as one action of the agent."""
        self._env.step(code, pause)

    def shell(self, command: str) -> None:
        """Run a shell command as the desktop's user, from Python code as an agent would.

        A failure goes unnoticed.
        """
        self.do(f"import subprocess; subprocess.run({command!r}, shell=True)")

    def press(self, *keys: str, pause: float = PAUSE) -> None:
        """Press keys together."""
        names = ", ".join(map(repr, keys))
        self.do(f"pyautogui.hotkey({names})", pause)

    def type(self, text: str) -> None:
        """Type a text into the element that has the focus."""
        self.do(f"pyautogui.write({text!r})")

    def click(self, name: str, role: str = "", timeout: float = 15.0) -> None:
        """Click the first visible element whose name starts with `name`.

        Args:
            name: How its name starts.
            role: Its role; any if omitted.
            timeout: Seconds to wait for it.
        """
        x, y = self.find(name, role, timeout)
        self.do(f"pyautogui.click({x}, {y})")

    def find(self, name: str, role: str = "", timeout: float = 15.0) -> Point:
        """Wait for an element and return its centre; see `click`."""
        return self._wait(name, role, 0, timeout)

    def sees(self, name: str, role: str = "", timeout: float = 3.0) -> bool:
        """Return whether an element comes within `timeout` seconds; see `click`."""
        try:
            self.find(name, role, timeout)
        except PlayError:
            return False
        return True

    def click_beside(self, name: str, other: str, role: str = "", timeout: float = 15.0) -> None:
        """Click the element named `other` that is nearest in height to the one named `name`."""
        _, row = self.find(name, timeout=timeout)
        x, y = self._wait(other, role, row, timeout)
        self.do(f"pyautogui.click({x}, {y})")

    def visit(self, address: str) -> None:
        """Go to an address in the browser that has the focus.

        A browser that has just started may search for what is typed; then it is typed once more.
        """
        for _ in range(_VISITS):
            self.find("Address and search bar", "entry", 30)
            self.press("ctrl", "l")
            self.type(address)
            self.press("enter", pause=1.0)
            if not self.sees(f"{address} - Lumen Search", "frame", timeout=0):
                return

    def _wait(self, name: str, role: str, row: int, timeout: float) -> Point:
        deadline = time.monotonic() + timeout
        while True:
            found = self._matching(name, role)
            if found and row:
                return min(found, key=lambda point: abs(point[1] - row))
            if found:
                return found[0]
            if time.monotonic() > deadline:
                what = f"{role or 'element'} {name!r}"
                raise PlayError(f"no {what} on the screen within {timeout:.0f} s")
            time.sleep(PAUSE)

    def _matching(self, name: str, role: str) -> list[Point]:
        text = self._env.controller.get_accessibility_tree()
        points: list[Point] = []
        for node in named_nodes(text or ""):
            x1, y1, x2, y2 = node.box or (0, 0, 0, 0)
            if node.name.startswith(name) and role in ("", node.tag):
                points.append(((x1 + x2) // 2, (y1 + y2) // 2))
        return points


def named_nodes(tree: str) -> list[AccessibleNode]:
    """Return the nodes of a tree that have a name and a place on the screen.

    Unlike `boxes_from_tree` this keeps elements that are not interactive, such as headings.
    """
    if not tree:
        return []
    return [node for node in nodes_from_tree(tree) if node.name and node.box is not None]
