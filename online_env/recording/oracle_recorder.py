"""Trajectories of oracles: every action, with the screen before it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

from hijack_data.actions import parse_pyautogui
from hijack_data.types import Action

from .. import tasks
from ..desktops.protocol import Desktop, RunResult
from ..embedded.desktop import EmbeddedDesktop
from ..embedded.sites.state import SiteState
from ..errors import DesktopError
from .stage import RecordingStage
from .trajectory import EpisodeRecording, RecordedView, prepare, save


class RecordingDesktop:
    """A desktop that records each `run`; everything else is passed on.

    Args:
        desktop: The machine.
        trajectory: The actions are added to it.
    """

    def __init__(self, desktop: EmbeddedDesktop, trajectory: EpisodeRecording) -> None:
        self._desktop = desktop
        self._stage = RecordingStage(desktop)
        self._trajectory = trajectory

    def __getattr__(self, name: str) -> Any:
        return getattr(self._desktop, name)

    def run(self, code: str) -> RunResult:
        """Run pyautogui code once the screen has settled, and record that screen."""
        action = parse_pyautogui(code, self._desktop.size)
        self._trajectory.add(RecordedView.of(self._stage), action, code)
        return self._desktop.run(code)

    def finish(self) -> None:
        """Record the last screen."""
        self._trajectory.add(RecordedView.of(self._stage), Action("done"), "DONE")


def record_task(
    name: str,
    seed: int,
    folder: Path,
    desktop: EmbeddedDesktop,
    say: Callable[[str], object] = print,
) -> str:
    """Let the oracle of a task act on a desktop, and append its actions to `folder`.

    A task that does not exist raises `UnknownNameError`.

    Returns:
        The trajectory's name.

    Raises:
        DesktopError: The oracle did not do the task; then nothing is written.
    """
    task = tasks.get(name, seed)
    prepare(folder)
    machine = tasks.Machine(desktop, SiteState(desktop.record["sites"]))
    trajectory = EpisodeRecording(task.id, task.instruction, task.apps)
    watched = RecordingDesktop(desktop, trajectory)
    task.setup(machine)
    task.oracle(tasks.Hand(cast("Desktop", watched)))
    watched.finish()
    verdict = task.validate(machine)
    if not verdict.passed:
        raise DesktopError(
            f"the oracle of {task.id} did not do the task ({verdict.reason}): nothing is recorded"
        )
    saved = save(trajectory, folder)
    say(f"{saved}: {len(trajectory.steps)} steps in {folder}")
    return saved
