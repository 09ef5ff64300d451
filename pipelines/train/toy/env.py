"""The toy desktop as a gymnasium environment, with the interface of `CorruptedEnv`."""

import re
from dataclasses import replace
from typing import Any

import gymnasium

import hijack_data as hj
from hijack_data.errors import HijackError, ParameterTypeError
from hijack_data.planner import Planner
from hijack_data.spaces import Text, observations

from .screens import Cover, ToyScreen, ToyState, paint_screen
from .tasks import HEIGHT, WIDTH, ToyTask, toy_task

DONE = "DONE"
_CLICK = re.compile(r"click\((\d+), (\d+)\)")
# What the effects of `hijack_data` do here.
_COVERS: dict[str, Cover] = {
    "minimise": "minimised",
    "lock": "locked",
    "firewall": "offline",
    "touch": "touched",
}
_LAUNCH = "launch_app"


class ToyEnv(gymnasium.Env[dict[str, Any], str]):
    """One task on the toy desktop.

    An observation is `{"screenshot": uint8 [64, 96, 3], "instruction": str}`. An action is
    `click(x, y)` in pixels of the screenshot, or `DONE`; any other is counted as malformed, and
    does nothing. A click on a wrong element ends the episode with score 0, because its result
    cannot be undone.

    Picture corruptions are planned and applied at every step, effects when they are due. A cover
    (lock screen, error page, dialog, no window) goes away by a click on the element that it shows.

    Args:
        task: the task of the first episode.
        corruption: a planner, or `None`; the option `corruption` of `reset` replaces both.
        max_steps: actions until an episode is cut off.
    """

    def __init__(
        self, task: str = "toy-00000", *, corruption: Planner | None = None, max_steps: int = 6
    ) -> None:
        self.observation_space = observations((HEIGHT, WIDTH))
        self.action_space = Text()
        self.record: dict[str, Any] | None = None
        self._defaults = {"task": task, "corruption": corruption}
        self._max_steps = max_steps
        self._task = toy_task(task)
        self._planner = corruption
        self._state = ToyState()
        self._seed = 0
        self._steps = 0
        self._malformed = 0
        self._last: dict[str, Any] = {}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: decides what the corruption draws; 0 if omitted.
            options: `task`, `corruption` (a planner or `None`) and `label`, which is ignored.

        Raises:
            ParameterTypeError: `corruption` is not a planner.
        """
        super().reset(seed=seed)
        settings = {**self._defaults, **(options or {})}
        planner = settings["corruption"]
        if planner is not None and not isinstance(planner, Planner):
            raise ParameterTypeError(f"corruption must be a planner or None, got {planner!r}")
        self._task = toy_task(settings["task"])
        self._planner = planner
        self._state = ToyState()
        self._seed = seed or 0
        self._steps = 0
        self._malformed = 0
        self.record = None
        self._disturb(-1)
        self._disturb(0)
        return self._observe(), {}

    def step(self, action: str) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Take one action; the reward is 1 for `DONE` after the task was done.

        When an episode ends, the screen is not drawn again: the last observation is returned, and
        so it is by each further step, truncated.
        """
        if self.record is not None:
            return dict(self._last), 0.0, False, True, {}
        self._steps += 1
        over, score = self._act(action)
        truncated = not over and self._steps >= self._max_steps
        if over or truncated:
            self._end(score)
            return dict(self._last), score, over, truncated, {}
        self._disturb(self._steps)
        return self._observe(), score, False, False, {}

    def truncate(self) -> None:
        """End the episode as it stands."""
        if self.record is None:
            self._end(0.0)

    @property
    def screen(self) -> ToyScreen:
        """The screen without corruptions of the picture; not for an agent."""
        return paint_screen(self._task.name, self._state)

    @property
    def task(self) -> ToyTask:
        """The task; not for an agent."""
        return self._task

    @property
    def is_solved(self) -> bool:
        """Whether only `DONE` is left to say; not for an agent."""
        state = self._state
        return state.clicks_done == self._task.length and not state.cover and not state.menu

    def _act(self, action: str) -> tuple[bool, float]:
        """Return whether the episode is over, and its score."""
        if action.strip() == DONE:
            return True, float(self._state.clicks_done == self._task.length)
        click = _CLICK.fullmatch(action.strip())
        if click is None:
            self._malformed += 1
            return False, 0.0
        return self._click(int(click[1]), int(click[2]))

    def _click(self, x: int, y: int) -> tuple[bool, float]:
        match self.screen.at(x, y):
            case "wrong":
                return True, 0.0
            case "right":
                self._state = replace(
                    self._state, clicks_done=self._state.clicks_done + 1, menu=False
                )
            case "menu":
                self._state = replace(self._state, menu=True)
            case "close":
                self._state = replace(self._state, menu=False)
            case "recover":
                self._state = replace(self._state, cover="")
            case _:
                pass
        return False, 0.0

    def _end(self, score: float) -> None:
        self.record = {
            "status": "ok",
            "score": score,
            "malformed": self._malformed,
            "steps": self._steps,
        }

    def _plan(self, step: int) -> hj.Plan | None:
        if self._planner is None or not self._planner.is_due(step):
            return None
        scene = hj.Scene(size=(HEIGHT, WIDTH), boxes=self.screen.boxes)
        return self._planner.plan(scene, seed=self._seed, sample=self._task.name, step=step)

    def _disturb(self, step: int) -> None:
        """Apply the effects that are due.

        Raises:
            HijackError: the toy desktop has no such effect, or the agent's input is to be changed.
        """
        if self._planner is not None and self._planner.inputs:
            kinds = ", ".join(self._planner.inputs)
            raise HijackError(f"the toy desktop does not change an agent's input ({kinds})")
        if self._planner is None or not self._planner.effects:
            return
        plan = self._plan(step)
        for effect in () if plan is None else plan.effects:
            if effect.kind == _LAUNCH:
                self._state = replace(self._state, beside=True)
            elif effect.kind in _COVERS:
                self._state = replace(self._state, cover=_COVERS[effect.kind], menu=False)
            else:
                raise HijackError(f"the toy desktop has no effect {effect.kind!r}")

    def _observe(self) -> dict[str, Any]:
        pixels = self.screen.pixels
        plan = self._plan(self._steps)
        if plan is not None and plan.ops:
            pixels = hj.apply(plan, pixels)
        self._last = {"screenshot": pixels.copy(), "instruction": self._task.instruction}
        return self._last
