"""Moving the pointer, clicking, dragging and scrolling."""

import time
from collections.abc import Callable

from Xlib import X

from .connection import Connection

BUTTONS: dict[str, int] = {"left": 1, "middle": 2, "right": 3, "primary": 1, "secondary": 3}
MOST_BUTTONS = 9
UP, DOWN, LEFT, RIGHT = 4, 5, 6, 7  # the wheel's buttons
RATE = 60  # moves a second on the way
MOST_STEPS = 10 * RATE
# toolkits start a drag only on moves that they see one after the other
DRAG_STEPS = 10
DRAG_TIME = 0.1
MAX_SCROLL = 10_000


class UnknownButtonError(ValueError):
    """A mouse button that does not exist, or an amount that no wheel turns."""


def button_number(button: str | int) -> int:
    """Return the X number of a button: 1 to 9, or one of `BUTTONS`.

    Raises:
        UnknownButtonError: There is no such button.
    """
    number = button
    if isinstance(number, str):
        number = BUTTONS.get(number.lower(), 0)
    if isinstance(number, bool) or not 1 <= number <= MOST_BUTTONS:
        raise UnknownButtonError(
            f"there is no mouse button {button!r}; use {', '.join(BUTTONS)} or 1 to 9"
        )
    return number


class Pointer:
    """The pointer of a display.

    Points are pixels; those beside the screen are moved onto it.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._held: list[int] = []

    @property
    def position(self) -> tuple[int, int]:
        """Where the pointer is, `(x, y)` in pixels."""
        pointer = self._connection.root.query_pointer()
        return pointer.root_x, pointer.root_y

    def move(
        self, x: int, y: int, duration: float = 0.0, tween: Callable[[float], float] | None = None
    ) -> None:
        """Move to a point on a straight line.

        Args:
            x: of the point.
            y: of the point.
            duration: in seconds.
            tween: maps the share of time to that of way.
        """
        steps = max(1, _steps(duration))
        self._move(x, y, duration, steps, tween)

    def down(self, button: str | int = "left") -> None:
        """Press a button and leave it down."""
        number = button_number(button)
        self._held.append(number)
        self._send(X.ButtonPress, number)

    def up(self, button: str | int = "left") -> None:
        """Release a button."""
        number = button_number(button)
        if number in self._held:
            self._held.remove(number)
        self._send(X.ButtonRelease, number)

    def click(self, button: str | int = "left", clicks: int = 1, interval: float = 0.0) -> None:
        """Click where the pointer is."""
        for index in range(clicks):
            if index:
                time.sleep(interval)
            self.down(button)
            self.up(button)

    def drag(
        self,
        x: int,
        y: int,
        button: str | int = "left",
        duration: float = 0.0,
        tween: Callable[[float], float] | None = None,
    ) -> None:
        """Drag from where the pointer is; the button is released whatever happens."""
        self.down(button)
        try:
            self.drag_move(x, y, duration, tween)
        finally:
            self.up(button)

    def drag_move(
        self, x: int, y: int, duration: float = 0.0, tween: Callable[[float], float] | None = None
    ) -> None:
        """Move as in a drag: by steps that a toolkit recognises, even where no time is given."""
        duration = max(duration, DRAG_TIME)
        steps = max(DRAG_STEPS, _steps(duration))
        self._move(x, y, duration, steps, tween)

    def scroll(self, amount: int, horizontal: bool = False) -> None:
        """Turn the wheel by `amount` clicks: up and right are positive.

        Raises:
            UnknownButtonError: It is beyond `MAX_SCROLL`.
        """
        if abs(amount) > MAX_SCROLL:
            raise UnknownButtonError(
                f"scrolling by {amount} clicks is beyond {MAX_SCROLL}; scroll less"
            )
        positive = RIGHT if horizontal else UP
        negative = LEFT if horizontal else DOWN
        button = positive if amount > 0 else negative
        for _ in range(abs(amount)):
            self.click(button)

    def release_all(self) -> None:
        """Release every button that was pressed here and is still down."""
        for number in list(self._held):
            self.up(number)

    def _move(
        self, x: int, y: int, duration: float, steps: int, tween: Callable[[float], float] | None
    ) -> None:
        start_x, start_y = self.position
        for step in range(1, steps):
            share = step / steps
            if tween is not None:
                share = tween(share)
            at_x = start_x + (x - start_x) * share
            at_y = start_y + (y - start_y) * share
            self._jump(round(at_x), round(at_y))
            time.sleep(duration / steps)
        if steps > 1:
            time.sleep(duration / steps)
        self._jump(x, y)

    def _jump(self, x: int, y: int) -> None:
        width, height = self._connection.size
        inside_x = max(0, min(x, width - 1))
        inside_y = max(0, min(y, height - 1))
        self._connection.fake(X.MotionNotify, x=inside_x, y=inside_y)
        self._connection.sync()

    def _send(self, kind: int, number: int) -> None:
        self._connection.fake(kind, number)
        self._connection.sync()


def _steps(duration: float) -> int:
    """Return how many moves to make on a way of so many seconds."""
    return min(round(duration * RATE), MOST_STEPS)
