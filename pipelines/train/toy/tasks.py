"""The tasks of the toy desktop: what is on the screen, what is asked for, and their sets."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal, TypeAlias, TypeVar

from hijack_data.errors import ParameterError, UnknownNameError
from hijack_data.rng import Stream
from hijack_data.types import Box

HEIGHT, WIDTH = 64, 96
SHAPES = ("button", "field", "knob")
COLOURS = {
    "red": (204, 52, 44),
    "green": (46, 150, 70),
    "blue": (48, 92, 200),
    "yellow": (222, 184, 40),
    "purple": (138, 60, 160),
}
PREFIX = "toy-"
WINDOW = (64, 44)  # width and height
TITLE = 7  # height of the title bar
SLOT = (20, 12)
GRID = (3, 3)  # slots side by side, and one above the other
WIDGETS = 5
MENU = 3  # items of a menu

Goal: TypeAlias = Literal["press", "pair", "menu"]
GOALS: tuple[Goal, ...] = ("press", "pair", "menu")
T = TypeVar("T")


@dataclass(frozen=True)
class ToyWidget:
    """One element of the window; `at` is its upper left corner, from that of the window."""

    shape: str
    colour: str
    at: tuple[int, int]

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return (12, 7) if self.shape in ("button", "field") else (8, 8)

    @property
    def words(self) -> str:
        """How an instruction names it."""
        return f"{self.colour} {self.shape}"


@dataclass(frozen=True, kw_only=True)
class ToyTask:
    """One task.

    Args:
        name: `toy-` and a number.
        goal: `press` one widget, a `pair` of them in order, or choose from the `menu`.
        widgets: all of the window; the first ones are the targets.
        menu: the colours of the menu's items; the first is the target.
        order: in which the items stand.
        corner: the upper left corner of the window.
        wallpaper: three RGB colours: the ground and two shapes on it.
        shapes: the boxes of these shapes.
        shade: brightness of the window's ground, 0..255.
    """

    name: str
    goal: Goal
    widgets: tuple[ToyWidget, ...]
    menu: tuple[str, ...]
    order: tuple[int, ...]
    corner: tuple[int, int]
    wallpaper: tuple[tuple[int, int, int], ...]
    shapes: tuple[Box, ...]
    shade: int

    @property
    def length(self) -> int:
        """How many things must be pressed or chosen."""
        return 2 if self.goal == "pair" else 1

    @property
    def instruction(self) -> str:
        """What the agent is told."""
        if self.goal == "menu":
            return f"choose {self.menu[0]} from the menu"
        first = f"press the {self.widgets[0].words}"
        if self.goal == "press":
            return first
        return f"{first} then the {self.widgets[1].words}"


def task_names(first: int, count: int) -> tuple[str, ...]:
    """Return the names of `count` tasks from number `first` on."""
    return tuple(f"{PREFIX}{number:05d}" for number in range(first, first + count))


@cache
def toy_task(name: str) -> ToyTask:
    """Return a task; its number alone decides what it is.

    Raises:
        UnknownNameError: the name is not `toy-` and a number.
    """
    digits = name.removeprefix(PREFIX)
    if digits == name or not digits.isdecimal():
        raise UnknownNameError(f"no task {name!r} of the toy desktop; known: toy-00000, ...")
    stream = Stream(0, "toy_task-v1", name)
    kinds = [(shape, colour) for shape in SHAPES for colour in COLOURS]
    slots = [(x, y) for y in range(GRID[1]) for x in range(GRID[0])]
    widgets = tuple(
        _widget(kind, slot, stream)
        for kind, slot in zip(
            _draw(kinds, WIDGETS, stream), _draw(slots, WIDGETS, stream), strict=True
        )
    )
    return ToyTask(
        name=name,
        goal=stream.choice(GOALS),
        widgets=widgets,
        menu=tuple(_draw(list(COLOURS), MENU, stream)),
        order=tuple(_draw(list(range(MENU)), MENU, stream)),
        corner=(stream.integer(0, WIDTH - WINDOW[0]), stream.integer(0, HEIGHT - 7 - WINDOW[1])),
        wallpaper=tuple(_colour(stream) for _ in range(3)),
        shapes=tuple(_shape(stream) for _ in range(2)),
        shade=stream.integer(215, 250),
    )


def _widget(kind: tuple[str, str], slot: tuple[int, int], stream: Stream) -> ToyWidget:
    x = 2 + slot[0] * SLOT[0] + stream.integer(0, SLOT[0] - 14)
    y = TITLE + 1 + slot[1] * SLOT[1] + stream.integer(0, SLOT[1] - 9)
    return ToyWidget(*kind, (x, y))


def _colour(stream: Stream) -> tuple[int, int, int]:
    red, green, blue = (stream.integer(40, 150) for _ in range(3))
    return red, green, blue


def _shape(stream: Stream) -> Box:
    x = stream.integer(0, WIDTH - 20)
    y = stream.integer(0, HEIGHT - 20)
    return x, y, x + stream.integer(8, 40), y + stream.integer(8, 30)


def _draw(options: Sequence[T], count: int, stream: Stream) -> list[T]:
    """Return `count` different options.

    Raises:
        ParameterError: there are not so many.
    """
    if count > len(options):
        raise ParameterError(f"cannot draw {count} of {len(options)}")
    remaining = list(options)
    return [remaining.pop(stream.integer(0, len(remaining) - 1)) for _ in range(count)]
