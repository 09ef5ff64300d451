"""OpenEnv's side of a session: its messages, and its `Environment` class."""

import base64
from typing import Any

from openenv.core.env_server.interfaces import Environment  # pyright: ignore[reportMissingImports]
from openenv.core.env_server.types import Action, EnvironmentMetadata, Observation, State  # pyright: ignore[reportMissingImports]
from pydantic import Field

from hijack_data import __version__
from hijack_data.errors import ParameterError, UnknownNameError, shorten_list, suggest
from hijack_data.png import encode

from ..agents.adapters.action_codes import PYAUTOGUI
from .episode_draws import HELD_OUT, TRAINING
from .service import DesktopService
from .sessions import DesktopSession, SessionView

NAME = "agenthijack"
OPTIONS = ("seed", "episode_id", "task", "corruption", "slot", "split", "index")
SPLIT_TYPES = {TRAINING: "train", HELD_OUT: "test"}
DESCRIPTION = (
    "Tasks on a real Linux desktop that is corrupted on purpose: pop-ups, marks, subtitles, a"
    " lower resolution, foreign windows, accidental touches, minimised windows, no network, a lock"
    " screen."
)


class DesktopAction(Action):
    """One action of the agent."""

    action: str | dict[str, Any] = Field(
        description=(
            "pyautogui code in pixels of the screenshot, WAIT, DONE or FAIL; or what `dialect` has"
            " in their place"
        )
    )
    dialect: str = Field(
        default=PYAUTOGUI,
        description="How `action` is written: pyautogui, computer_13, ui_tars_1.5, openai ...",
    )


class DesktopObservation(Observation):
    """The observation of the agent, without anything that it must not know."""

    screenshot: str = Field(description="The screen as PNG, in base64")
    width: int = Field(description="Of the screenshot, in pixels")
    height: int = Field(description="Of the screenshot, in pixels")
    instruction: str = Field(description="What the agent is asked to do")
    truncated: bool = Field(default=False, description="Whether a limit or a failure ended it")


class DesktopState(State):
    """The state for the trainer but not for the agent; `record` is the record of the episode."""

    task: str | None = None
    seed: int | None = None
    slot: int | None = None
    corruption: str | None = None
    planner: dict[str, Any] | None = Field(
        default=None, description="The corruption with every parameter; null for a clean episode"
    )
    draw: str | None = Field(default=None, description="By which the corruption was drawn")
    record: dict[str, Any] | None = Field(default=None, description="After the end")


class DesktopEnvironment(Environment[DesktopAction, DesktopObservation, DesktopState]):
    """A session of OpenEnv. Making one is cheap, and closing it twice is fine.

    Args:
        service: The state shared by the sessions of a server.
    """

    SUPPORTS_CONCURRENT_SESSIONS = True

    def __init__(self, service: DesktopService) -> None:
        super().__init__()
        self._service = service
        self._session = DesktopSession(service)
        self._episode: str | None = None

    def reset(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, seed: int | None = None, episode_id: str | None = None, **options: Any
    ) -> DesktopObservation:
        """Begin an episode.

        Args:
            seed: Of the task's variant and of all that the corruption draws.
            episode_id: A name of the client's, which `state` repeats.
            **options: `task`, `corruption`, `slot`; or `split` and `index` of the task API.

        Raises:
            UnknownNameError: There is no such option, task or corruption.
            ParameterError: The task is given twice.
        """
        for key in options:
            if key not in OPTIONS:
                raise UnknownNameError(f"reset has no option {key!r:.80}{suggest(key, OPTIONS)}")
        if "split" in options or "index" in options:
            if options.get("task") is not None:
                raise ParameterError("reset takes task, or split and index, not both")
            options["task"] = self._indexed(options.pop("split", None), options.pop("index", 0))
        view = self._session.reset(seed=seed, **options)
        self._episode = episode_id
        return _observation(view)

    def step(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, action: DesktopAction, timeout_s: float | None = None, **_: Any
    ) -> DesktopObservation:
        """Take an action.

        Args:
            action: Of the agent.
            timeout_s: Not used: the desktop has limits of its own.
        """
        return _observation(self._session.step(action.action, action.dialect))

    @property
    def state(self) -> DesktopState:
        """Return what is known about the current episode, without asking the desktop."""
        session = self._session
        state = DesktopState(
            episode_id=self._episode, step_count=session.steps, record=session.record
        )
        choice = session.choice
        if choice is None:
            return state
        return state.model_copy(
            update={
                "task": choice.task,
                "seed": choice.seed,
                "slot": choice.slot,
                "corruption": choice.label,
                "planner": None if choice.planner is None else choice.planner.to_config(),
                "draw": choice.key or None,
            }
        )

    def close(self) -> None:
        """Give the desktop back."""
        self._session.close()

    def get_metadata(self) -> EnvironmentMetadata:
        """Return the content of OpenEnv's `/metadata`."""
        return EnvironmentMetadata(name=NAME, description=DESCRIPTION, version=__version__)

    def list_splits(self) -> list[dict[str, str]]:
        """Return the sides of the split that are served, with OpenEnv's word for each."""
        return [{"name": side, "type": SPLIT_TYPES[side]} for side in self._service.splits]

    def list_tasks(self, split: str) -> list[dict[str, Any]]:
        """Return the tasks of a side."""
        return [_task(name, index) for index, name in enumerate(self._names(split))]

    def num_tasks(self, split: str) -> int:
        """Return how many tasks a side has."""
        return len(self._names(split))

    def get_task(self, split: str, index: int) -> dict[str, Any]:
        """Return one task of a side."""
        return _task(self._indexed(split, index), index)

    def get_task_range(
        self, split: str, start: int | None = None, stop: int | None = None
    ) -> list[dict[str, Any]]:
        """Return the tasks of a side from `start` to before `stop`."""
        return self.list_tasks(split)[start:stop]

    def _names(self, split: object) -> tuple[str, ...]:
        splits = self._service.splits
        if not isinstance(split, str) or split not in splits:
            raise UnknownNameError(
                f"no split {split!r:.80} is served; there are: {shorten_list([*splits])}"
            )
        return splits[split]

    def _indexed(self, split: object, index: object) -> str:
        """Return the name of a task of a side.

        Raises:
            IndexError: There are fewer tasks.
        """
        names = self._names(split)
        if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < len(names):
            raise IndexError(f"index must be 0 to {len(names) - 1}, got {index!r:.80}")
        return names[index]


def _task(name: str, index: int) -> dict[str, Any]:
    return {"id": name, "index": index}


def _observation(view: SessionView) -> DesktopObservation:
    height, width = view.size
    ending = {"status": view.status, "problem": view.problem} if view.done else {}
    return DesktopObservation(
        screenshot=base64.b64encode(encode(view.picture)).decode("ascii"),
        width=width,
        height=height,
        instruction=view.instruction,
        truncated=view.truncated,
        done=view.done,
        reward=view.reward,
        metadata={key: value for key, value in ending.items() if value},
    )
