"""Trajectories of oracles: a desktop that records every action which is run on it, with the screen before it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

from hijack_data.actions import parse_pyautogui
from hijack_data.types import Action

from .. import tasks
from ..desktops.embedded.desktop import EmbeddedDesktop
from ..desktops.protocol import Desktop, RunResult
from ..errors import DesktopError
from ..sites.state import SiteState
from .stage import Stage
from .trajectory import Trajectory, View, save


class Watched:
    """A desktop whose `run` is recorded; all else is passed on."""

    def __init__(self, desktop: EmbeddedDesktop, trajectory: Trajectory) -> None:
        self._desktop, self._stage, self._trajectory = desktop, Stage(desktop), trajectory

    def __getattr__(self, name: str) -> Any:
        return getattr(self._desktop, name)

    def run(self, code: str) -> RunResult:
        """Run pyautogui code once the screen stands still, and keep that screen."""
        action = parse_pyautogui(code, self._desktop.size)
        self._trajectory.add(View.of(self._stage), action, code)
        return self._desktop.run(code)

    def done(self) -> None:
        """The last screen."""
        self._trajectory.add(View.of(self._stage), Action("done"), "DONE")


def record_task(
    name: str, seed: int, folder: Path, desktop: EmbeddedDesktop, say: Callable[[str], object] = print
) -> str:
    """Let the oracle of a task act on a desktop, and append what it did to `folder`; returns the trajectory's name.

    Raises `UnknownNameError` for a task that does not exist, `DesktopError` where the oracle did not do the task: then
    nothing is written.
    """
    task = tasks.get(name, seed)
    sites = SiteState(desktop.record["sites"])
    trajectory = Trajectory(task.id, task.instruction, task.apps)
    watched = Watched(desktop, trajectory)
    task.setup(desktop, sites)
    task.oracle(cast("Desktop", watched))
    watched.done()
    verdict = task.validate(desktop, sites)
    if not verdict.passed:
        raise DesktopError(f"the oracle of {task.id} did not do the task ({verdict.reason}): nothing is recorded")
    saved = save(trajectory, folder)
    say(f"{saved}: {len(trajectory.steps)} steps in {folder}")
    return saved
