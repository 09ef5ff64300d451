"""One rollout of a gymnasium environment, driven by another library's trainer."""

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import gymnasium
from PIL import Image

from hijack_data.errors import UnknownNameError

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
    """

    def __init__(self, make: MakeEnvironment) -> None:
        self.rollout: TokenRollout | None = None
        self.is_over = True
        self._make = make
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
                seen, _ = self._env.reset(seed=request.seed, options=request.options())
            except UnknownNameError:
                raise
            except Exception as error:  # noqa: BLE001  (whatever a foreign environment raises)
                self.close()
                if attempt == ATTEMPTS - 1:
                    self._fail("reset", error)
                continue
            self.is_over = self._record() is not None
            return None if self.is_over else seen
        return None

    def step(self, action: str) -> AgentObservation | None:
        """Take an action; return the next observation, or `None` after the end."""
        if self.is_over or self._env is None or self.rollout is None:
            return None
        self.rollout.answers += 1
        try:
            seen, score, terminated, truncated, _ = self._env.step(action)
        except Exception as error:  # noqa: BLE001  (whatever a foreign environment raises)
            self._fail("step", error)
            self.close()
            return None
        self.rollout.take_reward(score)
        self.is_over = bool(terminated or truncated) or self.rollout.status != "ok"
        return None if self.is_over else seen

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

    def _fail(self, where: str, error: Exception) -> None:
        self.is_over = True
        if self.rollout is not None:
            self.rollout.fail("error", f"{where}: {type(error).__name__}: {error}")

    def _record(self) -> Any:
        return None if self._env is None else getattr(self._env.unwrapped, "record", None)


def screenshot_image(seen: AgentObservation) -> Image.Image:
    """Return the screenshot of an observation, a copy."""
    return Image.fromarray(seen["screenshot"])
