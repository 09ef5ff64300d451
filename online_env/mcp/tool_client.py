"""`ToolClient`: the agent of an episode whose actions are the tool calls of an MCP client."""

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hijack_data.coords import CoordMap
from hijack_data.elements.accessibility_nodes import (
    AccessibleNode,
    box_from_position,
    detect_platform,
    nodes_from_tree,
    parse_pair,
)
from hijack_data.errors import HijackError
from hijack_data.types import Box, Size, UInt8Array

from ..agents.base import Observation
from ..agents.guarded import Notice, add_notice
from ..desktops.protocol import Desktop
from ..errors import DesktopError

MAX_NODES = 1000  # lines of a tree
MAX_NAME_CHARS = 200
OVER = "The episode is over: no more actions count."
LEFT = "the client left without calling done or fail"


class EpisodeOverError(HijackError, RuntimeError):
    """A tool was called after the end of the episode."""


@dataclass(frozen=True)
class ClientView:
    """What the client may see between two actions.

    Args:
        instruction: The task.
        picture: The screen, uint8 RGB `[H, W, 3]`.
        notice: What a guard says; empty if it says nothing.
    """

    instruction: str
    picture: UInt8Array
    notice: str = ""

    @property
    def size(self) -> Size:
        """(height, width) of the picture."""
        height, width = self.picture.shape[:2]
        return height, width


class ToolClient:
    """An agent that waits for the actions of a client.

    The runner calls `predict` in one thread; the tools are called in others, one at a time.
    """

    def __init__(self) -> None:
        self._condition = threading.Condition()
        self._one_call = threading.Lock()
        self._turn: ClientView | None = None  # while the runner waits for an action
        self._action: str | None = None
        self._notice = ""
        self._why_left = ""
        self._is_over = False
        self.has_acted = False
        self.desktop: Desktop | None = None

    # The runner's side

    def take_notice(self, notice: Notice) -> None:
        """Keep what a guard says for the next turn of the client."""
        self._notice = add_notice("", notice).strip()

    def predict(self, instruction: str, obs: Observation) -> tuple[str, Sequence[str]]:
        """Show the picture to the client, and return its next action.

        Raises:
            ConnectionError: The client has left.
        """
        with self._condition:
            self._turn = ClientView(instruction, obs["screenshot"], self._notice)
            self._condition.notify_all()
            self._condition.wait_for(lambda: self._action is not None or self._why_left)
            self._turn = None
            action, self._action = self._action, None
            if action is None:
                raise ConnectionError(self._why_left)
            return "", [action]

    def end(self) -> None:
        """Tell the tools that no more actions count."""
        with self._condition:
            self._is_over = True
            self._condition.notify_all()

    # The client's side

    @property
    def is_over(self) -> bool:
        """Whether the episode is over."""
        return self._is_over

    def leave(self, why: str = LEFT) -> None:
        """Note that the client will not act any more, which ends the episode."""
        with self._condition:
            self._why_left = self._why_left or why
            self._condition.notify_all()

    def look(self) -> ClientView:
        """Wait until the client may act, and return what it sees.

        Raises:
            EpisodeOverError: The episode is over.
        """
        with self._condition:
            return self._wait()

    def act(self, action: str) -> ClientView | None:
        """Take an action; return what the client sees then, or `None` if it ended the episode.

        Args:
            action: pyautogui code in pixels of the last picture, `WAIT`, `DONE` or `FAIL`.

        Raises:
            EpisodeOverError: The episode was over before.
        """
        with self._one_call, self._condition:
            self._wait()
            self.has_acted = True
            self._action = action
            self._condition.notify_all()
            self._condition.wait_for(lambda: self._action is None or self._is_over)
            self._condition.wait_for(lambda: self._turn is not None or self._is_over)
            return None if self._is_over else self._turn

    def tree(self) -> str:
        """Return the elements on the screen, a line each, in pixels of the last picture.

        Raises:
            EpisodeOverError: The episode is over.
            DesktopError: The desktop has no tree.
        """
        with self._one_call:
            turn = self.look()
            if self.desktop is None:
                raise DesktopError("there is no desktop")
            coords = CoordMap(turn.size, self.desktop.size)
            return describe_tree(self.desktop.accessibility(), coords)

    def _wait(self) -> ClientView:
        self._condition.wait_for(lambda: self._turn is not None or self._is_over)
        if self._is_over or self._turn is None:
            raise EpisodeOverError(OVER)
        return self._turn


def describe_tree(xml: str, coords: CoordMap) -> str:
    """Return the named or interactive nodes of a tree that are on the screen, a line each.

    Args:
        xml: The tree, in OSWorld's XML dialect.
        coords: From the picture that the client sees to the screen.
    """
    height, width = coords.screen
    lines: list[str] = []
    for node in nodes_from_tree(xml):
        box = _node_box(node)
        name = " ".join((node.name or node.text).split())[:MAX_NAME_CHARS]
        if box is None or not node.visible or not name:
            continue
        if box[2] <= 0 or box[3] <= 0 or box[0] >= width or box[1] >= height:
            continue
        left, top, right, bottom = map(int, coords.boxes_to_observation([box])[0])
        if len(lines) == MAX_NODES:
            lines.append(f"... more than {MAX_NODES} elements")
            break
        states = " ".join(sorted(node.states & _SHOWN_STATES))
        centre = f"at ({(left + right) // 2}, {(top + bottom) // 2})"
        lines.append(
            f"{node.role} {name!r} {centre}, {right - left}x{bottom - top} {states}".rstrip()
        )
    return "\n".join(lines)


_SHOWN_STATES = frozenset({"focused", "checked", "selected", "expanded"})


def _node_box(node: AccessibleNode) -> Box | None:
    platform = detect_platform(node)
    position = parse_pair(node.attributes.get(platform.position, ""))
    size = parse_pair(node.attributes.get(platform.size, ""))
    if position is None or size is None or min(size) < 1:
        return None
    return box_from_position(position, size)


def action_code(function: str, *arguments: Any, **options: Any) -> str:
    """Return a call of pyautogui as code."""
    words = [repr(argument) for argument in arguments]
    words += [f"{name}={value!r}" for name, value in options.items()]
    return f"pyautogui.{function}({', '.join(words)})"
