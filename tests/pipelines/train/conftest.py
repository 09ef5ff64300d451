"""A tiny environment and policy: what the trainer does is looked at without the toy's pictures."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

torch = pytest.importorskip("torch", reason="needs the extra [train]")
gymnasium = pytest.importorskip("gymnasium", reason="needs the extra [train]")

import numpy as np  # noqa: E402
from gymnasium import spaces  # noqa: E402

from pipelines.train.replay import ReplayBuffer  # noqa: E402
from pipelines.train.rollouts import AgentObservation, PolicyAnswer, PolicyTurn  # noqa: E402
from pipelines.train.sampler import CorruptionSampler  # noqa: E402
from pipelines.train.trainer import Trainer, TrainSettings  # noqa: E402

Made = Callable[..., Trainer]
SIZE = (8, 8)
ACTIONS = 4


class Guess(gymnasium.Env[dict[str, Any], str]):
    """Say the number that the task asks for: `task` is a name that ends in it."""

    def __init__(self, fails: Sequence[str] = ()) -> None:
        self.observation_space = spaces.Dict(
            {"screenshot": spaces.Box(0, 255, (*SIZE, 3), np.uint8), "instruction": spaces.Text(20)}
        )
        self.action_space = spaces.Text(20)
        self.fails = fails
        self.record: dict[str, Any] | None = None
        self.options: dict[str, Any] = {}
        self.left = 0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        self.options = options or {}
        self.left = 2
        self.record = None
        if self.options["task"] in self.fails:
            raise RuntimeError("no desktop")
        return self._seen(), {}

    def step(self, action: str) -> Any:
        self.left -= 1
        over = self.left == 0
        score = float(over and action == self.options["task"][-1])
        if over:
            self.record = {"status": "ok", "score": score, "malformed": 0}
        return self._seen(), score, over, False, {}

    def _seen(self) -> dict[str, Any]:
        bright = 20 * (ord(self.options["task"][-1]) % 10)
        picture = np.full((*SIZE, 3), bright, np.uint8)
        return {"screenshot": picture, "instruction": self.options["task"]}


class Linear:
    """A policy that says a number from the mean brightness; one token an answer."""

    def __init__(self, seed: int = 0, right: int = ACTIONS) -> None:
        torch.manual_seed(seed)
        self.net = torch.nn.Linear(2, ACTIONS)
        self.right = right  # answers from this number on are in a wrong form

    def network(self) -> Any:
        return self.net

    def act(
        self, observations: Sequence[AgentObservation], streams: Sequence[Any]
    ) -> list[PolicyAnswer]:
        with torch.inference_mode():
            chances = self._logits(observations).log_softmax(1)
        answers: list[PolicyAnswer] = []
        for row, stream in zip(chances, streams, strict=True):
            edges = row.double().exp().cumsum(0)
            token = int(torch.searchsorted(edges, stream.random() * float(edges[-1]), right=True))
            token = min(token, ACTIONS - 1)
            answer = PolicyAnswer(
                action=str(token),
                tokens=(token,),
                logprobs=(float(row[token]),),
                is_well_formed=token < self.right,
            )
            answers.append(answer)
        return answers

    def log_probs(self, turns: Sequence[PolicyTurn]) -> tuple[Any, Any]:
        logits = self._logits([turn.observation for turn in turns])
        tokens = torch.tensor([turn.answer.tokens for turn in turns])
        chances = logits.log_softmax(1).gather(1, tokens)
        return chances, torch.ones_like(chances, dtype=torch.bool)

    def _logits(self, observations: Sequence[AgentObservation]) -> Any:
        bright = [float(observation["screenshot"].mean()) / 100 for observation in observations]
        return self.net(torch.tensor([[1.0, item] for item in bright]))


TASKS = ("say-0", "say-1", "say-2", "say-3", "say-0-0", "say-0-1")


@pytest.fixture
def make_trainer() -> Made:
    """Make a trainer: `make_trainer(folder, planner=..., fails=..., replay=..., **settings)`."""

    def make(
        folder: Path | None = None,
        *,
        planner: Any = None,
        per: str = "rollout",
        tasks: Sequence[str] = TASKS,
        fails: Sequence[str] = (),
        replay: ReplayBuffer | None = None,
        policy: Any = None,
        report: Any = lambda _: None,
        **settings: Any,
    ) -> Trainer:
        options = {"epochs": 3, "batch": 2, "learning_rate": 0.05, "save_every": 1, **settings}
        numbers = TrainSettings(**options)
        environments = [Guess(fails) for _ in range(numbers.batch * numbers.rollouts)]
        return Trainer(
            policy or Linear(),
            environments,
            tasks=tasks,
            sampler=CorruptionSampler(planner, per=per, seed=numbers.seed),
            settings=numbers,
            replay=replay,
            folder=folder,
            report=report,
        )

    return make
