"""Check whether a live desktop may run an action of an agent.

An agent may wait, end the episode, ask for help, or run pyautogui code that uses pointer and
keyboard and nothing else: straight-line calls, see `pyautogui_grammar`. The code is only parsed
here; it runs in the guest.
"""

import re
import textwrap
from dataclasses import dataclass
from typing import Literal, TypeAlias

from ..errors import ActionError
from .pyautogui_functions import LIVE_FUNCTIONS
from .pyautogui_grammar import read_calls
from .python_source import ParsedSource

# An agent's request for help, which does nothing on the screen.
REINIT = "REQUEST_REINIT"
ActionKind: TypeAlias = Literal["wait", "done", "fail", "reinit", "code"]
ACTION_WORDS: dict[str, ActionKind] = {
    "WAIT": "wait",
    "DONE": "done",
    "FAIL": "fail",
    REINIT: "reinit",
}
MAX_CODE_CHARS = 32_000  # characters; an argument of a command may have 128 KiB

# Begins the text that stands for an answer which its own parser refused; the reason follows.
UNREADABLE = "unreadable action: "
_REPLY = "; the reply: "

# Only fences at the start or the end of a line count: an agent may also type ``` as text.
_FENCE = re.compile(
    r"^[ \t]*```(?:[\w+-]*[ \t]*\r?\n)?(.*?)(?:^[ \t]*```|```[ \t]*\r?$)", re.DOTALL | re.MULTILINE
)


@dataclass(frozen=True)
class Request:
    """The request of an agent: `code` is pyautogui code, or one of `ACTION_WORDS`."""

    kind: ActionKind
    code: str


def read_action(text: object, allow_code: bool = False) -> Request:
    """Read one action: `WAIT`, `DONE`, `FAIL`, `REQUEST_REINIT`, or code, also in a ``` fence.

    Raises:
        ActionError: the text is none of these, or the code does more than `allow_code` permits.
    """
    if not isinstance(text, str):
        kind = type(text).__name__
        raise ActionError(f"an action must be a string, got {kind}; give pyautogui code or a word")
    if text.startswith(UNREADABLE):
        raise ActionError(text.removeprefix(UNREADABLE).partition(_REPLY)[0])
    inner = _unfenced(text)
    if inner in ACTION_WORDS:
        return Request(ACTION_WORDS[inner], inner)
    if not inner:
        raise ActionError(f"the action is empty; give pyautogui code, or {', '.join(ACTION_WORDS)}")
    if len(inner) > MAX_CODE_CHARS or "\0" in inner or not _is_text(inner):
        raise ActionError(
            f"an action is text of at most {MAX_CODE_CHARS} characters without zero bytes, got"
            f" {len(inner)}"
        )
    if not allow_code:
        check_code(inner)
    return Request("code", inner)


def unreadable_action(error: Exception, reply: str = "") -> str:
    """Return a text that `read_action` refuses with the reason why an answer cannot be read.

    Args:
        error: the reason, in the words of the dialect.
        reply: the answer, or its beginning, which the text keeps for the log.
    """
    reason = " ".join(str(error).split())
    return f"{UNREADABLE}{reason}{_REPLY}{reply}" if reply else f"{UNREADABLE}{reason}"


def fenced_blocks(text: str) -> list[str]:
    """Return the contents of the ``` fences of a text, without empty blocks.

    Raises:
        ActionError: a fence has no partner, so code cannot be distinguished from prose.
    """
    return [text[start:end] for start, end in fenced_spans(text)]


def fenced_spans(text: str) -> list[tuple[int, int]]:
    """Return where the contents of the ``` fences begin and end, see `fenced_blocks`.

    Raises:
        ActionError: a fence has no partner.
    """
    spans = [match.span(1) for match in _FENCE.finditer(text) if match[1].strip()]
    if spans and _FENCE.sub("", text).count("```"):
        raise ActionError(
            f"the action holds {len(spans)} blocks in ``` fences and a fence of no block, not one"
            " block; give one action at a time"
        )
    return spans


def _unfenced(text: str) -> str:
    """Return the one fenced block, or the whole text if there is none.

    Raises:
        ActionError: there are several blocks, of which all but one would be dropped silently.
    """
    blocks = fenced_blocks(text)
    if not blocks:
        return textwrap.dedent(text).strip()
    if len(blocks) > 1:
        raise ActionError(
            f"the action holds {len(blocks)} blocks in ``` fences, not one block; give one action"
            " at a time"
        )
    return textwrap.dedent(blocks[0]).strip()


def _is_text(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def check_code(code: str) -> None:
    """Check that `code` keeps to the grammar and only moves the pointer, presses keys and waits.

    Raises:
        ActionError: it does not; the message names line and column.
    """
    read_calls(ParsedSource(code), LIVE_FUNCTIONS)
