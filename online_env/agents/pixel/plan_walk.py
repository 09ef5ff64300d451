"""Follow a plan in words on pictures: find each text by OCR, and return the action for it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from hijack_data.types import Point, Size, UInt8Array

from ...tasks.plan_words import PlanStep
from ..base import FAIL, WAIT
from .screen_reader import ScreenReader, TextLine
from .text_matching import TextMatch, all_texts, closest_text, find_text

MAX_WAITS = 2  # pictures on which a text is waited for, until the walk is lost
MAX_SCROLLS = 15  # turns of the wheel for which a text is searched
CLICKS_PER_SCROLL = 5  # clicks of the wheel a turn
# How far beside a text to click, in heights of its line.
LINE_HEIGHTS_ACROSS = 3.0
LINE_HEIGHTS_ALONG = 1.6

_CLICKS = {
    "click": "pyautogui.click({x}, {y})",
    "double-click": "pyautogui.doubleClick({x}, {y})",
    "right-click": "pyautogui.rightClick({x}, {y})",
    "ctrl-click": "pyautogui.keyDown('ctrl')\npyautogui.click({x}, {y})\npyautogui.keyUp('ctrl')",
}


@dataclass(frozen=True, kw_only=True)
class WalkResult:
    """The result of a walk on one picture.

    Args:
        said: The step, and what was seen of it.
        action: pyautogui code, `WAIT` or `FAIL`; "" if there is nothing left to do.
        lost: Whether a text did not appear, so that the plan cannot continue.
    """

    said: str
    action: str = ""
    lost: bool = False


class PlanWalk:
    """A plan, and how far it was followed.

    Args:
        steps: The plan.
        reader: Reads the pictures; several walks may share one.
    """

    def __init__(self, steps: Iterable[PlanStep], reader: ScreenReader) -> None:
        self.steps = tuple(steps)
        self._reader = reader
        self._at = 0
        self._missed = 0
        self._turned = 0

    @property
    def ended(self) -> bool:
        """Whether no step is left."""
        return self._at >= len(self.steps)

    @property
    def window(self) -> str:
        """The window in use at this step of the plan; "" if the plan names none."""
        named = [step.text for step in self.steps[: self._at + 1] if step.verb == "window"]
        return named[-1] if named else ""

    def wait_again(self) -> None:
        """Look for the text of a step that is lost once more."""
        self._missed = 0
        self._turned = 0

    def act(self, picture: UInt8Array) -> WalkResult:
        """Continue to the next step that needs an action, and return the action.

        Args:
            picture: uint8 RGB `[H, W, 3]`.
        """
        while not self.ended:
            walked = self._try(self.steps[self._at], picture)
            if walked is not None:
                return walked
            self._advance()
        return WalkResult(said="That was the whole plan.")

    def _advance(self) -> None:
        self._at += 1
        self._missed = 0
        self._turned = 0

    def _try(self, step: PlanStep, picture: UInt8Array) -> WalkResult | None:
        """Return the action of a step; `None` if it needs none."""
        match step.verb:
            case "type" | "press":
                return self._taken(step, keyboard_code(step))
            case "give up":
                return self._taken(step, FAIL)
            case "scroll" if not step.text:
                return self._taken(step, wheel_code(step, picture.shape[:2], step.count))
            case "wait" if not step.text:
                return self._taken(step, WAIT)
            case _:
                return self._look(step, picture)

    def _look(self, step: PlanStep, picture: UInt8Array) -> WalkResult | None:
        """Look for the text of a step, and act on it."""
        lines = self._reader.read(picture)
        seen = find_step_text(step, lines)
        if seen is None:
            return self._not_seen(step, lines, picture.shape[:2])
        if step.verb in ("wait", "window", "scroll"):
            return None
        x, y = click_point(step, seen, picture.shape[:2])
        code = _CLICKS[step.verb].format(x=x, y=y)
        return self._taken(step, code, f"I read {seen.line.text!r}.")

    def _not_seen(self, step: PlanStep, lines: Sequence[TextLine], size: Size) -> WalkResult:
        if step.verb == "scroll" and self._turned < MAX_SCROLLS:
            self._turned += 1
            return WalkResult(
                said=self._words(step), action=wheel_code(step, size, CLICKS_PER_SCROLL)
            )
        said = self._words(step, f"I do not see {step.text!r}.")
        if self._missed < MAX_WAITS:
            self._missed += 1
            return WalkResult(said=said, action=WAIT)
        closest = closest_text(lines, step.text)
        return WalkResult(said=f"{said} The closest text is {closest!r}.", lost=True)

    def _taken(self, step: PlanStep, action: str, note: str = "") -> WalkResult:
        said = self._words(step, note)
        self._advance()
        return WalkResult(said=said, action=action)

    def _words(self, step: PlanStep, note: str = "") -> str:
        return f"Step {self._at + 1} of {len(self.steps)}: {step.line}. {note}".rstrip()


def find_step_text(step: PlanStep, lines: Sequence[TextLine]) -> TextMatch | None:
    """Return where the text of a step stands; `None` if it, or its anchor, is not there."""
    if not step.near:
        return find_text(lines, step.text)
    anchors = all_texts(lines, step.near)
    return find_text(lines, step.text, anchors) if anchors else None


def click_point(step: PlanStep, seen: TextMatch, size: Size) -> Point:
    """Return the pixel to click on: in the middle of a text, or beside it."""
    left, top, right, bottom = seen.box
    x, y = seen.centre
    across = round(LINE_HEIGHTS_ACROSS * seen.line.height)
    along = round(LINE_HEIGHTS_ALONG * seen.line.height)
    places = {
        "": (x, y),
        "right of": (right + across, y),
        "left of": (left - across, y),
        "above": (x, top - along),
        "below": (x, bottom + along),
    }
    x, y = places[step.side]
    height, width = size
    return min(max(x, 0), width - 1), min(max(y, 0), height - 1)


def keyboard_code(step: PlanStep) -> str:
    """Return the code of a step that types or presses keys."""
    if step.verb == "type":
        return f"pyautogui.write({step.text!r})"
    if len(step.keys) == 1:
        return f"pyautogui.press({step.keys[0]!r}, presses={step.count})"
    keys = ", ".join(map(repr, step.keys))
    return "\n".join([f"pyautogui.hotkey({keys})"] * step.count)


def wheel_code(step: PlanStep, size: Size, clicks: int) -> str:
    """Return the code that turns the wheel in the middle of the picture."""
    height, width = size
    way = -clicks if step.way == "down" else clicks
    return f"pyautogui.scroll({way}, {width // 2}, {height // 2})"
