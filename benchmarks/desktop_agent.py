"""An agent that learns when to go on, and when to put something right: for `desktop_training.py`.

It carries out the task's own solution as `oracle` does, so it is given the task and the machine,
and reports say so. What it learns is a choice at every screenshot: take the next action of the
solution, or one of five things that a user does when the desktop misbehaves. That choice is made
by a small network which sees the screenshot as 160x90 pixels, and nothing else.
"""

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import torch
from torch import nn

from hijack_data.rng import Stream
from hijack_data.types import UInt8Array
from online_env.agents.base import Observation
from online_env.agents.oracle import Oracle, OracleDesktop
from online_env.desktops.protocol import Desktop
from online_env.tasks import Hand, Task
from pipelines.train.rollouts import PolicyAnswer, PolicyTurn

HEIGHT, WIDTH = 90, 160  # pixels of the picture that the network sees
ACTION_TIMEOUT_S = (
    1.5  # s that the next action of the solution may take to be found, until it is a WAIT
)
LOST = 10.0  # s without it, until the solution gives up; the oracle has 20
PASSWORD = "password"


@dataclass(frozen=True)
class Skill:
    """Something that a user does; `code` is given the size of the screenshot, (height, width)."""

    name: str
    code: Callable[[int, int], str]


def _unlock(height: int, width: int) -> str:
    keys = f"pyautogui.write({PASSWORD!r}, interval=0.02); pyautogui.press('enter')"
    return f"pyautogui.click({width // 2}, {height // 2}); {keys}; time.sleep(1)"


def _restore(height: int, width: int) -> str:
    """Click on the first window button of the panel."""
    return f"pyautogui.click({round(0.207 * width)}, {round(0.983 * height)})"


GO_ON = 0
SKILLS = (
    Skill("go on", lambda *_: ""),
    Skill("unlock", _unlock),
    Skill("restore", _restore),
    Skill("switch", lambda *_: "pyautogui.hotkey('alt', 'tab')"),
    Skill("escape", lambda *_: "pyautogui.press('escape')"),
    Skill("reload", lambda *_: "pyautogui.press('f5')"),
)
NUMBERS = {skill.name: number for number, skill in enumerate(SKILLS)}


def small(screenshot: UInt8Array) -> UInt8Array:
    """Return a picture of any size as the network sees it, uint8 `[90, 160, 3]`."""
    result: Any = cv2.resize(screenshot, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    return np.ascontiguousarray(result)


class ChoiceNetwork(nn.Module):
    """A screenshot, uint8 `[N, 90, 160, 3]`, to a logit for each skill, `[N, 6]`."""

    def __init__(self) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            nn.Conv2d(3, 16, 5, stride=2, padding=2),
            nn.ReLU(),
            nn.Conv2d(16, 32, 3, stride=2, padding=1),
            nn.ReLU(),
            nn.Conv2d(32, 32, 3, stride=2, padding=1),
            nn.ReLU(),
            nn.AdaptiveAvgPool2d((6, 8)),
            nn.Flatten(),
            nn.Linear(32 * 6 * 8, 64),
            nn.ReLU(),
            nn.Linear(64, len(SKILLS)),
        )

    def forward(self, screens: torch.Tensor) -> torch.Tensor:
        """Return the logits."""
        return self.layers(screens.permute(0, 3, 1, 2).float() / 127.5 - 1)


class ChoicePolicy:
    """The network as `pipelines.train` trains it: an answer is one token, the skill's number."""

    def __init__(self, network: ChoiceNetwork) -> None:
        self._network = network

    def network(self) -> ChoiceNetwork:
        """Return what holds the parameters."""
        return self._network

    @torch.no_grad()
    def act(
        self, observations: Sequence[Mapping[str, Any]], streams: Sequence[Stream]
    ) -> list[PolicyAnswer]:
        """Draw a skill for each observation."""
        chances = self._chances(observations)
        answers: list[PolicyAnswer] = []
        for row, stream in zip(chances, streams, strict=True):
            edges = row.double().exp().cumsum(0)
            at = int(torch.searchsorted(edges, stream.random() * float(edges[-1]), right=True))
            number = min(at, len(SKILLS) - 1)
            answers.append(
                PolicyAnswer(
                    action=SKILLS[number].name,
                    tokens=(number,),
                    logprobs=(float(row[number]),),
                    is_well_formed=True,
                )
            )
        return answers

    def log_probs(self, turns: Sequence[PolicyTurn]) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the log-probability of each turn's skill, float `[N, 1]`, and that it counts."""
        chances = self._chances([turn.observation for turn in turns])
        tokens = torch.tensor([turn.answer.tokens for turn in turns])
        result = chances.gather(1, tokens)
        return result, torch.ones_like(result, dtype=torch.bool)

    def _chances(self, observations: Sequence[Mapping[str, Any]]) -> torch.Tensor:
        screens = np.stack([small(observation["screenshot"]) for observation in observations])
        return self._network(torch.from_numpy(screens)).log_softmax(1)


class SkilledHands(Oracle):
    """Carries out the skill that it is told."""

    def __init__(self) -> None:
        super().__init__()
        self._searching = False  # whether the solution looks for its next action

    def reset(self) -> None:
        """End the solution of the last episode."""
        super().reset()
        self._searching = False

    def solve(self, task: Task, desktop: Desktop) -> None:
        """Play the task's solution, with less patience than the oracle."""
        task.oracle(Hand(desktop, LOST))

    def act(self, skill: str, screenshot: UInt8Array) -> str:
        """Return the action of a skill on a screen.

        An action of the solution that is not found in time is a `WAIT`, so that the next choice
        may be to put right what is in its way.
        """
        height, width = screenshot.shape[:2]
        number = NUMBERS[skill]
        if number != GO_ON:
            return f"import pyautogui, time; {SKILLS[number].code(height, width)}"
        if not self._is_found():
            return "WAIT"
        return super().predict("", {"screenshot": screenshot})[1][0]

    def _is_found(self) -> bool:
        """Let the solution go on, and wait a moment for its next action."""
        if self._task is None or self._desktop is None or self._has_ended:
            return True
        if not self._searching:
            self._go_on(self._task, self._desktop)
            self._searching = True
        end = time.monotonic() + ACTION_TIMEOUT_S
        while self._desktop.code.empty() and time.monotonic() < end:
            time.sleep(0.02)
        return not self._desktop.code.empty()

    def _next(self, task: Task, desktop: OracleDesktop) -> str | None:
        self._searching = False
        return desktop.code.get()


class Learned(SkilledHands):
    """The agent of `hijack bench`: takes the likeliest skill of the network in `policy`."""

    policy = ""  # the file with the weights

    def __init__(self) -> None:
        super().__init__()
        torch.set_num_threads(1)
        network = ChoiceNetwork()
        network.load_state_dict(torch.load(os.fspath(self.policy), weights_only=True))
        self._network = network.eval()

    @torch.no_grad()
    def predict(self, instruction: str, obs: Observation) -> tuple[str, Sequence[str]]:
        """Return the action of the likeliest skill."""
        screenshot = obs["screenshot"]
        logits = self._network(torch.from_numpy(small(screenshot)).unsqueeze(0))
        skill = SKILLS[int(logits.argmax())].name
        return skill, [self.act(skill, screenshot)]
