"""Agents that own their loop, to which the environment is presented as a computer.

The runner calls `predict`, whereas a loop wants to call the computer. So the loop runs in its own
thread; `predict` returns each action that the loop takes, and the loop continues when the next
picture arrives. Only one of the two threads runs at a time.

    def my_loop(computer, instruction):
        while not_there_yet(computer.screenshot()):
            computer.act("pyautogui.click(100, 200)")

    def my_agent():
        return LoopAgent(my_loop)
"""

import base64
import queue
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar, TypeAlias

from hijack_data.errors import HijackError, ParameterError, ParameterTypeError
from hijack_data.png import encode
from hijack_data.types import Size, UInt8Array

from ..base import DONE, FAIL, Observation
from .action_codes import PYAUTOGUI, read_action_codes

MAX_LOOKS = 100  # looks at one picture, after which a loop counts as endless
MAX_CALLS_AFTER_END = 100
# Never set: a thread that waits for this event sleeps until the process ends.
PARKED = threading.Event()
SHUTDOWN_TIMEOUT_S = 5.0  # s for a loop to end after it is told that the episode is over


class LoopEnd(BaseException):
    """The episode is over.

    The computer raises this in its loop. It is not an `Exception`, so that even a loop that retries
    after every failure ends.
    """


@dataclass(frozen=True, kw_only=True)
class _Turn:
    """The next move of a loop: an action, its end, or an exception."""

    code: str = ""
    words: str = ""
    last: bool = False
    raised: BaseException | None = None


class _Bridge:
    """Passes turns from the loop's thread to the agent's, and pictures back."""

    def __init__(self, picture: UInt8Array) -> None:
        self.picture = picture
        self.turns: queue.SimpleQueue[_Turn] = queue.SimpleQueue()
        self.pictures: queue.SimpleQueue[UInt8Array | None] = queue.SimpleQueue()
        self._lock = threading.Lock()  # a loop may have threads of its own
        self._has_ended = False
        self._look_count = 0
        self._calls_after = 0

    def look(self) -> UInt8Array:
        """Return the current picture.

        Raises:
            LoopEnd: The episode is over.
            HijackError: The loop does nothing but look.
        """
        self._check()
        self._look_count += 1
        if self._look_count > MAX_LOOKS:
            raise HijackError(
                f"the loop looked {MAX_LOOKS} times at one picture; the screen changes with the"
                " next action, such as WAIT"
            )
        return self.picture.copy()

    def take(self, code: str, words: str) -> None:
        """Pass an action to the agent's thread, and wait for the next picture.

        Raises:
            LoopEnd: The episode is over.
        """
        with self._lock:
            self._check()
            self.turns.put(_Turn(code=code, words=words))
            picture = self.pictures.get()
            if picture is None:
                self._has_ended = True
                raise LoopEnd("the episode is over")
            self.picture = picture
            self._look_count = 0

    def _check(self) -> None:
        if not self._has_ended:
            return
        self._calls_after += 1
        if self._calls_after > MAX_CALLS_AFTER_END:
            # A loop that catches every exception would keep a core busy.
            PARKED.wait()
        raise LoopEnd("the episode is over")


class LoopComputer:
    """The environment from a loop's point of view: a screen, a pointer and a keyboard."""

    def __init__(self, bridge: _Bridge) -> None:
        self._bridge = bridge
        self._problem = ""

    @property
    def size(self) -> Size:
        """(height, width) of the picture, in whose pixels actions are."""
        height, width = self._bridge.picture.shape[:2]
        return height, width

    @property
    def problem(self) -> str:
        """Why the last action could not be read; empty if it could."""
        return self._problem

    def screenshot(self) -> UInt8Array:
        """Return the present picture, uint8 RGB `[H, W, 3]`; looking takes no step."""
        return self._bridge.look()

    def png(self) -> bytes:
        """Return the present picture as PNG."""
        return encode(self.screenshot())

    def png_base64(self) -> str:
        """Return the present picture as PNG in base64, as endpoints want it."""
        return base64.b64encode(self.png()).decode("ascii")

    def act(self, action: object, dialect: str = PYAUTOGUI, said: str = "") -> UInt8Array:
        """Take an action, which is one step of the episode, and return the next picture.

        After `DONE`, `FAIL` or the last step this does not return: `LoopEnd` ends the loop. An
        action that cannot be read is a malformed step, and `problem` says why. A dialect that
        does not exist raises `UnknownNameError`.

        Args:
            action: pyautogui code, `WAIT`, `DONE` or `FAIL`, or an action of another `dialect`,
                such as the dict of a computer tool.
            dialect: One of `hijack_data.actions.DIALECTS`.
            said: The model's words, for the record.
        """
        codes, self._problem = read_action_codes(action, dialect, self.size)
        for code in codes:
            self._bridge.take(code, said)
            said = ""
        return self._bridge.picture.copy()


