"""The oracles: a task's own solution, played as the actions of an agent.

`Task.oracle` runs in its own thread, with a hand on a stand-in for the desktop. Reads go to the
real machine; code that it runs is returned by `predict` as an action, and the solution continues
when the next action is requested. So only one of the two threads runs at a time, and the corruption
affects the oracle like any agent.
"""

import queue
import threading
from collections.abc import Mapping, Sequence
from typing import Any

from hijack_data.actions.agent_actions import REINIT
from hijack_data.coords import CoordMap
from hijack_data.errors import HijackError
from hijack_data.types import Size, UInt8Array

from ..desktops.protocol import Capability, Desktop, RunResult
from ..errors import DesktopError, DesktopTimeoutError
from ..tasks import Hand, Machine, Task
from ..tasks.careful_hand import CarefulHand
from ..tasks.hand import GiveUpError
from .base import DONE, FAIL, Observation

# The time in which a solution must find its next action; it waits 20 s for a missing element.
ACTION_TIMEOUT_S = 300.0
# The time in which a solution that looks for an element must notice that the episode is over.
SHUTDOWN_TIMEOUT_S = 30.0


class _StoppedError(DesktopError):
    """Ends the solution of an episode that is over."""


class OracleDesktop:
    """A desktop whose `run` passes its code on as an action, and waits until it was taken."""

    def __init__(self, desktop: Desktop) -> None:
        self._desktop = desktop
        self.code: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self.done: queue.SimpleQueue[bool] = queue.SimpleQueue()

    @property
    def capabilities(self) -> frozenset[Capability]:
        """The capabilities of the desktop."""
        return self._desktop.capabilities

    @property
    def size(self) -> Size:
        """`(height, width)` of the real screen."""
        return self._desktop.size

    def run(self, code: str) -> RunResult:
        """Make `code` the next action; return when it has been taken.

        Raises:
            _StoppedError: the episode is over.
        """
        self.code.put(code)
        if not self.done.get():
            raise _StoppedError("the episode is over")
        return RunResult("success", returncode=0)

    def screenshot(self) -> UInt8Array:
        """Return the real screen."""
        return self._desktop.screenshot()

    def accessibility(self) -> str:
        """Return the real tree."""
        return self._desktop.accessibility()

    def execute(self, argv: Sequence[str] | str, timeout: float = 60) -> RunResult:
        """Run a command for a lookup, such as of the home folder; this is not an action."""
        return self._desktop.execute(argv, timeout)

    def read_file(self, path: str) -> bytes:
        """Return the content of a real file."""
        return self._desktop.read_file(path)

    def write_file(self, path: str, data: bytes) -> None:
        """Refuse: an agent writes files with pointer and keyboard.

        Raises:
            DesktopError: always.
        """
        raise DesktopError(
            f"an oracle cannot write {path} behind the screen; it has to use the applications"
        )

    def reset(self, task: Mapping[str, Any] | None = None) -> None:
        """Refuse.

        Raises:
            DesktopError: always.
        """
        raise DesktopError("an oracle cannot reset the desktop")

    def close(self) -> None:
        """Do nothing, since the desktop belongs to the runner."""


