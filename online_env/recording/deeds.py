"""From what a person's hands do, event by event, to actions: clicks, drags, scrolls, text, keys."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

NEAR = 5  # pixels by which a hand may tremble during a click
AGAIN = 0.6  # s between the clicks of a double click
TOGETHER = 2.0  # s between letters of one text, turns of one scroll
MODIFIERS = ("ctrl", "shift", "alt", "win")
_CLICKS = {("left", 1): "click", ("left", 2): "doubleClick", ("left", 3): "tripleClick", ("right", 1): "rightClick",
           ("middle", 1): "middleClick"}  # fmt: skip
View = TypeVar("View")


@dataclass
class _Deed(Generic[View]):
    """One action that may not be over yet; `view` is what was seen before it."""

    kind: str
    view: View
    at: float
    held: tuple[str, ...]
    fields: dict[str, Any] = field(default_factory=dict[str, Any])


class Deeds(Generic[View]):
    """Takes the events of `hijack desktop view` in order.

    Args:
        look: tells what is on the screen; asked before the first event of each action is passed on.
        done: told of each action that is over: what was seen before it, and its pyautogui code.
        clock: seconds.
    """

    def __init__(
        self, look: Callable[[], View], done: Callable[[View, str], object], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._look, self._done, self._clock = look, done, clock
        self._present: _Deed[View] | None = None
        self._held: dict[str, bool] = {}  # modifiers that are down, and whether they served for something

    def event(self, event: Mapping[str, Any]) -> None:
        """Take in one event, before it reaches the desktop. What is no event of the page counts for nothing."""
        act = {"down": self._down, "up": self._up, "scroll": self._scroll, "type": self._type, "key": self._key,
               "key_down": self._key_down, "key_up": self._key_up}.get(str(event.get("type")))  # fmt: skip
        if act is not None:
            act(event)

    def flush(self) -> None:
        """End the present action."""
        if self._present is not None:
            deed, self._present = self._present, None
            self._done(deed.view, _code(deed))

    def _begin(self, kind: str, **fields: Any) -> None:
        self.flush()
        self._held = dict.fromkeys(self._held, True)
        self._present = _Deed(kind, self._look(), self._clock(), tuple(self._held), fields)

    def _goes_on(self, kind: str, patience: float) -> "dict[str, Any] | None":
        """The fields of the present action if it is of that kind and this event still belongs to it."""
        deed = self._present
        if deed is None or deed.kind != kind or self._clock() - deed.at > patience or deed.held != tuple(self._held):
            return None
        deed.at = self._clock()
        return deed.fields

    def _down(self, event: Mapping[str, Any]) -> None:
        place, button = (event["x"], event["y"]), event.get("button", "left")
        fields = self._goes_on("press", AGAIN)
        if fields and (fields["button"], fields["end"]) == (button, fields["start"]) and _near(place, fields["start"]):
            fields["clicks"] += 1
        else:
            self._begin("press", button=button, start=place, end=place, clicks=1)

    def _up(self, event: Mapping[str, Any]) -> None:
        if self._present is not None and self._present.kind == "press":
            place, start = (event["x"], event["y"]), self._present.fields["start"]
            self._present.fields["end"] = start if _near(place, start) else place
            self._present.at = self._clock()

    def _scroll(self, event: Mapping[str, Any]) -> None:
        place, fields = (event["x"], event["y"]), self._goes_on("scroll", TOGETHER)
        if fields and fields["place"] == place and (fields["amount"] > 0) == (event["amount"] > 0):
            fields["amount"] += event["amount"]
        else:
            self._begin("scroll", place=place, amount=event["amount"])

    def _type(self, event: Mapping[str, Any]) -> None:
        fields = self._goes_on("type", TOGETHER)
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
        if self._held.pop(event["key"], True) is False and event["key"] == "win":
            self._key(event)  # alone it opens a menu; the others do nothing alone


def _near(one: tuple[int, int], other: tuple[int, int]) -> bool:
    return max(abs(one[0] - other[0]), abs(one[1] - other[1])) <= NEAR


def _code(deed: _Deed[Any]) -> str:
    """The deed as pyautogui code."""
    fields, held = deed.fields, deed.held
    if deed.kind == "keys":
        keys = ", ".join(map(repr, (*held, fields["key"])))
        return f"pyautogui.hotkey({keys})" if held else f"pyautogui.press({keys})"
    if deed.kind == "type":
        return f"pyautogui.write({fields['text']!r})"
    if deed.kind == "scroll":
        x, y = fields["place"]
        code = f"pyautogui.scroll({fields['amount']}, {x}, {y})"
    else:
        code = _press(fields)
    down = [f"pyautogui.keyDown({key!r})" for key in held]
    up = [f"pyautogui.keyUp({key!r})" for key in reversed(held)]
    return "\n".join([*down, code, *up])


def _press(fields: Mapping[str, Any]) -> str:
    (x, y), (x2, y2), button = fields["start"], fields["end"], fields["button"]
    if (x, y) != (x2, y2):
        return f"pyautogui.moveTo({x}, {y})\npyautogui.dragTo({x2}, {y2}, button={button!r})"
    function = _CLICKS.get((button, fields["clicks"]))
    if function is not None:
        return f"pyautogui.{function}({x}, {y})"
    return f"pyautogui.click({x}, {y}, clicks={fields['clicks']}, button={button!r})"
