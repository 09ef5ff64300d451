"""The policy of the toy: a small convolutional network that reads an instruction, and points."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from hijack_data.rng import Stream

from ..rollouts import AgentObservation, PolicyAnswer, PolicyTurn
from .env import DONE
from .tasks import COLOURS, HEIGHT, SHAPES, WIDTH

CELL = 4  # pixels of a place, on each side
ROWS, COLUMNS = HEIGHT // CELL, WIDTH // CELL
PLACES = ROWS * COLUMNS
NOWHERE = PLACES  # the second token of an answer that points nowhere
CLICK, FINISH, SAY = range(3)  # the first token
_WORDS = ("press", "choose", "the", "then", "from", "menu", *SHAPES, *COLOURS)
_LONGEST = 8  # words of an instruction
_CHANNELS = 32


class ToyNetwork(nn.Module):
    """Screens and instructions in, logits of the two tokens of an answer out.

    The first token is what to do (click, say done, or say something that no environment takes),
    the second one of 384 places or none.
    """

    def __init__(self) -> None:
        super().__init__()
        self.words = nn.EmbeddingBag(_LONGEST * len(_WORDS) + 1, 2 * _CHANNELS, mode="sum")
        self.patches = nn.Conv2d(3, _CHANNELS, 8, CELL, 2)
        self.near = nn.Conv2d(_CHANNELS, _CHANNELS, 3, 1, 1)
        self.far = nn.Conv2d(_CHANNELS, _CHANNELS, 3, 1, 2, dilation=2)
        self.point = nn.Conv2d(_CHANNELS, 1, 1)
        self.verb = nn.Linear(4 * _CHANNELS, 3)
        self.nowhere = nn.Embedding(3, 1)
        nn.init.normal_(self.words.weight, std=0.3)

    def forward(
        self, screens: torch.Tensor, words: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the logits.

        Args:
            screens: uint8 `[N, 64, 96, 3]`.
            words: int64 `[N, 8]`, from `word_numbers`.

        Returns:
            Float `[N, 3]`, what to do, and float `[N, 384]`, where.
        """
        embedding = self.words(words)
        scale, shift = embedding.unsqueeze(-1).unsqueeze(-1).chunk(2, 1)
        pixels = screens.permute(0, 3, 1, 2).float() / 127.5 - 1
        features = functional.relu(self.patches(pixels))
        features = features + functional.relu(self.near(features * (1 + scale) + shift))
        features = features + functional.relu(self.far(features))
        flat = features.flatten(2)
        summary = torch.cat([flat.mean(2), flat.amax(2), embedding], 1)
        return self.verb(summary), self.point(features).flatten(1)

    def places(self, place_logits: torch.Tensor, verbs: torch.Tensor) -> torch.Tensor:
        """Return the log-probabilities of the second token, float `[N, 385]`, given the first."""
        return torch.cat([place_logits, self.nowhere(verbs)], 1).log_softmax(1)


class ToyPolicy:
    """The network as a policy.

    Args:
        network: the network.
        temperature: of the draws; 1.0 in the paper's training, 0 takes the likeliest answer.
    """

    def __init__(self, network: ToyNetwork, temperature: float = 1.0) -> None:
        self._network = network
        self.temperature = temperature

    def network(self) -> nn.Module:
        """Return the network."""
        return self._network

    def act(
        self, observations: Sequence[AgentObservation], streams: Sequence[Stream]
    ) -> list[PolicyAnswer]:
        """Answer each observation; two draws of its stream decide, whatever else is there."""
        draws = torch.tensor([[stream.random(), stream.random()] for stream in streams])
        with torch.inference_mode():
            verb_logits, place_logits = self._network(*_inputs(observations))
            chances = self._scale(verb_logits).log_softmax(1)
            verbs = self._pick(chances, draws[:, 0])
            spread = self._network.places(self._scale(place_logits), verbs)
            places = self._pick(spread, draws[:, 1])
            first = chances.gather(1, verbs.unsqueeze(1)).squeeze(1)
            second = spread.gather(1, places.unsqueeze(1)).squeeze(1)
        pairs = zip(verbs.tolist(), places.tolist(), strict=True)
        chance = zip(first.tolist(), second.tolist(), strict=True)
        return [_answer(*tokens, of) for tokens, of in zip(pairs, chance, strict=True)]

    def log_probs(self, turns: Sequence[PolicyTurn]) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the log-probabilities of both tokens of each turn, float `[N, 2]`."""
        tokens = torch.tensor([turn.answer.tokens for turn in turns])
        verb_logits, place_logits = self._network(*_inputs([turn.observation for turn in turns]))
        verbs, places = tokens[:, 0], tokens[:, 1]
        first = self._scale(verb_logits).log_softmax(1).gather(1, verbs.unsqueeze(1))
        spread = self._network.places(self._scale(place_logits), verbs)
        log_probs = torch.cat([first, spread.gather(1, places.unsqueeze(1))], 1)
        return log_probs, torch.ones_like(log_probs, dtype=torch.bool)

    def _scale(self, logits: torch.Tensor) -> torch.Tensor:
        return logits / self.temperature if self.temperature else logits

    def _pick(self, chances: torch.Tensor, draws: torch.Tensor) -> torch.Tensor:
        """Draw from log-probabilities `[N, K]` with a number in 0..1 each."""
        if not self.temperature:
            return chances.argmax(1)
        edges = chances.double().exp().cumsum(1)
        at = draws.double().unsqueeze(1) * edges[:, -1:]
        return torch.searchsorted(edges, at, right=True).squeeze(1).clamp_max(chances.shape[1] - 1)


def answer_at(x: int, y: int) -> tuple[int, int]:
    """Return the tokens of a click at a pixel."""
    return CLICK, (y // CELL) * COLUMNS + x // CELL


@lru_cache(maxsize=1024)
def word_numbers(instruction: str) -> tuple[int, ...]:
    """Return a number for each word and its position; unknown and missing words share one."""
    words = instruction.split()[:_LONGEST]
    empty = _LONGEST * len(_WORDS)
    numbers = [
        index * len(_WORDS) + _WORDS.index(word) if word in _WORDS else empty
        for index, word in enumerate(words)
    ]
    return (*numbers, *[empty] * (_LONGEST - len(numbers)))


def _inputs(observations: Sequence[AgentObservation]) -> tuple[torch.Tensor, torch.Tensor]:
    screens = np.stack([observation["screenshot"] for observation in observations])
    words = [word_numbers(observation["instruction"]) for observation in observations]
    return torch.from_numpy(screens), torch.tensor(words)


def _answer(verb: int, cell: int, chances: tuple[float, float]) -> PolicyAnswer:
    """Return an answer; a click needs a cell, and nothing else may have one."""
    points = cell != NOWHERE
    text: Any = "say"
    if verb == CLICK:
        row, column = divmod(cell, COLUMNS)
        middle = CELL // 2
        text = f"click({column * CELL + middle}, {row * CELL + middle})" if points else "click()"
    elif verb == FINISH:
        text = f"{DONE}({cell})" if points else DONE
    return PolicyAnswer(
        action=text,
        tokens=(verb, cell),
        logprobs=chances,
        is_well_formed=points == (verb == CLICK) and verb != SAY,
    )
