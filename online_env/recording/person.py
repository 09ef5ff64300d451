"""Trajectories of people: the page of `hijack desktop view`, whose every input is noted before it is passed on."""

import json
import threading
from collections.abc import Callable
from typing import Any

from hijack_data.actions import parse_pyautogui
from hijack_data.errors import ActionError
from hijack_data.types import Action

from ..desktops.embedded.desktop import EmbeddedDesktop
from ..desktops.embedded.view import Viewer
from .deeds import Deeds
from .stage import Stage
from .trajectory import Trajectory, View, visible_boxes

INPUT = "/ah/input"


class _Passing:
    """The guest's HTTP client of the viewer, which shows each event to `deeds` before it goes on."""

    def __init__(self, client: Any, deeds: Deeds[View]) -> None:
        self._client, self._deeds, self._lock = client, deeds, threading.Lock()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._client, name)

    def post(self, path: str, content: bytes, **options: Any) -> Any:
        """Pass input on, one event at a time, so that each action begins on a screen that was kept."""
        if path != INPUT:
            return self._client.post(path, content=content, **options)
        try:
            events = [event for event in json.loads(content)["events"] if isinstance(event, dict)]
        except (ValueError, KeyError, TypeError):
            return self._client.post(path, content=content, **options)  # the guest says what is wrong
        with self._lock:
            answer = None
            for event in events:
                self._note(event)
                answer = self._client.post(path, content=json.dumps({"events": [event]}).encode(), **options)
                if answer.status_code != 200:
                    break
        return answer or self._client.post(path, content=content, **options)

    def _note(self, event: dict[str, Any]) -> None:
        try:
            self._deeds.event(event)
        except (KeyError, TypeError):
            return  # not what our page sends: the guest refuses it


class PersonViewer(Viewer):
    """The page of one desktop, whose visitor's actions are added to a trajectory.

    Args:
        desktop: where the person acts.
        trajectory: what the actions are added to.
        port: where to listen; 0 picks a free port.
        say: told of each action.
    """

    def __init__(
        self, desktop: EmbeddedDesktop, trajectory: Trajectory, port: int = 0, say: Callable[[str], object] = print
    ) -> None:
        super().__init__(desktop.record, port)
        self._stage, self._trajectory, self._say = Stage(desktop), trajectory, say
        self.deeds = Deeds(self._look, self._done)
        self.guest: Any = _Passing(self.guest, self.deeds)

    def finish(self) -> None:
        """End the action under way, and add the last screen."""
        self.deeds.flush()
        self._trajectory.add(View.of(self._stage), Action("done"), "DONE")

    def _look(self) -> View:
        """The screen at this moment, moving or not: it is what the person acts upon."""
        frame = self._stage.desktop.screenshot()
        return View(frame, visible_boxes(self._stage, self._stage.desktop.accessibility()))

    def _done(self, view: View, code: str) -> None:
        try:
            action = parse_pyautogui(code, self._stage.desktop.size)
        except ActionError as error:
            self._say(f"left out: {code!r}: {error}")
            return
        self._trajectory.add(view, action, code)
        self._say(f"step {len(self._trajectory.steps) - 1}: {code}")


def record_person(
    desktop: EmbeddedDesktop, trajectory: Trajectory, port: int = 0, say: Callable[[str], object] = print
) -> None:
    """Serve the page until Ctrl-C, and note what its visitor does."""
    with PersonViewer(desktop, trajectory, port, say) as viewer:
        say(f"act on desktop {desktop.id} at {viewer.url}  (Ctrl-C when it is done)")
        try:
            viewer.serve_forever()
        except KeyboardInterrupt:
            viewer.finish()
