"""`pixel_onlooker`: the agent `pixel`, and an onlooker that reads the same pictures.

It is the paper's AgentHijack-Agent (section 5) without a model: an initial check with a request to
re-initialise, and a summary of each step, from which it learns of disturbances. Each of the two
modules can be left out: `NoCheck`, `NoSummary`.
"""

from collections.abc import Sequence
from typing import ClassVar

from hijack_data.actions.agent_actions import REINIT
from hijack_data.types import UInt8Array

from ...tasks.plan_words import PlanStep, read_plan
from ..agent_files import DEFAULT_ERRORS, read_errors
from ..base import WAIT
from .agent import Pixel, walk_answer
from .picture_changes import changed_share
from .picture_onlooker import PictureOnlooker, ScreenFinding
from .plan_walk import PlanWalk
from .screen_reader import ScreenReader, TextLine

MAX_RECOVERIES = 8  # that an episode may have
MAX_SAME_RECOVERIES = 3  # times that one kind is put right
# What is tried when a text does not come and nothing wrong is to be seen: a menu or a dialog that
# nobody wanted may be open.
FALLBACK_STEPS = ("press esc", "wait")


class PixelOnlooker(Pixel):
    """`pixel` with an onlooker.

    Raises:
        ConfigError: The error repository cannot be read.
    """

    has_onlooker: ClassVar[bool] = True
    checks: ClassVar[bool] = True
    summarises: ClassVar[bool] = True
    errors: ClassVar[str] = DEFAULT_ERRORS  # path or packaged name of the error repository

    def __init__(self) -> None:
        super().__init__()
        self._errors = read_errors(self.errors)[0]
        self.summaries: list[str] = []
        self._plan_windows: tuple[str, ...] = ()
        self._forget()

    def reset(self) -> None:
        """Forget the episode and its plan."""
        super().reset()
        self._forget()

    def check(self, picture: UInt8Array) -> str | None:
        """Return the reminder that a screen calls for, or `None`; what the initial check says.

        Args:
            picture: uint8 RGB `[H, W, 3]`.
        """
        finding = self._onlooker.check(ScreenReader().read(picture))
        return None if finding is None else finding.say

    def _forget(self) -> None:
        self.summaries = []
        self._onlooker = PictureOnlooker(self._errors)
        self._recovery = PlanWalk((), self.reader)
        self._recovered_kinds: list[str] = []
        self._has_asked = False
        self._is_checked = False
        self._last_words = ""
        self._last_screen: tuple[UInt8Array, tuple[TextLine, ...]] | None = None

    def _begin(self, steps: Sequence[PlanStep]) -> None:
        super()._begin(steps)
        self._plan_windows = tuple(step.text for step in steps if step.verb == "window")

    def _go_on(self, picture: UInt8Array) -> tuple[str, Sequence[str]]:
        lines = self.reader.read(picture)
        notes: list[str] = []
        if self.checks and not self._is_checked:
            answer = self._check(lines)
            if answer is not None:
                return answer
        if self.summarises:
            notes += self._look_on(picture, lines)
        words, actions = self._act(picture)
        self._last_words = f"{words} {actions[0] if actions[0] == WAIT else ''}".strip()
        self._last_screen = (picture.copy(), lines)
        return " ".join([*notes, words]), actions

    def _check(self, lines: Sequence[TextLine]) -> tuple[str, Sequence[str]] | None:
        """Check the first picture; ask once for re-initialisation, and look again."""
        finding = self._onlooker.check(lines)
        if finding is not None and not self._has_asked:
            self._has_asked = True
            return f"Reminder: {finding.say}", [REINIT]
        self._is_checked = True
        if finding is not None:
            self._recover(finding)
        return None

    def _look_on(self, picture: UInt8Array, lines: tuple[TextLine, ...]) -> list[str]:
        """Summarise the last step, and put right what is wrong; return what to say of it."""
        notes: list[str] = []
        if self._last_screen is not None:
            earlier, read = self._last_screen
            share = changed_share(earlier, picture)
            notes.append(self._onlooker.summarise(self._last_words, read, lines, share))
            self.summaries.append(notes[-1])
        if not self._recovery.ended:
            return notes
        finding = self._onlooker.watch(lines, picture.shape[:2], self._windows())
        if finding is not None and self._recover(finding):
            notes.append(f"Reminder: {finding.say}")
        return notes

    def _windows(self) -> tuple[str, ...]:
        """Return the windows of the plan, with the one at work at the end."""
        return (*self._plan_windows, self.walk.window) if self.walk.window else ()

    def _recover(self, finding: ScreenFinding) -> bool:
        """Begin to put something right; return whether it is still worth a try."""
        tries = self._recovered_kinds.count(finding.kind)
        if tries >= MAX_SAME_RECOVERIES or len(self._recovered_kinds) >= MAX_RECOVERIES:
            return False
        self._recovered_kinds.append(finding.kind)
        self._recovery = PlanWalk(read_plan(finding.steps), self.reader)
        return True

    def _act(self, picture: UInt8Array) -> tuple[str, Sequence[str]]:
        """Return the next action: of a recovery, if there is one, else of the plan."""
        if not self._recovery.ended:
            walked = self._recovery.act(picture)
            if walked.action:
                return f"Recovery. {walked.words}", [walked.action]
            self._recovery = PlanWalk((), self.reader)
        walked = self.walk.act(picture)
        finding = ScreenFinding(kind="lost", say=walked.words, steps=FALLBACK_STEPS)
        if not walked.is_lost or not self.summarises or not self._recover(finding):
            return walk_answer(walked)
        self.walk.wait_again()
        return f"{walked.words} Recovery.", [self._recovery.act(picture).action]


class NoCheck(PixelOnlooker):
    """`pixel_onlooker` without the initial check (the paper's module ablation)."""

    checks = False


class NoSummary(PixelOnlooker):
    """`pixel_onlooker` without summaries: it does not notice what happens during the task."""

    summarises = False
