"""The start of all runs: a policy that imperfectly imitates an expert on clean screens.

As the paper does, training begins from a policy that already solves a part of the tasks.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch

from hijack_data.errors import HijackError
from hijack_data.rng import Stream

from ..rollouts import PolicyAnswer, PolicyTurn
from .env import DONE, ToyEnv
from .policy import CELL, CLICK, FINISH, NOWHERE, PLACES, SAY, ToyNetwork, ToyPolicy, answer_at
from .screens import next_target


@dataclass(frozen=True, kw_only=True)
class CloningSettings:
    """The settings for making the start.

    Args:
        tasks: tasks that the expert shows; none of them is trained or evaluated on later.
        epochs: how often each is looked at.
        batch: turns a step.
        learning_rate: of Adam, the highest; it rises and falls once.
        malformed: share of the turns that are shown in a wrong form, so that there is a form to be
            learnt.
    """

    tasks: int = 1500
    epochs: int = 6
    batch: int = 32
    learning_rate: float = 6e-3
    malformed: float = 0.05


def expert_answer(env: ToyEnv) -> tuple[str, tuple[int, int]]:
    """Return the next action of a careful user, as text and as tokens.

    Raises:
        HijackError: no element on the screen leads further.
    """
    if env.is_solved:
        return DONE, (FINISH, NOWHERE)
    box = next_target(env.screen)
    if box is None:
        raise HijackError(f"{env.task.name}: nothing to click leads on")
    x, y = (_middle(low, high) for low, high in ((box[0], box[2]), (box[1], box[3])))
    return f"click({x}, {y})", answer_at(x, y)


def record_demonstrations(names: Sequence[str], seed: int, malformed: float) -> list[PolicyTurn]:
    """Return what the expert does on clean screens, with some answers in a wrong form.

    Args:
        names: the tasks.
        seed: of the wrong forms.
        malformed: their share, 0..1.
    """
    env = ToyEnv()
    turns: list[PolicyTurn] = []
    for name in names:
        stream = Stream(seed, "toy_demonstration-v1", name)
        seen, _ = env.reset(options={"task": name})
        over = False
        while not over:
            action, tokens = expert_answer(env)
            if stream.random() < malformed:
                tokens = stream.choice(
                    ((SAY, NOWHERE), (CLICK, NOWHERE), (FINISH, tokens[1] % PLACES))
                )
            answer = PolicyAnswer(action=action, tokens=tokens, logprobs=(), is_well_formed=True)
            turns.append(PolicyTurn(seen, answer))
            seen, _, terminated, truncated, _ = env.step(action)
            over = terminated or truncated
    return turns


def imitate_expert(names: Sequence[str], seed: int, settings: CloningSettings) -> ToyNetwork:
    """Return a network that imitates the expert.

    Args:
        names: the tasks that the expert shows.
        seed: of the first weights, the order and the wrong forms.
        settings: how long, and how.
    """
    turns = record_demonstrations(names, seed, settings.malformed)
    torch.manual_seed(seed)
    network = ToyNetwork()
    policy = ToyPolicy(network)
    optimiser = torch.optim.Adam(network.parameters(), lr=settings.learning_rate)
    generator = torch.Generator().manual_seed(seed)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser,
        settings.learning_rate,
        total_steps=settings.epochs * -(-len(turns) // settings.batch),
        pct_start=0.1,
    )
    for _ in range(settings.epochs):
        order = torch.randperm(len(turns), generator=generator)
        for some in order.split(settings.batch):
            chances, _ = policy.log_probs([turns[i] for i in some.tolist()])
            loss = -chances.sum(1).mean()
            optimiser.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
            optimiser.step()
            schedule.step()
    return network


def _middle(low: int, high: int) -> int:
    """Return the middle of a place, the one nearest to the middle of a side."""
    first = -(-(low - CELL // 2) // CELL)
    last = (high - 1 - CELL // 2) // CELL
    wanted = round(((low + high - 1) / 2 - CELL // 2) / CELL)
    return min(max(wanted, first), last) * CELL + CELL // 2
