"""`/ah/input`: a list of mouse and keyboard events, played in order.

Nothing stays pressed if one of them is wrong.
"""

from collections.abc import Callable
from typing import Any, cast

from ...errors import GuestError
from .display import SharedDisplay
from .request_fields import BAD_REQUEST, flag, number, text
from .shim.ah_input import Connection, Keyboard, Pointer, UnknownButtonError, UnknownKeyError

MAX_EVENTS = 1000
MAX_COORDINATE = 100_000
MAX_DURATION_S = 60.0  # seconds of one event
MAX_CLICKS = 10
MAX_PRESSES = 1000
MAX_INTERVAL = 5.0
MAX_TYPING_INTERVAL = 1.0

Event = dict[str, Any]


class Input:
    """Mouse and keyboard of a display."""

    def __init__(self, display: SharedDisplay) -> None:
        self._display = display

    def play(self, events: object) -> int:
        """Play events.

        Each is an object with `type`: `move` (x, y, duration), `click` (x, y, button, clicks,
        interval), `down`, `up` (x, y, button), `drag` (x, y, x2, y2, button, duration), `scroll`
        (x, y, amount, horizontal), `type` (text, interval), `key` (key, presses), `key_down`,
        `key_up` (key), `hotkey` (keys). If a point may be left out, the pointer stays where it is.

        Args:
            events: a list of them.

        Returns:
            How many there were.

        Raises:
            GuestError: An event is wrong (400); the error names it.
        """
        if not isinstance(events, list) or len(cast("list[object]", events)) > MAX_EVENTS:
            raise GuestError(f"events must be a list of at most {MAX_EVENTS} events", BAD_REQUEST)
        rows = cast("list[object]", events)
        with self._display.use() as connection:
            player = _Player(connection)
            for index, row in enumerate(rows):
                try:
                    player.play(row)
                except (GuestError, UnknownButtonError, UnknownKeyError) as error:
                    player.release()
                    raise GuestError(f"events[{index}]: {error}", BAD_REQUEST) from None
        return len(rows)

    def position(self) -> tuple[int, int]:
        """Return where the pointer is."""
        with self._display.use() as connection:
            return Pointer(connection).position


class _Player:
    def __init__(self, connection: Connection) -> None:
        self.pointer = Pointer(connection)
        self.keyboard = Keyboard(connection)

    def release(self) -> None:
        self.pointer.release_all()
        self.keyboard.release_all()

    def play(self, row: object) -> None:
        event: Event = {}
        if isinstance(row, dict):
            event = cast("Event", row)
        act = _ACTS.get(str(event.get("type")))
        if act is None:
            event_types = ", ".join(_ACTS)
            raise GuestError(f"type must be one of {event_types}; got {row!r:.200}", BAD_REQUEST)
        act(self, event)

    def go(self, event: Event, timed: bool = True) -> None:
        """Move to the event's point, if it has one; at once if not `timed`."""
        if "x" in event or "y" in event:
            x, y = _point(event, "x", "y")
            duration = _duration(event) if timed else 0.0
            self.pointer.move(x, y, duration)

    def move(self, event: Event) -> None:
        x, y = _point(event, "x", "y")
        self.pointer.move(x, y, _duration(event))

    def click(self, event: Event) -> None:
        clicks = int(number(event, "clicks", 1, 0, MAX_CLICKS))
        interval = number(event, "interval", 0.0, 0.0, MAX_INTERVAL)
        self.go(event)
        self.pointer.click(_button(event), clicks, interval)

    def down(self, event: Event) -> None:
        self.go(event)
        self.pointer.down(_button(event))

    def up(self, event: Event) -> None:
        self.go(event)
        self.pointer.up(_button(event))

    def drag(self, event: Event) -> None:
        x, y = _point(event, "x2", "y2")
        duration = _duration(event)
        self.go(event, timed=False)
        self.pointer.drag(x, y, _button(event), duration)

    def scroll(self, event: Event) -> None:
        amount = int(number(event, "amount", None, -1000, 1000))
        self.go(event)
        self.pointer.scroll(amount, flag(event, "horizontal"))

    def type(self, event: Event) -> None:
        content = event.get("text")
        if not isinstance(content, str):
            raise GuestError(f"text must be a text, got {content!r:.200}", BAD_REQUEST)
        interval = number(event, "interval", 0.0, 0.0, MAX_TYPING_INTERVAL)
        if interval * len(content) > MAX_DURATION_S:
            raise GuestError(
                f"typing {len(content)} characters at {interval:g} s each is over"
                f" {MAX_DURATION_S:g} s",
                BAD_REQUEST,
            )
        self.keyboard.type(content, interval)

    def key(self, event: Event) -> None:
        name = text(event, "key")
        presses = int(number(event, "presses", 1, 0, MAX_PRESSES))
        for _ in range(presses):
            self.keyboard.press(name)

    def key_down(self, event: Event) -> None:
        self.keyboard.down(text(event, "key"))

    def key_up(self, event: Event) -> None:
        self.keyboard.up(text(event, "key"))

    def hotkey(self, event: Event) -> None:
        keys = _key_names(event)
        interval = number(event, "interval", 0.0, 0.0, MAX_INTERVAL)
        self.keyboard.hotkey(keys, interval)


_ACTS: dict[str, Callable[[_Player, Event], None]] = {
    "move": _Player.move,
    "click": _Player.click,
    "down": _Player.down,
    "up": _Player.up,
    "drag": _Player.drag,
    "scroll": _Player.scroll,
    "type": _Player.type,
    "key": _Player.key,
    "key_down": _Player.key_down,
    "key_up": _Player.key_up,
    "hotkey": _Player.hotkey,
}


def _point(event: Event, x: str, y: str) -> tuple[int, int]:
    across = number(event, x, None, -MAX_COORDINATE, MAX_COORDINATE)
    down = number(event, y, None, -MAX_COORDINATE, MAX_COORDINATE)
    return round(across), round(down)


def _duration(event: Event) -> float:
    return number(event, "duration", 0.0, 0.0, MAX_DURATION_S)


def _button(event: Event) -> str | int:
    button = event.get("button", "left")
    if isinstance(button, bool) or not isinstance(button, str | int):
        raise GuestError(f"button must be a name or a number, got {button!r:.200}", BAD_REQUEST)
    return button


def _key_names(event: Event) -> list[str]:
    keys = event.get("keys")
    if isinstance(keys, list):
        names = cast("list[object]", keys)
        if all(isinstance(name, str) for name in names):
            return cast("list[str]", names)
    raise GuestError(f"keys must be a list of key names, got {keys!r:.200}", BAD_REQUEST)
