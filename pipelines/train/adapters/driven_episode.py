"""One rollout of a gymnasium environment, driven by another library's trainer."""

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import gymnasium
from PIL import Image

from hijack_data.actions import DIALECTS, code_of, unreadable_action
from hijack_data.errors import ActionError, UnknownNameError, suggest

from ..objective import reward
from ..rollouts import AgentObservation, Rollout, RolloutRequest

MakeEnvironment: TypeAlias = Callable[[], gymnasium.Env[Any, str]]
ATTEMPTS = 2  # tries of a reset; the second one uses a new environment


@dataclass(kw_only=True)
class TokenRollout(Rollout):
    """A rollout whose tokens the trainer keeps.

    Args:
        answers: the number of actions taken.
        tokens: the trainer's own data for training on the rollout again.
    """

    answers: int = 0
    tokens: Any = field(default=None, repr=False)

    @property
    def counts(self) -> bool:
        """Whether it can be trained on; an agent that never acted counts as failed."""
        return self.status == "ok"

    def reward(self, weight: float = 1.0) -> float | None:
        """Return success + format, or `None` for a rollout that does not count.

        Args:
            weight: of the penalty of a wrong form.
        """
        return reward(self.success, self.is_well_formed, weight) if self.counts else None

    def to_data(self) -> dict[str, Any]:
        """Return the rollout as JSON data, without pictures and tokens."""
        return {**super().to_data(), "turns": self.answers}


class DrivenEpisode:
    """Plays rollouts in an environment, one after the other, without raising for machine failures.

    Args:
        make: makes the environment; it is called with the first `reset`, and again for an
            environment that failed in one.
        dialect: what the policy writes, one of `hijack_data.actions.DIALECTS`; its actions become
            pyautogui code. `None` for the text that the environment takes.

    Raises:
        UnknownNameError: there is no such dialect.
    """

    def __init__(self, make: MakeEnvironment, dialect: str | None = None) -> None:
        if dialect is not None and dialect not in DIALECTS:
            raise UnknownNameError(f"dialect: no {dialect!r}{suggest(dialect, DIALECTS)}")
        self.rollout: TokenRollout | None = None
        self.is_over = True
        self._make = make
        self._dialect = dialect
        self._picture: Any = None  # the last one that the policy saw
        self._env: gymnasium.Env[Any, str] | None = None

    def reset(self, request: RolloutRequest) -> AgentObservation | None:
        """Begin a rollout; return the first observation, or `None` if the reset failed.

        Raises:
            UnknownNameError: the environment does not know the task.
        """
        self.rollout = TokenRollout(request=request)
        self.is_over = True
        for attempt in range(ATTEMPTS):
            try:
                self._env = self._env or self._make()
                observation, _ = self._env.reset(seed=request.seed, options=request.options())
            except UnknownNameError:
                raise
            except Exception as error:  # noqa: BLE001  (whatever a foreign environment raises)
                self.close()
                if attempt == ATTEMPTS - 1:
                    self._fail("reset", error)
                continue
            self.is_over = self._record() is not None
            self._picture = observation.get("screenshot")
            return None if self.is_over else observation
        return None

    def step(self, answer: str) -> AgentObservation | None:
        """Take the actions of an answer; return the next observation, or `None` after the end."""
        observation: AgentObservation | None = None
        if self.rollout is not None and not self.is_over:
            self.rollout.answers += 1
            for action in self._read(answer):
                observation = self._act(action)
        if observation is not None:
            self._picture = observation.get("screenshot")
        return observation

    def _read(self, answer: str) -> list[str]:
        """Return the actions of an answer; one that cannot be read is malformed there, too."""
        if self._dialect in (None, "pyautogui"):
            return [answer]
        height, width = self._picture.shape[:2]
        try:
            codes = code_of(answer, self._dialect, (height, width))
        except ActionError as error:
            return [unreadable_action(error, answer)]
        return codes or [unreadable_action(ActionError("no action in the answer"), answer)]

    def _act(self, action: str) -> AgentObservation | None:
        if self.is_over or self._env is None or self.rollout is None:
            return None
        try:
            observation, score, terminated, truncated, _ = self._env.step(action)
        except Exception as error:  # noqa: BLE001  (whatever a foreign environment raises)
            self._fail("step", error)
            self.close()
            return None
        self.rollout.take_reward(score)
        self.is_over = bool(terminated or truncated) or self.rollout.status != "ok"
        return None if self.is_over else observation

    def finish(self) -> TokenRollout:
        """End the episode in its present state, and return the judged rollout; may be called again.

        Raises:
            RuntimeError: no rollout was begun.
        """
        if self.rollout is None:
            raise RuntimeError("finish() before reset()")
        if self._env is None or self.rollout.status != "ok":  # it failed
            return self.rollout
        self.is_over = True
        try:
            if self._record() is None:
                truncate = getattr(self._env.unwrapped, "truncate", None)
                if callable(truncate):
                    truncate()
        except Exception as error:  # noqa: BLE001  (whatever a foreign environment raises)
            self._fail("truncate", error)
            self.close()
            return self.rollout
        record = self._record()
        if record is not None:
            self.rollout.judge(record)
        return self.rollout

    def close(self) -> None:
        """Close the environment; the next `reset` makes a new one."""
        env, self._env = self._env, None
        self.is_over = True
        if env is None:
            return
        with contextlib.suppress(Exception):  # a failed machine may fail to close, too
            env.close()

    def _fail(self, call: str, error: Exception) -> None:
        self.is_over = True
        if self.rollout is not None:
            self.rollout.fail("error", f"{call}: {type(error).__name__}: {error}")

    def _record(self) -> Any:
        return None if self._env is None else getattr(self._env.unwrapped, "record", None)


def screenshot_image(observation: AgentObservation) -> Image.Image:
    """Return the screenshot of an observation, a copy."""
    return Image.fromarray(observation["screenshot"])