class Oracle:
    """Solves a task by its own solution, one action at a time."""

    def __init__(self) -> None:
        self._task: Task | None = None
        self._machine: Machine | None = None
        self._desktop: OracleDesktop | None = None
        self._thread: threading.Thread | None = None
        self._failure = ""
        self._defect: Exception | None = None
        self._gave_up = False
        self._has_ended = False

    def reset(self) -> None:
        """End the solution of the last episode, if it still waits."""
        if self._thread is not None and self._desktop is not None:
            self._desktop.done.put(False)
            self._thread.join(SHUTDOWN_TIMEOUT_S)
        self._task = None
        self._machine = None
        self._desktop = None
        self._thread = None
        self._failure = ""
        self._defect = None
        self._gave_up = False
        self._has_ended = False

    def prepare(self, task: Task, machine: Machine) -> None:
        """Store the task to solve, and the machine to examine."""
        self._task = task
        self._machine = machine
        self._desktop = OracleDesktop(machine.desktop)

    def predict(self, instruction: str, obs: Observation) -> tuple[str, Sequence[str]]:
        """Return the next action of the solution.

        `DONE` follows the last one; `FAIL`, with the reason, if the solution cannot go on. The
        solution works in pixels of the real screen, actions are in those of the observation.

        Raises:
            DesktopError: `prepare` was not called, or the solution raised an error of its own.
        """
        if self._desktop is None or self._task is None:
            raise DesktopError("the oracle has no task yet: call prepare after reset")
        code = None if self._has_ended else self._next(self._task, self._desktop)
        if code is None:
            self._has_ended = True
            return self._last_words(self._task)
        height, width = obs["screenshot"].shape[:2]
        coords = CoordMap(observation=(height, width), screen=self._desktop.size)
        if code == REINIT:
            return "Something is wrong with the machine.", [code]
        return "", [coords.code_to_observation(code)]

    def _last_words(self, task: Task) -> tuple[str, Sequence[str]]:
        """Return the last answer; an oracle that failed must not pass for one that gave up rightly.

        On an infeasible task, `FAIL` is right only if the oracle found out that it is infeasible.
        """
        if self._gave_up:
            return self._failure, [FAIL]
        if self._failure:
            return self._failure, [DONE if task.infeasible else FAIL]
        return "The task is done.", [DONE]

    def _go_on(self, task: Task, desktop: OracleDesktop) -> None:
        """Let the solution continue to its next action."""
        if self._thread is not None:
            desktop.done.put(True)
            return
        self._thread = threading.Thread(
            target=self._solve, args=(task, desktop), name="oracle", daemon=True
        )
        self._thread.start()

    def _next(self, task: Task, desktop: OracleDesktop) -> str | None:
        self._go_on(task, desktop)
        try:
            code = desktop.code.get(timeout=ACTION_TIMEOUT_S)
        except queue.Empty:
            raise DesktopError(
                f"the solution of {task.id} had no next action within {ACTION_TIMEOUT_S:g} s"
            ) from None
        if self._defect is not None:
            raised = f"{type(self._defect).__name__}: {self._defect}"
            raise DesktopError(f"the solution of {task.id} raised {raised}") from self._defect
        return code

    def _solve(self, task: Task, desktop: OracleDesktop) -> None:
        try:
            self.solve(task, desktop)
        except _StoppedError:
            return
        except GiveUpError as error:
            self._gave_up = True
            self._failure = str(error)
        except HijackError as error:
            self._failure = f"{type(error).__name__}: {error}"
        except Exception as error:  # noqa: BLE001  (a task may raise anything; `predict` tells)
            self._defect = error
        desktop.code.put(None)

    def solve(self, task: Task, desktop: Desktop) -> None:
        """Play the task's solution."""
        task.oracle(Hand(desktop))


class Recovering(Oracle):
    """Solves a task as a careful user does, who notices disturbances and checks the result.

    It is the ceiling of a benchmark: no agent can be expected to do more.
    """

    TRIES = 3

    def solve(self, task: Task, desktop: Desktop) -> None:
        """Play the task's solution; if that fails, repair the disturbance and begin again.

        Raises:
            DesktopError: the last try failed, too.
            GiveUpError: The task is infeasible.
            DesktopTimeoutError: An element did not appear on the last try, too.
        """
        machine = self._machine
        if machine is None:
            raise DesktopError("the oracle has no task yet: call prepare after reset")
        command = task.initial_app(machine)
        start = machine.command_line(*command) if command else ""
        hand = CarefulHand(desktop, task.apps, start)
        hand.check_first_screen()
        for tries_left in reversed(range(self.TRIES)):
            try:
                task.oracle(hand)
            except GiveUpError:
                raise
            except DesktopTimeoutError:
                if not tries_left:
                    raise
            if not task.infeasible and task.validate(machine).passed:
                return
            hand.prepare_retry()
