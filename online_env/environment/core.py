"""`CorruptedEnv`: the gymnasium interface of the live environment; see docs/live_evaluation.md."""

import copy
import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar, Unpack

import gymnasium

from hijack_data.errors import HijackError, ParameterError, UnknownNameError
from hijack_data.kernels.cpu import jit
from hijack_data.planner import Planner
from hijack_data.runs.run_log import GIVEN_KINDS
from hijack_data.spaces import Actions, observations
from hijack_data.types import Size, UInt8Array

from .episode import Episode
from .record import End, EpisodeRecord
from .runner import EpisodeRunner, ResetOptions, checked_seed, ready
from .settings import EvalOptions, EvalSettings
from .stage import Stage

_DEFAULTS = EvalSettings()
INFO = "agenthijack"  # the key in `info`, with `reveal=True`


class CorruptedEnv(gymnasium.Env[dict[str, Any], str]):
    """A task on a live desktop under a corruption.

    An observation is `{"screenshot": uint8 RGB [H, W, 3], "instruction": str}`, in the size that
    the corruption gives it; `info` is empty unless `reveal` is set. An action is `WAIT`, `DONE`,
    `FAIL`, `REQUEST_REINIT`, or pyautogui code (also in a ``` fence), in pixels of the screenshot.
    Any other action is rejected: nothing is executed and the step is counted as malformed.

    `observation_space` and `action_space` are those of the desktop and the corruption given here.
    A `reset` whose corruption changes the size of the picture replaces both before it returns; a
    corruption that would change the size within an episode is refused.

    Give an agent what `reset` and `step` return, and keep the environment to yourself: Python code
    in the same process can look into any object. `hijack bench` therefore runs agents of users in
    processes of their own.

    Args:
        stage: The desktop and its tasks.
        corruption: A name, a `Corruption`, any planner (`Sequence`, `OneOf`), or `None` for a
            clean run.
        settings: What holds for every episode.
        render_mode: `"rgb_array"` makes `render` return what the agent sees.
        reveal: Whether `info["agenthijack"]` has what an agent must not see, as JSON data: `task`,
            `corruption` (its label), `seed`, `step`, `plan` (of the present picture), `events` (of
            its effects) and `record` (`None` until the episode is over).
        **changes: Fields of `EvalSettings` (`max_steps`, `settle`, `recovery`,
            `environment_errors`, `allow_code`, `log`, `agent`, `password`, `text_boxes`,
            `layer`) that
            replace those of `settings`.

    Raises:
        UnknownNameError: The corruption, recovery policy or render mode does not exist.
        ParameterTypeError: `corruption` is neither a name nor a planner.
        ParameterError: A setting is out of range.
        DesktopError: The desktop does not answer.
    """

    metadata: ClassVar[dict[str, Any]] = {  # pyright: ignore
        "render_modes": ["rgb_array"],
        "render_fps": 1,
    }

    def __init__(
        self,
        stage: Stage,
        *,
        corruption: str | Planner | None = None,
        settings: EvalSettings = _DEFAULTS,
        render_mode: str | None = None,
        reveal: bool = False,
        **changes: Unpack[EvalOptions],
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise UnknownNameError(f"no render mode {render_mode!r}; known: rgb_array")
        self.render_mode = render_mode
        self._reveal = reveal
        self._runner = EpisodeRunner(stage, corruption, replace(settings, **changes))
        # From the first picture on, rather than after some hundred, in the middle of an episode.
        jit.start()
        self._resize(self._runner.size)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin an episode on a pristine desktop.

        If an effect fails, the episode is over at once and the status of `record` is `invalid`.

        Args:
            seed: Decides the task's variant, all draws of the corruption, and `np_random` as
                gymnasium seeds it; drawn from `np_random` if omitted.
            options: `task` (what the stage takes; default: the stage's own), `corruption` (as in
                the constructor; default: the one given there), `label` (its name in the record,
                not that of another condition), `attempt` (0, 1, 2 ...; default: the first that is
                not in the log).

        Returns:
            The first observation and `info`.

        Raises:
            HijackError: The environment is closed.
        """
        checked = ResetOptions.read(options)
        seed_number = checked_seed(seed)
        runner = self._runner
        if runner.closed:
            raise HijackError("the environment is closed; make another one")
        runner.leave("the environment was reset before the end")
        super().reset(seed=seed_number)
        if seed_number is None:
            seed_number = int(self.np_random.integers(2**32))
        self._resize(runner.begin(seed_number, checked))
        episode = ready(runner)
        return _observation(episode), self._info(episode)

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Take one action.

        After the end of an episode this returns the last observation, truncated.

        Returns:
            The next observation; the reward (the score, 0 to 1, at the end of the episode, and 0
            before it); terminated (the agent answered `DONE` or `FAIL`); truncated (`max_steps`,
            or the episode failed: see `record`); `info`.
        """
        episode = ready(self._runner)
        reward, terminated, truncated = episode.act(action)
        return _observation(episode), reward, terminated, truncated, self._info(episode)

    @property
    def record(self) -> EpisodeRecord | None:
        """The record of the episode, as JSON data, not for agents; `None` until it is over."""
        episode = self._runner.episode
        return None if episode is None else copy.deepcopy(episode.record)

    def record_message(self, text: str) -> None:
        """Record the text that the agent writes with its next action.

        Args:
            text: The agent's words; the record keeps the first 2000 characters.
        """
        episode = self._runner.episode
        if episode is not None:
            episode.record_message(text)

    def record_usage(self, usage: dict[str, Any]) -> None:
        """Record the usage that the agent has reported so far, such as tokens.

        Args:
            usage: JSON data; it replaces what was recorded for this episode.

        Raises:
            ParameterError: It is not JSON data.
        """
        try:
            json.dumps(usage, allow_nan=False)
        except (TypeError, ValueError) as error:
            raise ParameterError(f"usage must be JSON data, for the record: {error}") from None
        episode = self._runner.episode
        if episode is not None:
            episode.record_usage(usage)

    def record_guard(self, guard: dict[str, Any]) -> None:
        """Record what watches the agent, and what it did so far (`Guarded.guard_record`).

        Args:
            guard: JSON data; it replaces what was recorded for this episode.
        """
        episode = self._runner.episode
        if episode is not None:
            episode.record_guard(guard)

    def declare_privileged_inputs(self, kinds: Sequence[str]) -> None:
        """Record what the agent is given in addition to instruction and pictures.

        Without this call, the record states that this is unknown.

        Args:
            kinds: Some of `run_log.GIVEN_KINDS`; empty for nothing.

        Raises:
            ParameterError: An item is not one of these.
        """
        for kind in kinds:
            if kind not in GIVEN_KINDS:
                raise ParameterError(f"given is one of {', '.join(GIVEN_KINDS)}, got {kind!r:.100}")
        episode = self._runner.episode
        if episode is not None:
            episode.declare_privileged_inputs([kind for kind in GIVEN_KINDS if kind in kinds])

    def truncate(self) -> None:
        """Judge the episode as it stands, if a limit outside this environment ended it.

        `reset` and `close` do so by themselves. Nothing happens if the agent took no action or
        the episode is over.
        """
        episode = self._runner.episode
        if episode is not None:
            episode.truncate()

    def abandon(self, why: str, traceback: Sequence[str] = ()) -> None:
        """End the episode with the status `error`, as the agent's failure.

        Nothing happens if no episode is under way.

        Args:
            why: The problem, for the record.
            traceback: Where the agent raised, the innermost call last.
        """
        end = End(status="error", problem=why, cause="agent", traceback=tuple(traceback))
        self._runner.end(end)

    def render(self) -> Any:
        """Return what the agent sees, uint8 RGB `[H, W, 3]`, in render mode `"rgb_array"`."""
        episode = self._runner.episode
        if self.render_mode is None or episode is None or episode.view is None:
            return None
        return episode.view.picture.copy()

    def close(self) -> None:
        """Undo all effects, end the episode, and close the stage, which ends the desktop.

        Calling it again does nothing.
        """
        self._runner.close()

    def _info(self, episode: Episode) -> dict[str, Any]:
        return {INFO: episode.reveal()} if self._reveal else {}

    def _resize(self, size: Size) -> None:
        actions = Actions(size)
        if getattr(self, "action_space", None) != actions:
            self.action_space = actions
            self.observation_space = observations(size)


def _observation(episode: Episode) -> dict[str, Any]:
    if episode.view is None:
        raise HijackError("no episode is under way: call reset first")
    picture: UInt8Array = episode.view.picture.copy()  # a copy, which the agent may modify
    return {"screenshot": picture, "instruction": episode.instruction}
