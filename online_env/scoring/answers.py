"""Read the one action that is scored from an agent's answer."""

from collections.abc import Sequence
from dataclasses import dataclass

from hijack_data.actions import parse_pyautogui, read_action
from hijack_data.errors import HijackError
from hijack_data.types import Action, Size


@dataclass(frozen=True, kw_only=True)
class StepAnswer:
    """An agent's answer to one row.

    Args:
        action: the first action, in pixels of the picture; `None` if it is none.
        text: that action as the agent wrote it.
        words: the agent's words.
        further_actions: how many actions followed; they are not scored.
        problem: why it is no action, or "".
    """

    action: Action | None
    text: str = ""
    words: str = ""
    further_actions: int = 0
    problem: str = ""


def read_answer(words: str, actions: Sequence[object], size: Size) -> StepAnswer:
    """Read the first action of an answer; points outside a picture of `size` move to its edge."""
    if not actions:
        return StepAnswer(action=None, words=words, problem="no action")
    first = actions[0]
    text = first if isinstance(first, str) else repr(first)[:200]
    further = len(actions) - 1
    try:
        action = _read(first, size)
    except HijackError as error:
        problem = f"no action: {error}"
        return StepAnswer(
            action=None, text=text, words=words, further_actions=further, problem=problem
        )
    return StepAnswer(action=action, text=text, words=words, further_actions=further)


def _read(first: object, size: Size) -> Action:
    request = read_action(first)
    if request.kind != "code":
        return Action(request.kind)
    return parse_pyautogui(request.code, size)
