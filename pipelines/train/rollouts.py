"""Rollouts: a policy plays gymnasium environments, many at a time.

The environments are those of `CorruptedEnv`'s interface: observations are
`{"screenshot": uint8 [H, W, 3], "instruction": str}`, actions are text, `reset` takes the options
`task`, `corruption` and `label`, and `record` may say how the episode was judged. No desktop code
is imported: any such environment works.
"""

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol, SupportsFloat, TypeAlias, cast

import gymnasium
import torch

from hijack_data.errors import ParameterError
from hijack_data.rng import Stream

from .sampler import Draw

AgentObservation: TypeAlias = Mapping[str, Any]
RolloutStatus: TypeAlias = Literal["ok", "invalid", "error"]
_STREAM = "rollout-v1"


@dataclass(frozen=True, kw_only=True)
class PolicyAnswer:
    """The answer of a policy to one observation.

    Args:
        action: the text for the environment.
        tokens: the tokens that the policy drew.
        logprobs: the log-probability of each token.
        is_well_formed: whether the answer has the required form.
    """

    action: str
    tokens: tuple[int, ...]
    logprobs: tuple[float, ...]
    is_well_formed: bool


@dataclass(frozen=True)
class PolicyTurn:
    """One observation and the answer to it."""

    observation: AgentObservation
    answer: PolicyAnswer


class Policy(Protocol):
    """The interface of a trainable policy."""

    def act(
        self, observations: Sequence[AgentObservation], streams: Sequence[Stream]
    ) -> list[PolicyAnswer]:
        """Answer each observation, with all random draws from its stream."""
        ...

    def log_probs(self, turns: Sequence[PolicyTurn]) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the log-probabilities of the tokens of each turn, with their gradient.

        Returns:
            Float `[N, K]`, and bool `[N, K]`: which entries are tokens.
        """
        ...

    def network(self) -> torch.nn.Module:
        """Return the module that holds the parameters."""
        ...


@dataclass(frozen=True, kw_only=True)
class RolloutRequest:
    """The request for a rollout.

    Args:
        step: step of the optimiser.
        group: the task of the group, as the environment's option `task` takes it.
        slot: the rollout's number in the group.
        seed: of the environment; the rollouts of a group share it, so they play one variant.
        draw: the corruption.
        stream_seed: of the policy's draws.
    """

    step: int
    group: str
    slot: int
    seed: int
    draw: Draw
    stream_seed: int = 0

    def stream(self) -> Stream:
        """Return the stream of the policy's draws in this rollout."""
        return Stream(self.stream_seed, _STREAM, f"{self.slot} of {self.group}", self.step)

    def options(self) -> dict[str, Any]:
        """Return the options of `reset`."""
        return {"task": self.group, "corruption": self.draw.planner, "label": self.draw.label}


@dataclass(kw_only=True)
class Rollout:
    """One episode.

    Args:
        request: the request of the rollout.
        turns: the observations and answers.
        success: the environment's score, 0..1.
        is_well_formed: whether all answers were.
        status: `"ok"` counts; `"invalid"` (the corruption did not hold) and `"error"` (the machine
            failed) are left out of the group, never counted as a failure of the policy.
        problem: the reason, if the status is not `"ok"`.
        replayed: whether it comes from the replay buffer.
    """

    request: RolloutRequest
    turns: list[PolicyTurn] = field(default_factory=list[PolicyTurn])
    success: float = 0.0
    is_well_formed: bool = True
    status: RolloutStatus = "ok"
    problem: str = ""
    replayed: bool = False

    @property
    def counts(self) -> bool:
        """Whether the rollout can be trained on."""
        return self.status == "ok" and bool(self.turns)

    def fail(self, status: RolloutStatus, problem: str) -> None:
        """Leave the rollout out of its group, for a reason."""
        self.status = status
        self.problem = problem

    def take_reward(self, reward: SupportsFloat) -> None:
        """Take the reward of a step; the highest one is the success.

        One that is not in 0..1 fails the rollout: it would be learned from as if it were a score.
        """
        success = self._checked(reward, "reward")
        if success is not None:
            self.success = max(self.success, success)

    def judge(self, record: Mapping[str, Any]) -> None:
        """Take over how the environment judged the episode.

        Args:
            record: its `status`, and its `score` (0..1) and `malformed` if that is `"ok"`, else
                its `problem` and `cause`. What failed by the agent's own fault is a 0.
        """
        status = record.get("status", "ok")
        if status == "ok":
            success = self._checked(record.get("score"), "score")
            self.success = 0.0 if success is None else success
            self.is_well_formed &= not record.get("malformed", 0)
        elif record.get("cause") != "agent":
            self.fail(status, str(record.get("problem", "")))

    def _checked(self, success: object, name: str) -> float | None:
        """Return a success as a float, or `None` for a rollout that fails because of it."""
        try:
            number = float(cast("Any", success))
        except (TypeError, ValueError):
            number = math.nan
        if 0 <= number <= 1:
            return number
        self.fail("error", f"the environment gave the {name} {success!r}; it must be in 0..1")
        return None

    def to_data(self) -> dict[str, Any]:
        """Return what happened as JSON data, without the pictures."""
        return {
            "step": self.request.step,
            "task": self.request.group,
            "slot": self.request.slot,
            "seed": self.request.seed,
            **self.request.draw.to_data(),
            "status": self.status,
            "problem": self.problem,
            "turns": len(self.turns),
            "success": self.success,
            "well_formed": self.is_well_formed,
            "replayed": self.replayed,
        }


