"""Trajectories of people, from the page of `hijack desktop view`.

Each input is recorded before it is passed on.
"""

import json
import threading
from collections.abc import Callable
from typing import Any

from hijack_data.actions import parse_pyautogui
from hijack_data.errors import ActionError
from hijack_data.types import Action

from ..embedded.desktop import EmbeddedDesktop
from ..embedded.view import Viewer
from .action_recognizer import ActionRecognizer
from .stage import RecordingStage
from .trajectory import EpisodeRecording, RecordedView, visible_boxes

INPUT = "/ah/input"


class _RecordingClient:
    """The viewer's HTTP client, which gives each event to `actions` before it passes it on."""

    def __init__(self, client: Any, actions: ActionRecognizer[RecordedView]) -> None:
        self._client = client
        self._actions = actions
        self._lock = threading.Lock()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._client, name)

    def post(self, path: str, content: bytes, **options: Any) -> Any:
        """Pass input on, one event at a time: a screen is kept before each action begins."""
        events = _events_in(content) if path == INPUT else []
        if not events:
            # Not input, or no valid one: the guest answers what is wrong with it.
            return self._client.post(path, content=content, **options)
        answer: Any = None
        with self._lock:
            for event in events:
                self._record(event)
                single = json.dumps({"events": [event]}).encode()
                answer = self._client.post(path, content=single, **options)
                if answer.status_code != 200:
                    break
        return answer

    def _record(self, event: dict[str, Any]) -> None:
        try:
            self._actions.event(event)
        except (KeyError, TypeError):
            return  # our page does not send such an event, and the guest refuses it


def _events_in(content: bytes) -> list[dict[str, Any]]:
    try:
        events = json.loads(content)["events"]
        return [event for event in events if isinstance(event, dict)]
    except (ValueError, KeyError, TypeError):
        return []


class PersonViewer(Viewer):
    """The page of one desktop; the visitor's actions are added to a trajectory.

    Args:
        desktop: Where the person acts.
        trajectory: The actions are added to it.
        port: Where to listen; 0 picks a free port.
        say: Called with a line for each action.
    """

    def __init__(
        self,
        desktop: EmbeddedDesktop,
        trajectory: EpisodeRecording,
        port: int = 0,
        say: Callable[[str], object] = print,
    ) -> None:
        super().__init__(desktop.record, port)
        self._stage = RecordingStage(desktop)
        self._trajectory = trajectory
        self._say = say
        self.actions = ActionRecognizer(self._look, self._record_step)
        self.guest: Any = _RecordingClient(self.guest, self.actions)

    def finish(self) -> None:
        """End the action under way, and add the last screen."""
        self.actions.flush()
        self._trajectory.add(RecordedView.of(self._stage), Action("done"), "DONE")

    def _look(self) -> RecordedView:
        """Return the screen now, moving or not: the person acts upon it."""
        desktop = self._stage.desktop
        frame = desktop.screenshot()
        return RecordedView(frame, visible_boxes(self._stage, desktop.accessibility()))

    def _record_step(self, view: RecordedView, code: str) -> None:
        try:
            action = parse_pyautogui(code, self._stage.desktop.size)
        except ActionError as error:
            self._say(f"left out: {code!r}: {error}")
            return
        self._trajectory.add(view, action, code)
        self._say(f"step {len(self._trajectory.steps) - 1}: {code}")


def record_person(
    desktop: EmbeddedDesktop,
    trajectory: EpisodeRecording,
    port: int = 0,
    say: Callable[[str], object] = print,
) -> None:
    """Serve the page until Ctrl-C, and record what its visitor does."""
    with PersonViewer(desktop, trajectory, port, say) as viewer:
        say(f"act on desktop {desktop.id} at {viewer.url}  (Ctrl-C when it is done)")
        try:
            viewer.serve_forever()
        except KeyboardInterrupt:
            viewer.finish()
