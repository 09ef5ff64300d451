"""cua-agent, which owns its loop: the environment is its computer.

A class with a `model` is an agent, see docs/score_my_agent.md.
"""

import asyncio
import os
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal

from hijack_data import extras
from hijack_data.actions import write_pyautogui
from hijack_data.errors import HijackError, ParameterError
from hijack_data.types import Action

from ..base import WAIT
from .loop import LoopAgent, LoopComputer

EXTRA = "cua"
# Unless these variables are set before the import, the package sends usage statistics, and its
# model library downloads a price list.
_QUIET = {"CUA_TELEMETRY_ENABLED": "false", "LITELLM_LOCAL_MODEL_COST_MAP": "True"}


class CuaAgent(LoopAgent):
    """Plays as cua-agent's `ComputerAgent`.

    Its loop has no limit of its own. It ends with the episode, and fails if the model takes
    `max_idle_turns` turns one after the other without touching the computer.

    Raises:
        ParameterError: `model` is empty.
        MissingDependencyError: `cua-agent` is not installed.
    """

    model: ClassVar[str] = ""  # as cua-agent names it, such as `openai/computer-use-preview`
    # More arguments of `ComputerAgent`, such as `only_n_most_recent_images`.
    options: ClassVar[Mapping[str, Any]] = {}
    max_idle_turns: ClassVar[int] = 5

    def __init__(self) -> None:
        super().__init__()
        if not self.model:
            raise ParameterError(f"{type(self).__name__} names no model; set `model`")
        for name, value in _QUIET.items():
            os.environ.setdefault(name, value)
        self._package = extras.load("cua_agent", "CuaAgent", EXTRA)

    def run(self, computer: LoopComputer, instruction: str) -> str:
        """Let the agent play; return its last words."""
        return asyncio.run(self._play(CuaComputer(computer), instruction))

    async def _play(self, computer: "CuaComputer", instruction: str) -> str:
        arguments = {
            "telemetry_enabled": False,
            "screenshot_delay": 0,  # the environment waits until the screen has settled
            **self.options,
        }
        agent = self._package.ComputerAgent(model=self.model, tools=[computer], **arguments)
        words = ""
        idle = 0
        before = 0
        async for result in agent.run(instruction):
            words = _words(result) or words
            idle = 0 if computer.touched > before else idle + 1
            before = computer.touched
            if idle >= self.max_idle_turns:
                raise HijackError(
                    f"{self.model} took {idle} turns without touching the computer; the last"
                    f" words: {words!r:.200}"
                )
        return words


class CuaComputer:
    """The environment with all methods of cua-agent's `AsyncComputerHandler`.

    The loop of cua-agent takes a screenshot after each action; that screenshot does not count as a
    step.
    """

    def __init__(self, computer: LoopComputer) -> None:
        self._computer = computer
        self.touched = 0  # number of actions and screenshots so far

    async def get_environment(self) -> Literal["linux"]:
        """Return the kind of the system."""
        return "linux"

    async def get_dimensions(self) -> tuple[int, int]:
        """Return (width, height) of the picture."""
        height, width = self._computer.size
        return width, height

    async def screenshot(self, text: str | None = None) -> str:
        """Return the picture as PNG in base64."""
        self.touched += 1
        return self._computer.png_base64()

    async def click(self, x: int, y: int, button: str = "left") -> None:
        """Click a button of the mouse."""
        await self._call(type="click", x=x, y=y, button=button)

    async def double_click(self, x: int, y: int) -> None:
        """Click twice."""
        await self._call(type="double_click", x=x, y=y)

    async def scroll(self, x: int, y: int, scroll_x: int, scroll_y: int) -> None:
        """Turn the wheel at a place, in pixels; down and right are positive."""
        await self._call(type="scroll", x=x, y=y, scroll_x=scroll_x, scroll_y=scroll_y)

    async def type(self, text: str) -> None:
        """Type a text."""
        await self._call(type="type", text=text)

    async def wait(self, ms: int = 1000) -> None:
        """Wait for a second."""
        await self._act(WAIT)

    async def move(self, x: int, y: int) -> None:
        """Move the pointer."""
        await self._call(type="move", x=x, y=y)

    async def keypress(self, keys: Sequence[str] | str) -> None:
        """Press keys together."""
        listed = [keys] if isinstance(keys, str) else list(keys)
        await self._call(type="keypress", keys=listed)

    async def drag(self, path: Sequence[Mapping[str, int]]) -> None:
        """Drag along a path."""
        points = [dict(point) for point in path]
        await self._call(type="drag", path=points)

    async def get_current_url(self) -> str:
        """Return nothing: an agent reads the address on the screen."""
        return ""

    async def left_mouse_down(self, x: int | None = None, y: int | None = None) -> None:
        """Press the left button."""
        await self._act(write_pyautogui(Action("mouse_down", x, y)))

    async def left_mouse_up(self, x: int | None = None, y: int | None = None) -> None:
        """Release the left button."""
        await self._act(write_pyautogui(Action("mouse_up", x, y)))

    async def _call(self, **call: Any) -> None:
        await self._act(call, "openai")

    async def _act(self, action: object, dialect: str = "pyautogui") -> None:
        self.touched += 1
        await asyncio.to_thread(self._computer.act, action, dialect)


def _words(result: Mapping[str, Any]) -> str:
    """Return the model's words in a result of the loop."""
    found: list[str] = []
    for item in result.get("output", ()):
        if item.get("type") == "message":
            found += [part.get("text", "") for part in item.get("content", ())]
    return " ".join(found)
