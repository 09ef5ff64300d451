"""Find the actions in a reply of UI-TARS."""

import re
from bisect import bisect_left
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

from ...errors import ActionError, short_repr
from .field_checks import refuse_unknown_action

NAMES = (
    "click",
    "left_double",
    "right_single",
    "drag",
    "hotkey",
    "type",
    "scroll",
    "wait",
    "finished",
    "call_user",
    "hover",
    "move_to",
    "mouse_down",
    "mouse_up",
    "long_press",
    "open_app",
    "press_home",
    "press_back",
)
_ANY = "|".join(NAMES)
_LABEL = re.compile(r"^[ \t]*Action[:：]", re.MULTILINE)
# A call whose quotes and parentheses match; and a call that ends where the text ends, with any
# content.
_SINGLE = r"'(?:\\.|[^'\\])*'"
_DOUBLE = r'"(?:\\.|[^"\\])*"'
_NEAT = re.compile(rf"\s*(\w+)[ \t]*\(((?:[^'\"()]|{_SINGLE}|{_DOUBLE})*)\)", re.DOTALL)
_LOOSE = re.compile(r"\s*(\w+)[ \t]*\((.*)\)\s*", re.DOTALL)
_NEXT = re.compile(rf"(?<=\))[ \t]*\r?\n[ \t]*\r?\n\s*(?=(?:{_ANY})\()")
_BEGINS = re.compile(rf"\s*(?:{_ANY})[ \t]*\(")
_HEADING = re.compile(r"\s*\w+[:：]")
_BOX = re.compile(r"(?:_box|point)\s*=")
_INNER = re.compile(rf"\)\s*\n\s*(?:{_ANY})[ \t]*\(")
_FIX = "write for example Action: click(start_box='(100,200)')"
_ESCAPED = r"'it\'s'"


class Call(NamedTuple):
    """One action as written in the reply."""

    name: str
    inside: str  # the text between the parentheses
    start: int  # where `inside` begins in the whole text


def sections(text: str) -> list[list[Call]]:
    """Return the calls after each `Action:` (or of the whole text, where there is none), in order.

    An earlier `Action:` that is followed by prose is left out.

    Raises:
        ActionError: no action follows the last `Action:`, or it is not clear where an action ends.
    """
    labels = [match.end() for match in _LABEL.finditer(text)] or [0]
    calls_by_label: list[list[Call]] = []
    position = 0
    for index, label in enumerate(labels):
        if label < position:  # inside the quotes of an action
            continue
        calls, end = _neat_calls(text, label)
        following = bisect_left(labels, end, index + 1)
        if following == len(labels):
            remainder = text[end:].strip()
            calls_by_label.append(
                calls if calls and not remainder else list(_loose_calls(text, label))
            )
            break
        _check_rest(text[end : labels[following]], end)
        calls_by_label += [calls] if calls else []
        position = end
    return calls_by_label


def _neat_calls(text: str, start: int) -> tuple[list[Call], int]:
    """Return the calls from `start` on whose quotes match, and where the last of them ends."""
    calls: list[Call] = []
    while match := _NEAT.match(text, start):
        if match[1] not in NAMES:
            break
        calls.append(_call(match))
        start = match.end()
    return calls, start


def _loose_calls(text: str, start: int) -> Iterator[Call]:
    """Return the calls from `start` on, split at empty lines; any quotes may be in them.

    Raises:
        ActionError: a part is no action, or it is not clear where an action ends.
    """
    bounds = [start, *(match.end() for match in _NEXT.finditer(text, start)), len(text)]
    for begin, end in pairwise(bounds):
        match = _LOOSE.fullmatch(text, begin, end)
        if match is None:
            part = short_repr(text[begin:end].strip())
            raise ActionError(f"UI-TARS text has no action at character {begin}: {part}; {_FIX}")
        call = _call(match)
        if _INNER.search(f"{call.inside})"):
            raise ActionError(
                f"{call.name}: it is not clear where {short_repr(call.inside)} ends; "
                f"escape the quotes in it, as in {_ESCAPED}"
            )
        yield call


def _call(match: re.Match[str]) -> Call:
    if match[1] not in NAMES:
        refuse_unknown_action("UI-TARS", match[1], NAMES)
    return Call(match[1], match[2], match.start(2))


def _check_rest(text: str, start: int) -> None:
    """Check that the rest of the text, in which no action was found, is prose.

    Raises:
        ActionError: the text is not prose.
    """
    prose = not _BEGINS.match(text) and (_HEADING.match(text) or not _BOX.search(text))
    if not prose:
        excerpt = short_repr(text.strip())
        raise ActionError(
            f"UI-TARS text has no whole action at character {start}: {excerpt}; {_FIX}"
        )
