"""What plays the episodes of an environment; `CorruptedEnv` is the gymnasium interface of it."""

import operator
import sys
from dataclasses import dataclass
from typing import Any, cast

from hijack_data.corruption import CORRUPTIONS
from hijack_data.errors import (
    HijackError,
    ParameterError,
    ParameterTypeError,
    UnknownNameError,
    suggest,
)
from hijack_data.plan import CLEAN
from hijack_data.planner import Planner
from hijack_data.runs.run_planners import get_label
from hijack_data.types import Size

from ..embedded.runtime import hidden_folders
from .episode import Episode
from .record import End, EpisodeRequest
from .script import Script, find_planner
from .settings import EvalSettings
from .stage import Stage

_OPTIONS = ("task", "corruption", "label", "attempt")


class EpisodeRunner:
    """Plays episodes on a stage, one after the other.

    Args:
        stage: The desktop and its tasks.
        corruption: The corruption of episodes whose `reset` names none.
        settings: What holds for every episode.
    """

    def __init__(
        self, stage: Stage, corruption: str | Planner | None, settings: EvalSettings
    ) -> None:
        self.settings = settings
        self.episode: Episode | None = None
        self.closed = False
        self._stage = stage
        self._planner = find_planner(corruption)
        if settings.folder is not None:
            hidden_folders.hide(settings.folder)

    @property
    def size(self) -> Size:
        """The size of the agent's pictures under the default corruption, (height, width)."""
        script = Script(self._planner, 0, "", (), self._stage.desktop.size)
        return script.plan(0).out_size

    def begin(self, seed: int, options: "ResetOptions") -> Size:
        """Begin an episode; it is `episode` from now on.

        Returns:
            The size of the agent's pictures, (height, width).

        Raises:
            ParameterError: The label is the name of another condition.
        """
        planner = self._planner
        if options.has_corruption:
            planner = find_planner(options.corruption)
        label = options.label or get_label(planner)
        if label != get_label(planner) and label in (CLEAN, *CORRUPTIONS.names()):
            raise ParameterError(
                f"label {label!r} names another condition than {get_label(planner)}, whose episodes"
                " would be counted as its own; choose another label"
            )
        request = EpisodeRequest(
            planner=planner, label=label, task=options.task, seed=seed, attempt=options.attempt
        )
        self.episode = Episode(self._stage, self.settings, request)
        return self.episode.begin()

    def end(self, end: End) -> None:
        """End the current episode, if there is one."""
        if self.episode is not None:
            self.episode.end(end)

    def leave(self, why: str) -> None:
        """End the current episode.

        It is judged, unless an exception is being handled: then it ends as an error.
        """
        raised = sys.exception()
        if raised is not None:
            why = f"{why}, while {type(raised).__name__} was handled"
        elif self.episode is not None:
            self.episode.truncate()
        self.end(End(status="error", problem=why, cause="outside"))

    def close(self) -> None:
        """End the episode and close the stage; calling it again does nothing."""
        if self.closed:
            return
        self.closed = True
        try:
            self.leave("the environment was closed before the end")
        finally:
            self._stage.close()


@dataclass(frozen=True, kw_only=True)
class ResetOptions:
    """The options of `CorruptedEnv.reset`, checked."""

    task: Any
    corruption: Any
    has_corruption: bool
    label: str | None
    attempt: int | None

    @classmethod
    def read(cls, options: dict[str, Any] | None) -> "ResetOptions":
        """Check the given options.

        Raises:
            UnknownNameError: An option is unknown; the message suggests the closest name.
            ParameterTypeError: `label` or `attempt` is of the wrong type.
        """
        values = options or {}
        for key in values:
            if key not in _OPTIONS:
                raise UnknownNameError(f"reset has no option {key!r}{suggest(key, _OPTIONS)}")
        return cls(
            task=values.get("task"),
            corruption=values.get("corruption"),
            has_corruption="corruption" in values,
            label=_checked_label(values.get("label")),
            attempt=_checked_attempt(values.get("attempt")),
        )


def checked_seed(value: object) -> int | None:
    """Return a seed as an integer in [0, 2**64 - 1]; `None` stays `None`.

    Raises:
        ParameterTypeError: It is not an integer.
        ParameterError: It is out of range.
    """
    if value is None:
        return None
    if isinstance(value, bool) or not hasattr(value, "__index__"):
        raise ParameterTypeError(f"seed must be an integer, got {value!r:.80}")
    number = operator.index(cast(Any, value))
    if not 0 <= number < 2**64:
        raise ParameterError(f"seed must be in [0, 2**64 - 1], got {number}")
    return number


def ready(runner: EpisodeRunner) -> Episode:
    """Return the episode of a runner that has begun one.

    Raises:
        HijackError: There was no `reset`, or it failed.
    """
    episode = runner.episode
    if episode is None or episode.view is None:
        raise HijackError("no episode is under way: call reset first")
    return episode


def _checked_label(label: object) -> str | None:
    if label is None:
        return None
    if not isinstance(label, str) or not label:
        raise ParameterTypeError(f"label must be a non-empty string, got {label!r:.80}")
    return label


def _checked_attempt(attempt: object) -> int | None:
    if attempt is None:
        return None
    if isinstance(attempt, bool) or not isinstance(attempt, int) or attempt < 0:
        raise ParameterTypeError(f"attempt must be an integer of at least 0, got {attempt!r:.80}")
    return attempt