Loop: TypeAlias = Callable[[LoopComputer, str], str | None]


class LoopAgent:
    """An agent that runs a loop.

    The episode ends with `DONE` when the loop returns, and with `FAIL` if it returns the word
    `FAIL`. Any other text that it returns is the agent's last words. An exception is a failure of
    the agent.

    Args:
        loop: Called with a `LoopComputer` and the instruction; the method `run` if omitted.
    """

    action_timeout_s: ClassVar[float] = 600.0  # s that a loop may take for an action

    def __init__(self, loop: Loop | None = None) -> None:
        self._loop = loop
        self._bridge: _Bridge | None = None
        self._thread: threading.Thread | None = None

    def run(self, computer: LoopComputer, instruction: str) -> str | None:
        """Do the task, one `computer.act` per step; override this, or pass a loop to the class.

        Raises:
            ParameterError: There is no loop.
        """
        if self._loop is None:
            name = type(self).__name__
            raise ParameterError(f"{name} has no loop; override run(computer, instruction)")
        return self._loop(computer, instruction)

    def reset(self) -> None:
        """End the loop of the last episode, if it still waits for a picture."""
        if self._bridge is not None:
            self._bridge.pictures.put(None)
        if self._thread is not None:
            self._thread.join(SHUTDOWN_TIMEOUT_S)
        self._bridge = None
        self._thread = None

    def predict(self, instruction: str, obs: Observation) -> tuple[str, Sequence[str]]:
        """Return the next action of the loop, and what it says.

        Raises:
            HijackError: The loop takes no action for too long.
        """
        if self._bridge is None:
            self._bridge = self._start_loop(instruction, obs["screenshot"])
        else:
            self._bridge.pictures.put(obs["screenshot"])
        try:
            turn = self._bridge.turns.get(timeout=self.action_timeout_s)
        except queue.Empty:
            name = type(self).__name__
            raise HijackError(f"{name} took no action for {self.action_timeout_s:g} s") from None
        if turn.last:
            self._bridge.turns.put(turn)  # asked again, it gives the same answer
        if turn.raised is not None:
            raise turn.raised
        return turn.words, [turn.code]

    def _start_loop(self, instruction: str, picture: UInt8Array) -> _Bridge:
        bridge = _Bridge(picture)
        self._thread = threading.Thread(
            target=self._run_loop, args=(bridge, instruction), name="loop", daemon=True
        )
        self._thread.start()
        return bridge

    def _run_loop(self, bridge: _Bridge, instruction: str) -> None:
        """Run the loop to its end; its exceptions are raised where `predict` waits."""
        try:
            turn = _last_turn(self.run(LoopComputer(bridge), instruction))
        except LoopEnd:
            return
        except BaseException as error:  # noqa: BLE001  (a loop may raise anything)
            turn = _Turn(last=True, raised=error)
        bridge.turns.put(turn)


def _last_turn(words: object) -> _Turn:
    if words is None:
        return _Turn(code=DONE, last=True)
    if not isinstance(words, str):
        raise ParameterTypeError(f"a loop returns nothing, words, or FAIL, got {words!r:.80}")
    code = FAIL if words.strip() == FAIL else DONE
    return _Turn(code=code, words=words, last=True)
