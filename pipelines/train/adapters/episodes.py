"""One rollout of a gymnasium environment that another library's trainer drives."""

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import gymnasium
from PIL import Image

from hijack_data.errors import UnknownNameError

from ..objective import reward
from ..rollouts import Rollout, RolloutRequest, SeenObservation

MakeEnvironment: TypeAlias = Callable[[], gymnasium.Env[Any, str]]
ATTEMPTS = 2  # of a reset; the second one has a new environment


@dataclass(kw_only=True)
class TokenRollout(Rollout):
    """A rollout whose tokens the trainer keeps.

    Args:
        answers: how many actions were taken.
        tokens: what the trainer needs to train on the rollout again, in its own form.
    """

    answers: int = 0
    tokens: Any = field(default=None, repr=False)

    @property
    def counts(self) -> bool:
        """Whether it can be trained on; an agent that never acted has failed, which counts."""
        return self.status == "ok"

    def reward(self, weight: float = 1.0) -> float | None:
        """Return success + format, or `None` for a rollout that does not count.

        Args:
            weight: of the penalty of a wrong form.
        """
        return reward(self.success, self.is_well_formed, weight) if self.counts else None

    def to_data(self) -> dict[str, Any]:
        """Return what happened as JSON data, without pictures and tokens."""
        return {**super().to_data(), "turns": self.answers}


class DrivenEpisode:
    """Plays one rollout after the other in an environment, without ever raising for a machine.

    Args:
        make: makes the environment; it is called with the first `reset`, and again for an
            environment that failed in one.
    """

    def __init__(self, make: MakeEnvironment) -> None:
        self.rollout: TokenRollout | None = None
        self.is_over = True
        self._make = make
        self._env: gymnasium.Env[Any, str] | None = None

    def reset(self, request: RolloutRequest) -> SeenObservation | None:
        """Begin a rollout; returns the first observation, or `None` if there is none to see.

        Raises:
            UnknownNameError: the environment does not know the task: no machine's fault.
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

    def step(self, action: str) -> SeenObservation | None:
        """Take an action; returns the next observation, or `None` after the end."""
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
        """End the episode as it stands, and return the judged rollout; may be called again.

        Raises:
            RuntimeError: nothing was begun.
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
        """Close the environment; the next `reset` makes another."""
        env, self._env = self._env, None
        self.is_over = True
        if env is None:
            return
        with contextlib.suppress(Exception):  # a machine that failed may fail in this, too
            env.close()

    def _fail(self, where: str, error: Exception) -> None:
        self.is_over = True
        if self.rollout is not None:
            self.rollout.fail("error", f"{where}: {type(error).__name__}: {error}")

    def _record(self) -> Any:
        return None if self._env is None else getattr(self._env.unwrapped, "record", None)


def picture_of(seen: SeenObservation) -> Image.Image:
    """Return the screenshot of an observation, a copy."""
    return Image.fromarray(seen["screenshot"])
