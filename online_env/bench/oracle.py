"""The oracle as an agent: what a task's own solution does becomes actions, so that it goes through the environment too.

`Task.oracle(desktop)` runs in a thread of its own and is given a stand-in for the desktop. Its looks at the machine go
to the real one; what it runs is handed out by `predict` as an action, and it goes on when the next one is asked for. So
only one of the two threads ever works, and the oracle suffers whatever the corruption does to the machine.
"""

import queue
import threading
from collections.abc import Mapping, Sequence
from typing import Any

from hijack_data.coords import CoordMap
from hijack_data.errors import HijackError
from hijack_data.types import Size, UInt8Array

from ..desktops.protocol import Capability, Desktop, RunResult
from ..errors import DesktopError
from ..tasks import Task
from .agent import DONE, FAIL, Observation

PATIENCE = 300.0  # s until the solution has its next action; it waits 20 s for what does not come
ENDING = 30.0  # s until a solution that looks for something has noticed that the episode is over


class _StoppedError(DesktopError):
    """Ends the solution of an episode that is over."""


class StandIn:
    """A desktop on which `run` hands its code over to be an action, and waits until it was taken."""

    def __init__(self, desktop: Desktop) -> None:
        self._desktop = desktop
        self.code: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self.done: queue.SimpleQueue[bool] = queue.SimpleQueue()

    @property
    def capabilities(self) -> frozenset[Capability]:
        """Those of the desktop."""
        return self._desktop.capabilities

    @property
    def size(self) -> Size:
        """`(height, width)` of the real screen."""
        return self._desktop.size

    def run(self, code: str) -> RunResult:
        """Let `code` be the next action; returns when it was taken."""
        self.code.put(code)
        if not self.done.get():
            raise _StoppedError("the episode is over")
        return RunResult("success", returncode=0)

    def screenshot(self) -> UInt8Array:
        """The real screen."""
        return self._desktop.screenshot()

    def accessibility(self) -> str:
        """The real tree."""
        return self._desktop.accessibility()

    def execute(self, argv: Sequence[str] | str, timeout: float = 60) -> RunResult:
        """Look something up, such as the home folder; not an action."""
        return self._desktop.execute(argv, timeout)

    def read_file(self, path: str) -> bytes:
        """A real file."""
        return self._desktop.read_file(path)

    def write_file(self, path: str, data: bytes) -> None:
        """Refused: an agent writes files with pointer and keyboard."""
        raise DesktopError(f"an oracle cannot write {path} behind the screen; it has to use the applications")

    def reset(self, task: Mapping[str, Any] | None = None) -> None:
        """Refused."""
        raise DesktopError("an oracle cannot reset the desktop")

    def close(self) -> None:
        """Nothing: the desktop belongs to the runner."""


class Oracle:
    """Solves a task by its own solution, one action at a time."""

    def __init__(self) -> None:
        self._task: Task | None = None
        self._desktop: StandIn | None = None
        self._thread: threading.Thread | None = None
        self._failure, self._over = "", False

    def reset(self) -> None:
        """End the solution of the last episode, if it still waits."""
        if self._thread is not None and self._desktop is not None:
            self._desktop.done.put(False)
            self._thread.join(ENDING)
        self._task = self._desktop = self._thread = None
        self._failure, self._over = "", False

    def prepare(self, task: Task, desktop: Desktop) -> None:
        """Take the task to solve, and the machine to look at."""
        self._task, self._desktop = task, StandIn(desktop)

    def predict(self, instruction: str, obs: Observation) -> tuple[str, Sequence[str]]:
        """The next action of the solution; `DONE` after the last, `FAIL` (and why) where it cannot go on.

        The solution works in pixels of the real screen, actions are in those of the observation.
        """
        if self._desktop is None or self._task is None:
            raise DesktopError("the oracle was not shown the task: call prepare after reset")
        code = None if self._over else self._next(self._task, self._desktop)
        if code is None:
            self._over = True
            return (self._failure, [FAIL]) if self._failure else ("The task is done.", [DONE])
        height, width = obs["screenshot"].shape[:2]
        return "", [CoordMap(observation=(height, width), screen=self._desktop.size).code_to_observation(code)]

    def _next(self, task: Task, desktop: StandIn) -> str | None:
        if self._thread is None:
            self._thread = threading.Thread(target=self._solve, args=(task, desktop), name="oracle", daemon=True)
            self._thread.start()
        else:
            desktop.done.put(True)
        try:
            return desktop.code.get(timeout=PATIENCE)
        except queue.Empty:
            raise DesktopError(f"the solution of {task.id} had no next action within {PATIENCE:g} s") from None

    def _solve(self, task: Task, desktop: StandIn) -> None:
        try:
            task.oracle(desktop)
        except _StoppedError:
            return
        except HijackError as error:
            self._failure = f"{type(error).__name__}: {error}"
        desktop.code.put(None)
