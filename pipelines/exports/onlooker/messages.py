"""Questions to an onlooker, and summaries of a recording made from templates.

The wording of the questions is our own; models were trained on the words `Reminder:` and `None`.
"""

import json
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from ..example import IMAGE, escape_tokens
from ..stored_rows import holds_several_actions
from .screen_change import ScreenChange

_Fields: TypeAlias = Mapping[str, Any]
Messages: TypeAlias = list[dict[str, str]]

NONE = "None"
REMIND = (
    "You watch the machine while an agent works on the task. Is something wrong with the machine"
    " that no further step of the agent can put right, such as a locked session or a network that"
    f" is down? Answer `Reminder:` with what the agent should be told, or `Reminder: {NONE}`."
)
SUMMARISE = (
    "The first picture is the screen before the action, the second the screen after it. Say briefly"
    " what the agent did, what changed, and whether something happened that the agent did not do."
)
NOT_THE_AGENT = "Not the agent's doing:"
# At most this many characters of a typed text, or of code, are quoted.
MAX_QUOTED_CHARS = 200


def reminder_messages(instruction: str, reminder: str) -> Messages:
    """Return the chat of one frame."""
    return chat(
        f"{IMAGE}\nTask: {escape_tokens(instruction)}\n{REMIND}",
        f"Reminder: {escape_tokens(reminder)}",
    )


def summary_messages(instruction: str, action: str, summary: str) -> Messages:
    """Return the chat of two frames and the action between them."""
    task = f"Task: {escape_tokens(instruction)}"
    action_text = f"Action: {escape_tokens(action)}"
    question = "\n".join((IMAGE, IMAGE, task, action_text, SUMMARISE))
    return chat(question, escape_tokens(summary))


def summarise(row: _Fields, event: str | None, change: ScreenChange | None) -> str:
    """Return a summary of what happened between two screens.

    Args:
        row: the row before, with the agent's action and its `action_code`.
        event: an event that the agent did not cause, from the row after it, or `None`.
        change: how the screen changed, or `None` if that is not known.

    After an event it is unknown which changes the agent caused, so only the event is named.
    """
    action, code = row["action"], row["action_code"]
    if holds_several_actions(row):
        action = {**action, "type": "other"}  # the screen after shows what all of them did
    parts = [f"The agent {describe_action(action, code)}."]
    if event is not None:
        parts.append(f"{NOT_THE_AGENT} {event}")
    elif change is not None:
        parts.append(change.text())
    return " ".join(parts)


def describe_action(action: _Fields, code: str) -> str:
    """Return an action as the end of a sentence that begins with "The agent"."""
    kind = str(action["type"])
    modifiers = ""
    if action["keys"] and kind not in _KEYS:
        modifiers = f" while holding {'+'.join(action['keys'])}"
    if kind in _POINTER:
        return _POINTER[kind] + _at(action) + modifiers
    if kind in _OTHER:
        return _OTHER[kind](action) + modifiers
    if code:
        return f"did what was recorded as {_quote(code)}"
    return "did something that was not recorded"


def _at(action: _Fields, end: str = "", word: str = "at") -> str:
    x = action[f"x{end}"]
    y = action[f"y{end}"]
    if x is None or y is None:
        return ""
    return f" {word} ({x}, {y})"


def _describe_scroll(action: _Fields) -> str:
    amount = action["amount"] or 0
    direction = ""
    if amount:
        direction = " up" if amount > 0 else " down"
    return f"scrolled{direction}{_at(action)}"


def _describe_typing(action: _Fields) -> str:
    if action["text"] is None:
        return "typed"
    return f"typed {_quote(action['text'])}"


def _describe_keys(verb: str) -> Callable[[_Fields], str]:
    def words(action: _Fields) -> str:
        keys = "+".join(action["keys"] or ())
        return f"{verb} {keys or 'a key'}"

    return words


def _quote(text: str) -> str:
    short = text if len(text) <= MAX_QUOTED_CHARS else f"{text[:MAX_QUOTED_CHARS]}..."
    return json.dumps(short, ensure_ascii=False)


_POINTER: Mapping[str, str] = {
    "click": "clicked",
    "double_click": "double-clicked",
    "triple_click": "triple-clicked",
    "right_click": "right-clicked",
    "middle_click": "middle-clicked",
    "mouse_down": "pressed the mouse button",
    "mouse_up": "let go of the mouse button",
}
_KEYS = ("hotkey", "key_down", "key_up")
_OTHER: Mapping[str, Callable[[_Fields], str]] = {
    "move": lambda action: f"moved the pointer{_at(action, word='to')}",
    "drag": lambda action: f"dragged{_at(action, word='from')}{_at(action, '2', 'to')}",
    "scroll": _describe_scroll,
    "type": _describe_typing,
    "hotkey": _describe_keys("pressed"),
    "key_down": _describe_keys("held down"),
    "key_up": _describe_keys("let go of"),
    "wait": lambda _: "waited",
    "done": lambda _: "said that the task is done",
    "fail": lambda _: "said that the task cannot be done",
}


def chat(question: str, answer: str) -> Messages:
    """Return a question and its answer."""
    return [{"role": "user", "content": question}, {"role": "assistant", "content": answer}]
