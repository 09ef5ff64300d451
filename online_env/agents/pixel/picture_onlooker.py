"""An onlooker without a model, which finds out from the text on a screen what is wrong.

It gets pictures, the window in use, and the steps that were taken, but never the injected
corruption. What it finds is one of the errors of the repository (`configs/onlookers/errors.yaml`,
paper section 5) or one of the disturbances below, with the steps in words that put it right.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from hijack_data.types import Size

from ...tasks.plan_words import quoted
from ..base import WAIT
from ..settings import KnownError
from .screen_reader import TextLine
from .text_matching import MIN_LIKENESS, all_texts, even, find_text, likeness

PASSWORD = "password"  # of the desktop's user, who knows it
GONE = "The window is gone"
COVERED = "A foreign window is in the way"
MAX_DESKTOP_LINES = 8  # lines that a bare desktop has at most: names of icons, and the panel
_MAX_LISTED_TEXTS = 6  # texts that a summary names
_PANEL_TOP_SHARE = 0.9  # of the height: the panel is below
_CLOCK_LEFT_SHARE = 0.9  # of the width: the clock is to the right
_LETTERS = re.compile(r"[^\W\d_]{3}")


@dataclass(frozen=True, kw_only=True)
class ErrorSigns:
    """How to recognise an error of the repository by OCR, and how a user can repair it.

    Args:
        texts: Any of these groups; all texts of a group are on the screen.
        steps: The plan in words that puts it right.
    """

    texts: tuple[tuple[str, ...], ...]
    steps: tuple[str, ...]


# By the names of the repository. An error that the repository does not have is not looked for.
SIGNS = {
    "The screen is locked": ErrorSigns(
        texts=(("Password:", "Unlock"), ("Unlock", "Leave Message")),
        steps=(f"type {quoted(PASSWORD)}", "press enter", "wait"),
    ),
    "The network is down": ErrorSigns(
        texts=(
            ("No internet",),
            ("DNS_PROBE_FINISHED",),
            ("ERR_INTERNET_DISCONNECTED",),
            ("ERR_NETWORK_CHANGED",),
            ("This site can't be reached",),
            ("Checking the network cables",),
        ),
        steps=("press f5", "wait", "wait"),
    ),
}


@dataclass(frozen=True, kw_only=True)
class ScreenFinding:
    """A problem of a screen.

    Args:
        kind: The name of an error of the repository, or of a disturbance.
        say: What to tell the agent.
        steps: The plan in words that puts it right.
    """

    kind: str
    say: str
    steps: tuple[str, ...] = ()


class PictureOnlooker:
    """Looks at the text of pictures.

    Args:
        errors: The error repository.
    """

    def __init__(self, errors: Sequence[KnownError]) -> None:
        self._errors = tuple(errors)
        self._titles: dict[str, str] = {}  # of the windows that were seen
        # The buttons of windows that the plan does not name and that were open when the panel
        # was first seen. What comes later may be a window that the agent has opened.
        self._foreign: tuple[str, ...] | None = None

    def check(self, lines: Sequence[TextLine]) -> ScreenFinding | None:
        """Return the error of the repository that a screen shows, or `None` (the initial check)."""
        for error in self._errors:
            signs = SIGNS.get(error.name)
            if signs is None or not shows_error(lines, signs):
                continue
            return ScreenFinding(kind=error.name, say=error.say, steps=signs.steps)
        return None

    def watch(
        self, lines: Sequence[TextLine], size: Size, windows: Sequence[str]
    ) -> ScreenFinding | None:
        """Return what is wrong with a screen during the task, or `None`.

        Args:
            lines: What was read.
            size: `(height, width)` of the picture.
            windows: The windows that the plan names so far; the last one is at work.
        """
        finding = self.check(lines)
        if finding is not None or not windows:
            return finding
        buttons = panel_buttons(lines, size)
        above = [line for line in lines if line not in buttons]
        for window in windows:
            title = find_text(above, window)
            if title is not None:
                self._titles[window] = title.line.text
        own_buttons = [
            line
            for line in buttons
            if any(self._is_button_of_window(line, name) for name in windows)
        ]
        foreign = self._foreign_buttons(buttons, own_buttons)
        at_work = [line for line in own_buttons if self._is_button_of_window(line, windows[-1])]
        return _find_gone_window(
            above, at_work or own_buttons or buttons, windows[-1]
        ) or _find_foreign_window(foreign)

    def _foreign_buttons(
        self, buttons: Sequence[TextLine], own_buttons: Sequence[TextLine]
    ) -> list[TextLine]:
        """Return the buttons of foreign windows; none if no button is one of the plan's windows."""
        other_buttons = [line for line in buttons if line not in own_buttons]
        if self._foreign is None and buttons:
            self._foreign = tuple(line.text for line in other_buttons) if own_buttons else ()
        if not own_buttons or not self._foreign:
            return []
        return [
            line
            for line in other_buttons
            if any(begins_title(line, text) for text in self._foreign)
        ]

    def _is_button_of_window(self, button: TextLine, window: str) -> bool:
        """Return whether a button of the panel, which may be cut short, is that of a window."""
        if find_text([button], window) is not None:
            return True
        return begins_title(button, self._titles.get(window, ""))

    def summarise(
        self, step: str, before: Sequence[TextLine], after: Sequence[TextLine], share: float
    ) -> str:
        """Return what happened between two pictures (the paper's d_t).

        Args:
            step: What the agent did.
            before: The lines of the picture before.
            after: The lines of the picture after it.
            share: Share of the picture that differs, 0 to 1.
        """
        if not share:
            return f"{step} Nothing has changed."
        new_texts = _texts(after, before)
        lost_texts = _texts(before, after)
        parts = [f"{step} {share:.0%} of the screen changed."]
        if new_texts:
            parts.append(f"New: {', '.join(new_texts)}.")
        if lost_texts:
            parts.append(f"Gone: {', '.join(lost_texts)}.")
        if step.endswith(WAIT):
            parts.append("The agent did nothing to cause it.")
        return " ".join(parts)