def play(
    environments: Sequence[gymnasium.Env[Any, str]],
    policy: Policy,
    requests: Sequence[RolloutRequest],
    *,
    max_steps: int,
    threads: int = 1,
) -> list[Rollout]:
    """Play one rollout in each environment, in step, so that the policy answers in batches.

    An environment that fails, or that gives a reward or a score outside 0..1, loses its rollout
    (`status` is `"error"`); the others go on.

    Args:
        environments: at least as many as `requests`.
        policy: what plays.
        requests: what is to be played.
        max_steps: answers until a rollout is cut off; it then counts with the reward so far.
        threads: environments that reset and step at the same time. More than one is for those that
            wait, as desktops do; the rollouts are the same.

    Raises:
        ParameterError: there are too few environments, one is given twice, `threads` is below 1,
            or the policy has not answered every observation.
    """
    if len(environments) < len(requests):
        raise ParameterError(
            f"{len(requests)} rollouts for {len(environments)} environments: make one for each"
        )
    if len({id(env) for env in environments}) < len(environments):
        raise ParameterError(
            "an environment is given twice, and its rollouts would play in each other's episode:"
            " make one for each ([make() for _ in range(n)], not [make()] * n)"
        )
    if threads < 1:
        raise ParameterError(f"threads must be at least 1, got {threads}")
    seats = [_Seat(env, request) for env, request in zip(environments, requests, strict=False)]
    with ThreadPoolExecutor(threads) as pool:
        each = map if threads == 1 else pool.map
        list(each(_Seat.reset, seats))
        for _ in range(max_steps):
            live = [seat for seat in seats if seat.is_live]
            if not live:
                break
            answers = policy.act(
                [seat.observation for seat in live], [seat.stream for seat in live]
            )
            if len(answers) != len(live):
                raise ParameterError(
                    f"the policy's act gave {len(answers)} answers to {len(live)} observations"
                )
            list(each(_Seat.step, live, answers))
        return list(each(_Seat.leave, seats))


class _Seat:
    """One environment with the rollout that is played in it."""

    def __init__(self, env: gymnasium.Env[Any, str], request: RolloutRequest) -> None:
        self.env = env
        self.rollout = Rollout(request=request)
        self.stream = request.stream()
        self.observation: AgentObservation = {}
        self.is_live = False

    def reset(self) -> None:
        request = self.rollout.request
        try:
            self.observation, _ = self.env.reset(seed=request.seed, options=request.options())
        except Exception as error:  # noqa: BLE001  (whatever a foreign environment raises)
            self._fail("reset", error)
            return
        self.is_live = True
        if self._record() is not None:
            self._judge()
            if self.rollout.status == "ok":
                self.rollout.fail("error", "the episode was over before the first action")

    def step(self, answer: PolicyAnswer) -> None:
        self.rollout.turns.append(PolicyTurn(self.observation, answer))
        self.rollout.is_well_formed &= answer.is_well_formed
        try:
            after, reward, terminated, truncated, _ = self.env.step(answer.action)
        except Exception as error:  # noqa: BLE001  (whatever a foreign environment raises)
            self._fail("step", error)
            return
        self.observation = after
        self.rollout.take_reward(reward)
        if terminated or truncated or self.rollout.status != "ok":
            self._judge()

    def leave(self) -> Rollout:
        """Return the rollout; if it was cut off, it is judged in its present state."""
        if not self.is_live:
            return self.rollout
        try:
            truncate = getattr(self.env.unwrapped, "truncate", None)
            if callable(truncate):
                truncate()
        except Exception as error:  # noqa: BLE001  (whatever a foreign environment raises)
            self._fail("truncate", error)
            return self.rollout
        self._judge()
        return self.rollout

    def _judge(self) -> None:
        self.is_live = False
        record = self._record()
        if record is not None and self.rollout.status == "ok":
            self.rollout.judge(record)

    def _fail(self, where: str, error: Exception) -> None:
        self.is_live = False
        self.rollout.fail("error", f"{where}: {type(error).__name__}: {error}")

    def _record(self) -> Mapping[str, Any] | None:
        return getattr(self.env.unwrapped, "record", None)
