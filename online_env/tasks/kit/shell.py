"""The terminal, as a person uses it: a line typed at the prompt, and its output awaited."""

import re
import time

from ...errors import DesktopTimeoutError
from ..hand import PAUSE, TIMEOUT_S, Hand

APP = "xfce4-terminal"
_PROMPT = re.compile(r"\$ $")


def command(hand: Hand, line: str, timeout: float = TIMEOUT_S) -> str:
    """Type a command at the prompt, and wait until the next prompt is there.

    Args:
        hand: The hand.
        line: The command, in one line.
        timeout: Seconds that it may take.

    Returns:
        What the terminal shows then.

    Raises:
        DesktopTimeoutError: There is no prompt, or the command did not end in time.
    """
    before = _at_prompt(hand)
    hand.type(f"{line}\n")
    deadline = time.monotonic() + timeout
    while True:
        text = screen(hand)
        if text != before and _PROMPT.search(text):
            return text
        if time.monotonic() > deadline:
            raise DesktopTimeoutError(f"{line!r} did not end within {timeout:g} s: {text[-200:]}")
        time.sleep(PAUSE)


def screen(hand: Hand) -> str:
    """Return what the terminal shows, up to the last line that has something."""
    return hand.find("terminal", app=APP).text.rstrip("\n")


def _at_prompt(hand: Hand) -> str:
    """Put the cursor at an empty prompt, and return what the terminal shows."""
    if "focused" not in hand.find("terminal", app=APP).states:
        hand.click_on("terminal", app=APP)
        hand.find("terminal", app=APP, state="focused")
    text = screen(hand)
    if _PROMPT.search(text):
        return text
    hand.press("ctrl", "c")
    node = hand.wait(
        f"prompt of {APP}",
        lambda node: node.role == "terminal" and bool(_PROMPT.search(node.text.rstrip("\n"))),
    )
    return node.text.rstrip("\n")
