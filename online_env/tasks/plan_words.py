"""A plan in words: how a person would be told to do a task, step by step.

A task may declare one (`Task.plan`); the agents `pixel` and `pixel_onlooker` follow it. Each step
is one line. What stands in quotation marks is text on the screen, or text to type, written as a
JSON string (`quoted` does that).

    window "Thunar"
    click "File"                      double-click, right-click and ctrl-click alike
    click "Edit" near "Summary"       where a text stands several times
    click right of "Name:"            left of, above and below alike
    type "hello"
    press ctrl+s                      press tab 3 times
    scroll down 2                     up alike
    scroll down to "Send"
    wait
    wait for "Saved"
    give up "there is no button for it"
"""

import json
import re
from collections.abc import Iterable
from dataclasses import dataclass

from hijack_data.errors import HijackError, suggest

POINTERS = ("click", "double-click", "right-click", "ctrl-click")
SIDES = ("right of", "left of", "above", "below")
VERBS = (*POINTERS, "window", "type", "press", "scroll", "wait", "give up")
MOST = 100  # times that a key is pressed, or the wheel is turned

_VERB = re.compile("|".join(map(re.escape, VERBS)))
_SIDE = re.compile("|".join(map(re.escape, SIDES)))
_KEYS = re.compile(r"(?P<keys>[^\s+\"]+(?:\+[^\s+\"]+)*)(?:\s+(?P<count>\d+)\s+times)?")
_SCROLL = re.compile(r"(?P<way>up|down)\b\s*(?:(?P<to>to\b)|(?P<count>\d+))?")
_NAMED_KEYS = (
    *("enter", "tab", "esc", "space", "backspace", "delete", "insert", "menu"),
    *("home", "end", "pageup", "pagedown", "up", "down", "left", "right"),
    *("ctrl", "alt", "shift", "win"),
    *(f"f{number}" for number in range(1, 13)),
)


class PlanWordsError(HijackError, ValueError):
    """A step of a plan in words cannot be read; the message names the step and the remedy."""


@dataclass(frozen=True, kw_only=True)
class PlanStep:
    """One step of a plan in words.

    Args:
        line: The step as it was written.
        verb: One of `VERBS`.
        text: The text on the screen, the text to type, or the reason; "" if there is none.
        side: Where beside the text to click, one of `SIDES`; "" for the text itself.
        near: The text that the right one is nearest to; "" for none.
        keys: The keys of `press`, held together.
        count: How often to press the keys, or to turn the wheel.
        way: `up` or `down`, of `scroll`.
    """

    line: str
    verb: str
    text: str = ""
    side: str = ""
    near: str = ""
    keys: tuple[str, ...] = ()
    count: int = 1
    way: str = ""


def quoted(text: str) -> str:
    """Return a text as a step of a plan in words holds it: in quotation marks."""
    return json.dumps(text, ensure_ascii=False)


def read_plan(lines: Iterable[str]) -> tuple[PlanStep, ...]:
    """Return the steps of a plan in words.

    Raises:
        PlanWordsError: Steps cannot be read; the message has all of them, with number and remedy.
    """
    steps: list[PlanStep] = []
    problems: list[str] = []
    for number, line in enumerate(lines, 1):
        try:
            steps.append(_StepReader(line).read())
        except PlanWordsError as error:
            problems.append(f"step {number}, {line!r:.120}: {error}")
    if problems:
        raise PlanWordsError("\n".join(problems))
    return tuple(steps)


class _StepReader:
    """Reads one line from left to right; every method raises `PlanWordsError`."""

    def __init__(self, line: str) -> None:
        self._line = line
        self._rest = line.strip()

    def read(self) -> PlanStep:
        verb = self._taken(_VERB)
        if verb is None:
            first = self._rest.split(" ")[0]
            raise PlanWordsError(f"a step begins with a verb{suggest(first, VERBS)}")
        step = self._of(verb.group())
        if self._rest:
            raise PlanWordsError(f"{self._rest!r} is too much; a step is one thing to do")
        return step

    def _of(self, verb: str) -> PlanStep:
        match verb:
            case "press":
                return self._press()
            case "scroll":
                return self._scroll()
            case "wait":
                return self._wait()
            case "window" | "type" | "give up":
                return PlanStep(line=self._line, verb=verb, text=self._text(verb))
            case _:
                return self._pointer(verb)

    def _pointer(self, verb: str) -> PlanStep:
        side = self._taken(_SIDE)
        return PlanStep(
            line=self._line,
            verb=verb,
            side=side.group() if side else "",
            text=self._text(verb),
            near=self._near(),
        )

    def _wait(self) -> PlanStep:
        if self._taken(re.compile("for")) is None:
            return PlanStep(line=self._line, verb="wait")
        text = self._text("wait for")
        return PlanStep(line=self._line, verb="wait", text=text, near=self._near())

    def _press(self) -> PlanStep:
        found = self._taken(_KEYS)
        if found is None:
            raise PlanWordsError("press takes keys, such as: press ctrl+s, or: press tab 3 times")
        keys = tuple(key.lower() for key in found["keys"].split("+"))
        for key in keys:
            if len(key) > 1 and key not in _NAMED_KEYS:
                raise PlanWordsError(f"there is no key {key!r}{suggest(key, _NAMED_KEYS)}")
        return PlanStep(line=self._line, verb="press", keys=keys, count=_count(found["count"]))

    def _scroll(self) -> PlanStep:
        found = self._taken(_SCROLL)
        if found is None:
            raise PlanWordsError('scroll takes a way: scroll down 3, or: scroll down to "Send"')
        return PlanStep(
            line=self._line,
            verb="scroll",
            way=found["way"],
            count=_count(found["count"]),
            text=self._text("scroll down to") if found["to"] else "",
        )

    def _near(self) -> str:
        if self._taken(re.compile("near")) is None:
            return ""
        return self._text("near")

    def _text(self, after: str) -> str:
        """Take the text that follows."""
        try:
            text, end = json.JSONDecoder().raw_decode(self._rest)
        except ValueError:
            text, end = None, 0
        if not isinstance(text, str) or not text.strip():
            remedy = f'write it as: {after} "text" (quoted(text) escapes what has to be)'
            raise PlanWordsError(f"{after} takes a text in quotation marks; {remedy}")
        self._rest = self._rest[end:].strip()
        return text

    def _taken(self, pattern: re.Pattern[str]) -> re.Match[str] | None:
        """Take what matches, if it is whole words."""
        found = pattern.match(self._rest)
        if found is None:
            return None
        rest = self._rest[found.end() :]
        if rest and not rest[0].isspace() and rest[0] != '"':
            return None
        self._rest = rest.strip()
        return found


def _count(digits: str | None) -> int:
    shown = (digits or "1").lstrip("0") or "0"
    if len(shown) > len(str(MOST)) or not 1 <= int(shown) <= MOST:
        raise PlanWordsError(f"{shown[:20]} times is not 1 to {MOST}")
    return int(shown)
