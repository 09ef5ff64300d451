"""`rules`: an onlooker without a model, for any agent. It sees pictures and actions only.

These are its rules, and there are no others. Each acts at most `MAX_SAME` times in an episode;
after that the agent is only reminded.

| what is on the picture | what the guard does |
|---|---|
| the lock screen | asks for re-initialisation before the first action; types the password |
| the browser's page for a network that is down | the same; loads the page again and waits |
| a dialog that says that a program does not respond | clicks the button that waits |
| all windows went at once, and the panel has their buttons | clicks the button of the last one |
| a window came, and the agent's last act can open none | closes it by its button in the panel |
| a click, Enter, drag or typed text changed nothing | waits 1, 2, 4 and 8 s, then see below |

What can open none is text without a line break, or waiting before any other act.
After the waits a click or Enter is done again; of a drag or of text the agent is reminded. Other
keys are left to the agent: many change no picture (Ctrl+C), and a second Delete may harm.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from hijack_data import extras
from hijack_data.actions import parse_pyautogui
from hijack_data.errors import ActionError
from hijack_data.types import Action, Point, Size, UInt8Array

from ...tasks.plan_words import quoted, read_plan
from ..agent_files import DEFAULT_ERRORS, read_errors
from ..guarded import Notice, PastStep
from .picture_onlooker import (
    COVERED,
    GONE,
    MAX_DESKTOP_LINES,
    ErrorSigns,
    PictureOnlooker,
    ScreenFinding,
    begins_title,
    panel_buttons,
    shows_error,
)
from .plan_walk import PlanWalk
from .screen_reader import ScreenReader, TextLine
from .text_matching import even

MAX_SAME = 2  # times that one rule acts in an episode
# Seconds that a change is waited for, each before another look: a busy program is given 15 s.
WAITS_S = (1, 2, 4, 8)
UNCHANGED = "The screen did not change"
NO_RESPONSE = "A program does not respond"
# Dialogs by their texts, with the button that waits. The last one is xfwm4's.
DIALOGS = (
    ErrorSigns(texts=(("is not responding", "Force Quit", "Wait"),), steps=('click "Wait"',)),
    ErrorSigns(texts=(("Page Unresponsive", "Wait"),), steps=('click "Wait"',)),
    ErrorSigns(texts=(("might be busy and is not responding",),), steps=('click "No"',)),
)
# The pointer, from its hot spot: `x1, y1, x2, y2` in pixels. What is below cannot be seen.
POINTER = (-4, -4, 28, 36)
# A caret that blinks is the one change that nobody caused: at most this wide and high, in pixels.
CARET_WIDTH, CARET_HEIGHT = 3, 48
_CLICKS = ("click", "double_click", "triple_click", "right_click", "middle_click")
_ENTER = (("enter",), ("return",))


@dataclass
class _Unanswered:
    """An action of the agent after which nothing changed, and how often it was waited for."""

    step: PastStep
    pointers: tuple[Point | None, ...]  # where the pointer was before the action, and after it
    waits: int = 0


class RulesOnlooker:
    """Watches an agent by the rules above.

    Raises:
        MissingDependencyError: The extra `ocr` is not installed.
    """

    name: str = "rules"
    checks: bool = True
    reinits: bool = True

    def __init__(self) -> None:
        self.check_ready()
        self._reader = ScreenReader()
        self._repository = PictureOnlooker(read_errors(DEFAULT_ERRORS)[0])
        self._forget()

    @classmethod
    def check_ready(cls) -> None:
        """Check that text can be read; `MissingDependencyError` has the command that adds it."""
        extras.require("the guard rules", "ocr", ("rapidocr", "onnxruntime", "cv2"))

    @property
    def settings(self) -> Mapping[str, Any]:
        """The limits of the rules, for the record."""
        return {"version": 3, "max_same": MAX_SAME, "waits_s": list(WAITS_S)}

    @property
    def usage(self) -> Mapping[str, Any]:
        """The cost of reading in this episode: calls of the OCR, pixels, seconds."""
        return {"reading": asdict(self._reader.counts)}

    def reset(self) -> None:
        """Forget the episode."""
        self._reader.forget()
        self._forget()

    def begin_step(self) -> None:
        """Nothing is counted by step."""

    def check(self, picture: UInt8Array, instruction: str) -> Notice:
        """Return the error of the repository that the first screen shows."""
        self._lines = self._reader.read(picture)
        finding = self._repository.check(self._lines)
        return Notice() if finding is None else self._act(finding, picture)

    def watch(self, instruction: str, step: PastStep, picture: UInt8Array) -> Notice:
        """Return what a rule says of the picture after a step."""
        before, self._lines = self._lines, self._reader.read(picture)
        action = None if step.is_guards else _read(step)
        if not step.is_guards and (action is None or action.type != "wait"):
            self._opens_nothing = action is not None and _types_in_a_line(action)
        earlier, self._pointer = self._pointer, _end_point(action) or self._pointer
        if not self._walk.ended:
            code = self._walk.act(picture).action
            if code:
                return Notice(kind=self._kind, reminder=self._say, actions=(code,))
        finding = self._find(action, before, picture.shape[:2])
        if finding is not None:
            self._unanswered = None
            return self._act(finding, picture)
        if not step.is_guards:
            shows = action is not None and (_may_repeat(action) or action.type in ("drag", "type"))
            self._unanswered = _Unanswered(step, (earlier, self._pointer)) if shows else None
        return self._wait_for_change(picture)

    def _find(
        self, action: Action | None, before: Sequence[TextLine], size: Size
    ) -> ScreenFinding | None:
        """Return what is wrong with a picture, whatever the agent did; `None` if nothing is."""
        finding = self._repository.check(self._lines)
        if finding is not None:
            return finding
        for dialog in DIALOGS:
            if shows_error(self._lines, dialog):
                return ScreenFinding(kind=NO_RESPONSE, say=f"{NO_RESPONSE}.", steps=dialog.steps)
        if action is None:
            return None
        buttons = panel_buttons(self._lines, size)
        earlier_buttons = panel_buttons(before, size)
        if not buttons or not earlier_buttons:
            return None
        gone = _find_gone_windows(self._lines, buttons, before, action, size)
        if gone is not None or not self._opens_nothing:
            return gone
        return _find_new_window(buttons, earlier_buttons)

    def _wait_for_change(self, picture: UInt8Array) -> Notice:
        """Return what to do about an action after which nothing has changed."""
        waiting = self._unanswered
        if waiting is None:
            return Notice()
        if not is_unchanged(waiting.step.picture, picture, waiting.pointers):
            self._unanswered = None
            return Notice()
        say = "The last action has changed nothing on the screen yet."
        if waiting.waits < len(WAITS_S) and (waiting.waits or self._may_act(UNCHANGED)):
            code = f"pyautogui.sleep({WAITS_S[waiting.waits]})"
            waiting.waits += 1
            return Notice(kind=UNCHANGED, reminder=say, actions=(code,))
        self._unanswered = None
        action = _read(waiting.step)
        if waiting.waits and action is not None and _may_repeat(action):
            return Notice(kind=UNCHANGED, reminder=say, actions=waiting.step.actions)
        return Notice(kind=UNCHANGED, reminder=f"{say} Look again, and repeat it if needed.")

    def _act(self, finding: ScreenFinding, picture: UInt8Array) -> Notice:
        """Begin to put something right; or only remind, if that was tried too often."""
        self._walk = PlanWalk((), self._reader)
        if not self._may_act(finding.kind):
            return Notice(kind=finding.kind, reminder=finding.say)
        self._kind, self._say = finding.kind, finding.say
        self._walk = PlanWalk(read_plan(finding.steps), self._reader)
        code = self._walk.act(picture).action
        return Notice(kind=finding.kind, reminder=finding.say, actions=(code,) if code else ())

    def _may_act(self, kind: str) -> bool:
        count = self._acts.get(kind, 0)
        self._acts[kind] = count + 1
        return count < MAX_SAME

    def _forget(self) -> None:
        self._lines: tuple[TextLine, ...] = ()
        self._walk = PlanWalk((), self._reader)
        self._kind = self._say = ""
        self._acts: dict[str, int] = {}
        self._pointer: Point | None = None
        # Whether no window can come of what the agent did last, its waiting aside.
        self._opens_nothing = True
        self._unanswered: _Unanswered | None = None


def is_unchanged(before: UInt8Array, after: UInt8Array, pointers: Sequence[Point | None]) -> bool:
    """Return whether two pictures differ at most below the pointer and by a caret that blinks.

    Args:
        before: uint8 RGB `[H, W, 3]`.
        after: uint8 RGB `[H, W, 3]`.
        pointers: where the pointer was and is; a `None` among them is a place that is not known,
            and then a pointer that moved is a change.
    """
    if before.shape != after.shape:
        return False
    differs = (before != after).any(axis=2)
    for x, y in filter(None, pointers):
        x1, y1, x2, y2 = POINTER
        differs[max(y + y1, 0) : y + y2, max(x + x1, 0) : x + x2] = False
    rows, columns = np.nonzero(differs)
    if not rows.size:
        return True
    return bool(np.ptp(columns) < CARET_WIDTH and np.ptp(rows) < CARET_HEIGHT)


def _read(step: PastStep) -> Action | None:
    """Return the action of a step; `None` if it is no single action on the screen."""
    if len(step.actions) != 1:
        return None
    try:
        return parse_pyautogui(step.actions[0], step.picture.shape[:2])
    except ActionError:
        return None


def _types_in_a_line(action: Action) -> bool:
    return action.type == "type" and "\n" not in (action.text or "")


def _may_repeat(action: Action) -> bool:
    """Return whether an action that changed nothing on the screen can be done once more.

    A click or a lone Enter that arrived is seen. Text is not always: that of a password prompt in a
    terminal would be typed twice.
    """
    return action.type in _CLICKS or (action.type == "hotkey" and action.keys in _ENTER)


def _end_point(action: Action | None) -> Point | None:
    """Return where an action leaves the pointer; `None` if it does not move it."""
    if action is None:
        return None
    x, y = (action.x, action.y) if action.x2 is None else (action.x2, action.y2)
    return None if x is None or y is None else (x, y)


def _find_gone_windows(
    lines: Sequence[TextLine],
    buttons: Sequence[TextLine],
    before: Sequence[TextLine],
    action: Action,
    size: Size,
) -> ScreenFinding | None:
    """Return the finding that all windows went at once, unless the agent clicked in the panel."""
    above = [line for line in lines if line not in buttons]
    earlier = [line for line in before if line not in panel_buttons(before, size)]
    if len(above) > MAX_DESKTOP_LINES or len(earlier) <= MAX_DESKTOP_LINES:
        return None
    top = min(button.box[1] for button in buttons)
    if action.y is not None and action.y >= top:
        return None
    titled = [button for button in buttons if any(begins_title(button, t.text) for t in earlier)]
    button = (titled or list(buttons))[-1]
    return ScreenFinding(
        kind=GONE,
        say=f"All windows have gone; the panel still has the button {button.text!r}.",
        steps=(f'click {quoted(button.text)} near "Applications"', "wait"),
    )


def _find_new_window(
    buttons: Sequence[TextLine], earlier: Sequence[TextLine]
) -> ScreenFinding | None:
    """Return the finding that a window came by itself."""
    if len(buttons) <= len(earlier):
        return None
    earlier_texts = {even(button.text) for button in earlier}
    new = [button for button in buttons if even(button.text) not in earlier_texts]
    if len(new) != 1:
        return None
    text = new[0].text
    return ScreenFinding(
        kind=COVERED,
        say=f"The window {text!r} came by itself.",
        steps=(f'right-click {quoted(text)} near "Applications"', 'click "Close"', "wait"),
    )
