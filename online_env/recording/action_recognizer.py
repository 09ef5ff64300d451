"""From a person's input events to actions: clicks, drags, scrolls, text and keys."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

CLICK_TREMOR_PIXELS = 5  # pixels by which a hand may tremble during a click
DOUBLE_CLICK_S = 0.6  # s between the clicks of a double click
MERGE_TIMEOUT_S = 2.0  # s between letters of one text, turns of one scroll
MODIFIERS = ("ctrl", "shift", "alt", "win")
_CLICKS = {
    ("left", 1): "click",
    ("left", 2): "doubleClick",
    ("left", 3): "tripleClick",
    ("right", 1): "rightClick",
    ("middle", 1): "middleClick",
}
View = TypeVar("View")


@dataclass
class _OpenAction(Generic[View]):
    """An action that may not be over yet.

    Args:
        kind: `press`, `scroll`, `type` or `keys`.
        view: What was on the screen before it.
        at: When its last event came, in seconds.
        held: The modifiers that were down.
        fields: What is known of it, by kind.
    """

    kind: str
    view: View
    at: float
    held: tuple[str, ...]
    fields: dict[str, Any] = field(default_factory=dict[str, Any])


class ActionRecognizer(Generic[View]):
    """Joins the events of `hijack desktop view`, in their order, to actions.

    Args:
        look: Returns what is on the screen; called before the first event of each action is
            passed on.
        on_action: Called with each action that is over: the view before it, and its pyautogui code.
        clock: Returns seconds.
    """

    def __init__(
        self,
        look: Callable[[], View],
        on_action: Callable[[View, str], object],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._look = look
        self._on_action = on_action
        self._clock = clock
        self._present: _OpenAction[View] | None = None
        # Modifiers that are down, and whether they were used with something.
        self._held: dict[str, bool] = {}
        self._handlers: Mapping[str, Callable[[Mapping[str, Any]], None]] = {
            "down": self._down,
            "up": self._up,
            "scroll": self._scroll,
            "type": self._type,
            "key": self._key,
            "key_down": self._key_down,
            "key_up": self._key_up,
        }

    def event(self, event: Mapping[str, Any]) -> None:
        """Take in one event, before it reaches the desktop; unknown events are ignored."""
        handler = self._handlers.get(str(event.get("type")))
        if handler is not None:
            handler(event)

    def flush(self) -> None:
        """End the present action."""
        action = self._present
        self._present = None
        if action is not None:
            self._on_action(action.view, _code(action))

    def _begin(self, kind: str, **fields: Any) -> None:
        self.flush()
        self._held = dict.fromkeys(self._held, True)
        view = self._look()
        self._present = _OpenAction(kind, view, self._clock(), tuple(self._held), fields)

    def _continued(self, kind: str, max_pause: float) -> "dict[str, Any] | None":
        """Return the fields of the present action if this event still belongs to it."""
        action = self._present
        if action is None or action.kind != kind:
            return None
        if self._clock() - action.at > max_pause or action.held != tuple(self._held):
            return None
        action.at = self._clock()
        return action.fields

    def _down(self, event: Mapping[str, Any]) -> None:
        point = (event["x"], event["y"])
        button = event.get("button", "left")
        fields = self._continued("press", DOUBLE_CLICK_S)
        if fields and _is_another_click(fields, button, point):
            fields["clicks"] += 1
        else:
            self._begin("press", button=button, start=point, end=point, clicks=1)

    def _up(self, event: Mapping[str, Any]) -> None:
        action = self._present
        if action is None or action.kind != "press":
            return
        point = (event["x"], event["y"])
        start = action.fields["start"]
        action.fields["end"] = start if _near(point, start) else point
        action.at = self._clock()

    def _scroll(self, event: Mapping[str, Any]) -> None:
        point = (event["x"], event["y"])
        amount = event["amount"]
        fields = self._continued("scroll", MERGE_TIMEOUT_S)
        if fields and fields["place"] == point and (fields["amount"] > 0) == (amount > 0):
            fields["amount"] += amount
        else:
            self._begin("scroll", place=point, amount=amount)

    def _type(self, event: Mapping[str, Any]) -> None:
        fields = self._continued("type", MERGE_TIMEOUT_S)
        if fields:
            fields["text"] += event["text"]
        else:
            self._begin("type", text=event["text"])

    def _key(self, event: Mapping[str, Any]) -> None:
        self._begin("keys", key=event["key"])
        self.flush()

    def _key_down(self, event: Mapping[str, Any]) -> None:
        if event["key"] in MODIFIERS:
            self._held.setdefault(event["key"], False)
        else:
            self._key(event)

    def _key_up(self, event: Mapping[str, Any]) -> None:
        key = event["key"]
        was_used = self._held.pop(key, True)
        if key == "win" and not was_used:
            self._key(event)  # alone it opens a menu; the other modifiers do nothing alone


def _is_another_click(fields: Mapping[str, Any], button: str, point: tuple[int, int]) -> bool:
    """Return whether a press continues clicks on the same place, which were no drag."""
    if fields["button"] != button or fields["end"] != fields["start"]:
        return False
    return _near(point, fields["start"])


def _near(first: tuple[int, int], second: tuple[int, int]) -> bool:
    return max(abs(first[0] - second[0]), abs(first[1] - second[1])) <= CLICK_TREMOR_PIXELS


def _code(action: _OpenAction[Any]) -> str:
    """Return an action as pyautogui code."""
    fields = action.fields
    if action.kind == "keys":
        keys = ", ".join(map(repr, (*action.held, fields["key"])))
        function = "hotkey" if action.held else "press"
        return f"pyautogui.{function}({keys})"
    if action.kind == "type":
        return f"pyautogui.write({fields['text']!r})"
    if action.kind == "scroll":
        x, y = fields["place"]
        code = f"pyautogui.scroll({fields['amount']}, {x}, {y})"
    else:
        code = _press(fields)
    down = [f"pyautogui.keyDown({key!r})" for key in action.held]
    up = [f"pyautogui.keyUp({key!r})" for key in reversed(action.held)]
    return "\n".join([*down, code, *up])


def _press(fields: Mapping[str, Any]) -> str:
    x, y = fields["start"]
    x2, y2 = fields["end"]
    button = fields["button"]
    if (x, y) != (x2, y2):
        return f"pyautogui.moveTo({x}, {y})\npyautogui.dragTo({x2}, {y2}, button={button!r})"
    function = _CLICKS.get((button, fields["clicks"]))
    if function is not None:
        return f"pyautogui.{function}({x}, {y})"
    return f"pyautogui.click({x}, {y}, clicks={fields['clicks']}, button={button!r})"
