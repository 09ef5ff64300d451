"""`pixel`: follows a plan in words on the pictures, and sees nothing else."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from hijack_data import extras
from hijack_data.types import UInt8Array

from ...tasks.plan_words import PlanStep, read_plan
from ..base import DONE, Observation
from .plan_walk import PlanWalk, WalkResult
from .screen_reader import SHARED, ScreenReader

TEXTS = "texts"  # in the folder of a run
NO_PLAN = "Nobody told me how to do this."


class Pixel:
    """Follows a plan in words; each text of it is looked for on the picture, by OCR.

    It waits for a text that is not visible; if the text does not appear, the agent names it and
    ends the episode with `DONE`, as it does at once without a plan. `FAIL` claims that the task is
    infeasible: the agent answers that only if the plan says so, because otherwise it would be right
    about infeasible tasks merely by getting lost.

    Raises `MissingDependencyError` without the extra `ocr`.
    """

    uses_plan = True

    def __init__(self) -> None:
        self.check_ready()
        self.reader = ScreenReader()
        self.walk = PlanWalk((), self.reader)

    @classmethod
    def check_ready(cls) -> None:
        """Check that text can be read; `MissingDependencyError` has the command that adds it."""
        extras.require("the agent pixel", "ocr", ("rapidocr", "onnxruntime", "cv2"))

    @classmethod
    def share_in(cls, folder: Path) -> None:
        """Share the text that is read with the other processes of a run, in its folder."""
        SHARED.share_in(folder / TEXTS)

    def reset(self) -> None:
        """Forget the episode and its plan."""
        self.reader.forget()
        self._begin(())

    def follow(self, lines: Sequence[str]) -> None:
        """Take the plan of the task; `PlanWordsError` names the steps that cannot be read."""
        self._begin(read_plan(lines))

    @property
    def usage(self) -> Mapping[str, Any]:
        """The cost of reading in this episode: calls of the OCR, pixels, seconds."""
        return {"reading": asdict(self.reader.counts)}

    def predict(self, instruction: str, obs: Observation) -> tuple[str, Sequence[str]]:
        """Return the action of the next step of the plan, or `WAIT` until it can be taken.

        Args:
            instruction: not used: the plan says what to do.
            obs: `obs["screenshot"]` is uint8 RGB `[H, W, 3]`.
        """
        if not self.walk.steps:
            return NO_PLAN, [DONE]
        return self._go_on(obs["screenshot"])

    def _begin(self, steps: Sequence[PlanStep]) -> None:
        self.walk = PlanWalk(steps, self.reader)

    def _go_on(self, picture: UInt8Array) -> tuple[str, Sequence[str]]:
        return walk_answer(self.walk.act(picture))


def walk_answer(walked: WalkResult) -> tuple[str, Sequence[str]]:
    """Return words and action: `DONE` at the end of the plan, and where it cannot go on."""
    return walked.said, [walked.action or DONE]
