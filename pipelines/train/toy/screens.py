"""The screens of the toy desktop, and what a click at each place does.

A screen follows from a task and a state; there are few states, so each is painted once.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Literal, TypeAlias

import numpy as np

from hijack_data.types import Box, UInt8Array

from .tasks import COLOURS, HEIGHT, TITLE, WIDTH, WINDOW, ToyTask, ToyWidget, toy_task

Cover: TypeAlias = Literal["", "minimised", "locked", "offline", "touched"]
ToyClick: TypeAlias = Literal["right", "wrong", "menu", "close", "recover", "other"]
ToyColour: TypeAlias = tuple[int, int, int]

BAR = 6  # height of the task bar
DARK = (40, 40, 46)
WHITE = (250, 250, 250)
GREY = (168, 170, 176)
LAUNCHER: Box = (2, HEIGHT - BAR + 1, 18, HEIGHT - 1)
ITEM = (24, 8)  # width and height of a menu item
SECOND: Box = (66, 6, 96, 48)  # the other application, beside the window at the left edge


@dataclass(frozen=True)
class ToyState:
    """What the desktop shows of a task.

    Args:
        done: how many of the task's clicks were made, 0 to 2.
        menu: whether the menu is open.
        cover: what keeps the agent from the window.
        beside: whether another application stands beside it.
    """

    done: int = 0
    menu: bool = False
    cover: Cover = ""
    beside: bool = False


@dataclass
class ToyScreen:
    """One screen.

    Args:
        pixels: uint8 `[64, 96, 3]`.
        clicks: what can be clicked, the topmost last.
        boxes: int32 `[N, 4]`, the elements that show, for corruptions that keep clear of them.
    """

    pixels: UInt8Array
    clicks: list[tuple[Box, ToyClick]] = field(default_factory=list[tuple[Box, ToyClick]])

    @property
    def boxes(self) -> np.ndarray:
        """The elements that show, int32 `[N, 4]`, `xyxy`."""
        return np.array([box for box, _ in self.clicks], np.int32).reshape(-1, 4)

    def at(self, x: int, y: int) -> ToyClick:
        """Return what a click does."""
        for box, click in reversed(self.clicks):
            if box[0] <= x < box[2] and box[1] <= y < box[3]:
                return click
        return "other"

    def fill(self, box: Box, colour: ToyColour) -> None:
        """Fill a box; what leaves the screen is cut off."""
        x1, y1, x2, y2 = box
        self.pixels[max(y1, 0) : max(y2, 0), max(x1, 0) : max(x2, 0)] = colour

    def panel(self, box: Box, colour: ToyColour, edge: ToyColour = DARK) -> None:
        """Fill a box with an edge of one pixel."""
        x1, y1, x2, y2 = box
        self.fill(box, edge)
        self.fill((x1 + 1, y1 + 1, x2 - 1, y2 - 1), colour)


@lru_cache(maxsize=4096)
def paint_screen(name: str, state: ToyState) -> ToyScreen:
    """Return the screen of a task in a state; do not write into its pixels."""
    task = toy_task(name)
    screen = ToyScreen(np.empty((HEIGHT, WIDTH, 3), np.uint8))
    _ground(screen, task)
    if state.cover == "locked":
        _lock(screen)
    elif state.cover == "minimised":
        screen.clicks = [(LAUNCHER, "recover")]
    else:
        _window(screen, task, state)
        if state.beside:
            _second(screen)
    screen.pixels.flags.writeable = False
    return screen


def next_target(screen: ToyScreen) -> Box | None:
    """Return where a careful user clicks next: to recover, else at what is right, else the menu."""
    for wanted in ("recover", "right", "menu"):
        for box, click in screen.clicks:
            if click == wanted:
                return box
    return None


def _ground(screen: ToyScreen, task: ToyTask) -> None:
    screen.fill((0, 0, WIDTH, HEIGHT), task.wallpaper[0])
    for box, colour in zip(task.shapes, task.wallpaper[1:], strict=True):
        screen.fill(box, colour)
    screen.fill((0, HEIGHT - BAR, WIDTH, HEIGHT), DARK)
    screen.panel(LAUNCHER, (90, 120, 170))


def _lock(screen: ToyScreen) -> None:
    screen.fill((0, 0, WIDTH, HEIGHT), (24, 32, 48))
    screen.panel((28, 14, 68, 50), (60, 70, 92), WHITE)
    screen.fill((42, 18, 54, 28), GREY)
    button = (34, 34, 62, 43)
    screen.panel(button, WHITE)
    screen.clicks = [(button, "recover")]


def _window(screen: ToyScreen, task: ToyTask, state: ToyState) -> None:
    x, y = (0, task.corner[1]) if state.beside else task.corner
    ground = (task.shade, task.shade, task.shade)
    screen.panel((x, y, x + WINDOW[0], y + WINDOW[1]), ground)
    screen.fill((x + 1, y + 1, x + WINDOW[0] - 1, y + TITLE), (120, 128, 144))
    if state.cover == "offline":
        _error_page(screen, x, y)
        return
    _menu_button(screen, task, state, x, y)
    for number, widget in enumerate(task.widgets):
        box = _box(widget, x, y)
        _paint(screen, widget, box)
        if task.goal != "menu" and number < min(state.done, task.length):
            _tick(screen, box)
        screen.clicks.append((box, _meaning(task, state, number)))
    if state.menu:
        _open_menu(screen, task, state, x, y)
    if state.cover == "touched":
        _dialog(screen, x, y)


def _menu_button(screen: ToyScreen, task: ToyTask, state: ToyState, x: int, y: int) -> None:
    button = (x + 2, y + 1, x + 12, y + TITLE)
    screen.fill(button, WHITE)
    for line in range(3):
        screen.fill((x + 4, y + 2 + 2 * line, x + 10, y + 3 + 2 * line), DARK)
    screen.clicks.append((button, "menu"))
    if task.goal == "menu" and state.done:
        screen.panel((x + 44, y + 1, x + 60, y + TITLE), COLOURS[task.menu[0]])


def _meaning(task: ToyTask, state: ToyState, number: int) -> ToyClick:
    """Return what a click on a widget does."""
    if task.goal != "menu" and number < task.length:
        if number == state.done:
            return "right"
        if number < state.done:
            return "other"
    return "wrong"


def _open_menu(screen: ToyScreen, task: ToyTask, state: ToyState, x: int, y: int) -> None:
    """Draw the menu over the window; while it is open, a click beside it only closes it."""
    screen.clicks = [((0, 0, WIDTH, HEIGHT), "close")]
    for row, item in enumerate(task.order):
        top = y + TITLE + row * ITEM[1]
        box = (x + 2, top, x + 2 + ITEM[0], top + ITEM[1])
        screen.panel(box, WHITE)
        screen.fill((box[0] + 3, top + 2, box[2] - 3, top + ITEM[1] - 2), COLOURS[task.menu[item]])
        is_right = task.goal == "menu" and item == 0 and not state.done
        screen.clicks.append((box, "right" if is_right else "wrong"))


def _dialog(screen: ToyScreen, x: int, y: int) -> None:
    """Draw what an accidental touch opened; nothing else answers until it is closed."""
    screen.panel((x + 10, y + 10, x + 54, y + 38), (206, 214, 226))
    for line in range(2):
        screen.fill((x + 15, y + 15 + 4 * line, x + 49, y + 17 + 4 * line), GREY)
    button = (x + 24, y + 26, x + 40, y + 34)
    screen.panel(button, (120, 150, 200))
    screen.clicks = [(button, "recover")]


def _error_page(screen: ToyScreen, x: int, y: int) -> None:
    """Draw the page of a browser without a network; its button loads the page again."""
    screen.fill((x + 1, y + TITLE, x + WINDOW[0] - 1, y + WINDOW[1] - 1), WHITE)
    screen.fill((x + 8, y + 12, x + 16, y + 20), GREY)
    for line in range(2):
        screen.fill((x + 8, y + 23 + 3 * line, x + 50, y + 24 + 3 * line), GREY)
    button = (x + 40, y + 32, x + 58, y + 40)
    screen.panel(button, (70, 130, 230))
    screen.clicks = [(button, "recover")]


def _second(screen: ToyScreen) -> None:
    """Draw another application; none of its elements belongs to the task."""
    x, y, _, _ = SECOND
    screen.panel(SECOND, (236, 238, 226))
    screen.fill((x + 1, y + 1, SECOND[2] - 1, y + TITLE), (70, 110, 90))
    for number, (shape, colour) in enumerate(
        (("button", "green"), ("field", "purple"), ("button", "red"))
    ):
        widget = ToyWidget(shape, colour, (8, TITLE + 3 + 11 * number))
        box = _box(widget, x, y)
        _paint(screen, widget, box)
        screen.clicks.append((box, "wrong"))


def _box(widget: ToyWidget, x: int, y: int) -> Box:
    left, top = x + widget.at[0], y + widget.at[1]
    return left, top, left + widget.size[0], top + widget.size[1]


def _paint(screen: ToyScreen, widget: ToyWidget, box: Box) -> None:
    colour = COLOURS[widget.colour]
    x1, y1, x2, y2 = box
    if widget.shape == "button":
        screen.panel(box, colour)
    elif widget.shape == "field":
        screen.fill(box, colour)
        screen.fill((x1 + 2, y1 + 2, x2 - 2, y2 - 2), WHITE)
    else:
        for row, inset in enumerate(_round(y2 - y1)):
            screen.fill((x1 + inset, y1 + row, x2 - inset, y1 + row + 1), colour)


def _round(size: int) -> Iterator[int]:
    """Yield how far each row of a disc begins from the side."""
    middle = (size - 1) / 2
    for row in range(size):
        half = (max(0.0, (size / 2) ** 2 - (row - middle) ** 2)) ** 0.5
        yield round(size / 2 - half)


def _tick(screen: ToyScreen, box: Box) -> None:
    """Show that a widget was pressed."""
    x, y = (box[0] + box[2]) // 2, (box[1] + box[3]) // 2
    screen.panel((x - 3, y - 3, x + 3, y + 3), WHITE, (0, 0, 0))