def panel_buttons(lines: Sequence[TextLine], size: Size) -> list[TextLine]:
    """Return the window buttons of the panel, from left to right; none if no panel shows."""
    height, width = size
    low = [line for line in lines if line.box[1] > _PANEL_TOP_SHARE * height]
    menu = find_text(low, "Applications")
    if menu is None:
        return []
    band = [line for line in low if line.box[3] > menu.box[1] and line.box[0] > menu.box[2]]
    buttons = [
        line
        for line in band
        if _LETTERS.search(line.text) and line.box[0] < _CLOCK_LEFT_SHARE * width
    ]
    return sorted(buttons, key=lambda line: line.box[0])


def _find_gone_window(
    above: Sequence[TextLine], buttons: Sequence[TextLine], window: str
) -> ScreenFinding | None:
    """Return the finding that the window is not visible, if only desktop and panel are."""
    if not buttons or len(above) > MAX_DESKTOP_LINES or all_texts(above, window):
        return None
    return ScreenFinding(
        kind=GONE,
        say=f"The window {window} does not show; the panel still has its button.",
        steps=(f'click {quoted(buttons[0].text)} near "Applications"', "wait"),
    )


def begins_title(button: TextLine, title: str) -> bool:
    """Return whether a button says the beginning of a title, or all of it."""
    short = even(button.text.rstrip("."))
    return likeness(short, even(title)[: len(short)]) >= MIN_LIKENESS


def _find_foreign_window(foreign: Sequence[TextLine]) -> ScreenFinding | None:
    """Return the finding that a foreign window is open."""
    if not foreign:
        return None
    button = foreign[-1].text
    return ScreenFinding(
        kind=COVERED,
        say=f"{button} is not part of the task.",
        steps=(f'right-click {quoted(button)} near "Applications"', 'click "Close"', "wait"),
    )


def shows_error(lines: Sequence[TextLine], signs: ErrorSigns) -> bool:
    """Return whether all texts of one of the groups are on the screen."""
    return any(all(find_text(lines, text) for text in group) for group in signs.texts)


def _texts(lines: Sequence[TextLine], other_lines: Sequence[TextLine]) -> list[str]:
    """Return the texts that are in some lines but not in others."""
    other_texts = {even(line.text) for line in other_lines}
    texts = [repr(line.text) for line in lines if even(line.text) not in other_texts]
    return texts[:_MAX_LISTED_TEXTS]
