"""A desktop as the recorder sees it: windows as the X server shows them, and pictures of them."""

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hijack_data.actions.dialects.pyautogui_write import write_pyautogui
from hijack_data.geometry import intersection
from hijack_data.types import Action, Box, Point, UInt8Array

from ..desktops.commands import launch
from ..desktops.protocol import Desktop
from ..effects.elements import LAUNCHERS, live_elements
from ..effects.guest import Guest, isolated
from ..embedded.guest import inside
from ..errors import DesktopError, DesktopTimeoutError
from .captured_picture import ClickTarget, Picture

PASSWORD = "password"
QUIET_S = 0.7  # s without change after which a screen counts as settled
CURSOR_PIXELS = 800  # pixels that a text cursor may change meanwhile
SETTLE_TIMEOUT_S = 60.0  # s to wait for that
REMAP_TIMEOUT_S = 10.0  # s within which a window that went away comes back
POLL_S = 0.1  # s between two looks
TOOL = inside.source("xlook")


@dataclass(frozen=True)
class TopWindow:
    """A window directly below the root.

    Args:
        id: Its number.
        client: The number of the application's own window inside it, or 0.
        name: Its class.
        box: `xyxy` on the screen.
        free: Whether the window manager leaves it alone.
    """

    id: int
    client: int
    name: str
    box: Box
    free: bool

    @property
    def key(self) -> int:
        """The number that stays the same: a window manager may give a window another frame."""
        return self.client or self.id


class RecordingStage:
    """A desktop on which pictures are made.

    Every method raises `DesktopError` if the desktop fails or does not reach the expected state.

    Args:
        desktop: The machine.
        style: The name of its look, one of `desktop_looks.LOOKS`; empty or `"golden"` for that of
            the golden home.
    """

    def __init__(self, desktop: Desktop, style: str = "") -> None:
        self.desktop = desktop
        self.guest = Guest(desktop, PASSWORD, None)
        self.style = style

    @property
    def screen(self) -> Box:
        """The whole screen as a box."""
        height, width = self.desktop.size
        return 0, 0, width, height

    def look(self, operation: str, **fields: Any) -> dict[str, Any]:
        """Ask the guest's X server (`guest/inside/xlook.py`).

        Raises:
            DesktopError: The tool failed.
        """
        result = self.desktop.execute(isolated(TOOL, operation, json.dumps(fields)), 60)
        if not result.ok:
            problem = result.error.strip()[-300:]
            raise DesktopError(f"xlook {operation} failed in the guest: {problem}")
        return json.loads(result.output)

    def top_windows(self) -> list[TopWindow]:
        """Return the windows that can be seen, bottom to top."""
        tops: list[TopWindow] = []
        for data in self.look("tops")["tops"]:
            box: Box = tuple(data["box"])
            if _overlap(box, self.screen):
                tops.append(TopWindow(data["id"], data["client"], data["class"], box, data["free"]))
        return tops

    def open(self, *argv: str, class_part: str, timeout: float = 60.0) -> TopWindow:
        """Start an application and wait until its window has settled.

        Args:
            argv: The command line.
            class_part: A part of the window's class.
            timeout: Seconds to wait for the window.
        """
        before = {top.key for top in self.top_windows()}
        launch(self.desktop, *argv)
        description = f"window of {argv[0]}"
        return self.new(
            before,
            lambda top: class_part in top.name.lower() and not top.free,
            description,
            timeout,
        )

    def new(
        self,
        before: set[int],
        fits: Callable[[TopWindow], bool],
        description: str,
        timeout: float = 15.0,
    ) -> TopWindow:
        """Wait for a new window, and until the screen has settled.

        Args:
            before: The keys of the windows that were there before.
            fits: Whether a window is one to wait for; the largest is returned.
            description: The window in the message of an error.
            timeout: Seconds to wait for it.

        Raises:
            DesktopTimeoutError: No such window came.
        """
        end = time.monotonic() + timeout
        while True:
            if self._fresh(before, fits):
                self.settled()
                fresh = self._fresh(before, fits)
                if fresh:
                    return max(fresh, key=lambda top: _area(top.box))
            if time.monotonic() > end:
                raise DesktopTimeoutError(f"no {description} came within {timeout:g} s")
            time.sleep(POLL_S)

    def _fresh(self, before: set[int], fits: Callable[[TopWindow], bool]) -> list[TopWindow]:
        return [top for top in self.top_windows() if top.key not in before and fits(top)]

    def top(self, number: int) -> TopWindow:
        """Return the present state of a window.

        Some windows disappear briefly when they get another size; it waits for them.

        Raises:
            DesktopError: The window is gone.
        """
        end = time.monotonic() + REMAP_TIMEOUT_S
        while True:
            for top in self.top_windows():
                if number in (top.id, top.client):
                    return top
            if time.monotonic() > end:
                raise DesktopError(f"window {number:#x} is not on the screen any more")
            time.sleep(POLL_S)

    def place(self, top: TopWindow, box: Sequence[int]) -> TopWindow:
        """Move and resize a window; return it at the place that it really took."""
        self.guest.x("place", frames={str(top.client): list(box)})
        self.settled()
        return self.top(top.key)

    def maximise(self, top: TopWindow) -> TopWindow:
        """Maximise a window."""
        self.guest.x("maximise", number=top.client)
        self.settled()
        return self.top(top.key)

    def area(self) -> Box:
        """Return the work area: the screen without its panels."""
        x1, y1, x2, y2 = self.guest.x("state")["area"]
        return x1, y1, x2, y2

    def close(self, top: TopWindow) -> None:
        """Close a window and the dialogs before it."""
        self.guest.x("close", 6.0, ids=[top.client])

    def run(self, code: str) -> None:
        """Run pyautogui code that must succeed."""
        self.guest.pyautogui(code)

    def command(self, line: str) -> str:
        """Run a shell command that must succeed, as the desktop's user; return its output.

        Raises:
            DesktopError: It failed.
        """
        result = self.desktop.execute(line, 60)
        if not result.ok:
            raise DesktopError(f"{line!r} failed in the guest: {result.error.strip()[-300:]}")
        return result.output

    def park(self, point: Point | None = None) -> None:
        """Move the pointer to `point`.

        The default is the empty part of the panel, where one row of the pointer shows.
        """
        height, width = self.desktop.size
        x, y = point or (width * 3 // 4, height - 1)
        self.run(f"pyautogui.moveTo({x}, {y})")

    def settled(self, timeout: float = SETTLE_TIMEOUT_S) -> UInt8Array:
        """Return the screen once nothing but a text cursor changes, uint8 RGB `[H, W, 3]`.

        Raises:
            DesktopTimeoutError: The screen keeps changing.
        """
        frame = self.desktop.screenshot()
        since = time.monotonic()
        end = since + timeout
        while time.monotonic() - since < QUIET_S:
            if time.monotonic() > end:
                raise DesktopTimeoutError(f"the screen did not settle within {timeout:g} s")
            time.sleep(POLL_S)
            picture = self.desktop.screenshot()
            differs = (picture != frame).any(axis=2)
            if int(differs.sum()) > CURSOR_PIXELS:
                frame = picture
                since = time.monotonic()
        return self.desktop.screenshot()

    def targets(self, box: Box, owner: Callable[[TopWindow | None], bool]) -> list[ClickTarget]:
        """Return the interactive elements in a box, by their centres.

        Args:
            box: `xyxy` on the screen.
            owner: Whether the window at an element's centre is one of those that are meant.
        """
        tops = self.top_windows()
        tree = self.desktop.accessibility()
        targets: list[ClickTarget] = []
        for element in live_elements(tree, self.desktop.size):
            if not _inside(element.centre, box) or not owner(at_point(tops, element.centre)):
                continue
            target = ClickTarget(element.name, element.role, element.box)
            if target not in targets:
                targets.append(target)
        return targets

    def launcher_targets(self) -> list[ClickTarget]:
        """Return the interactive elements of the panels and of the bare desktop."""
        return self.targets(
            self.screen, lambda top: top is not None and top.name.split(".")[0] in LAUNCHERS
        )

    def cut(self, kind: str, app: str, top: TopWindow, made_by: str, **extra: Any) -> Picture:
        """Return a picture of one window, with its own elements as targets.

        Args:
            kind: As in `Picture`, as are `app`, `made_by` and `extra`.
            app: The application.
            top: The window, which must lie on top of all others.
            made_by: How it was made.
            **extra: More fields of the picture.
        """
        frame = self.settled()
        box = intersection(top.box, self.screen)
        self._check_uncovered(top, box)
        x1, y1, x2, y2 = box
        holes = self.look("shaped", number=top.id)["holes"]
        pixels = _shaped(frame[y1:y2, x1:x2], holes, top.box, box)
        targets = self.targets(box, lambda owner: owner is not None and owner.id == top.id)
        return Picture(kind, app, box, pixels, made_by, targets, **extra)

    def whole_screen(
        self, kind: str, app: str, made_by: str, targets: Sequence[ClickTarget], **extra: Any
    ) -> Picture:
        """Return a picture of the whole screen; the arguments are those of `Picture`."""
        return Picture(kind, app, self.screen, self.settled(), made_by, targets, **extra)

    def wait_until_gone(self, number: int, timeout: float = 6.0) -> bool:
        """Return whether a window goes away within `timeout` seconds."""
        return bool(self.look("gone", number=number, timeout=timeout)["gone"])

    def _check_uncovered(self, top: TopWindow, box: Box) -> None:
        tops = self.top_windows()
        numbers = [window.id for window in tops]
        if top.id not in numbers:
            raise DesktopError(f"the window {top.name} went away before its picture was taken")
        for window in tops[numbers.index(top.id) + 1 :]:
            if _overlap(window.box, box):
                raise DesktopError(
                    f"the window {window.name} at {list(window.box)} covers {top.name} at"
                    f" {list(top.box)}"
                )


def click(kind: str, target: ClickTarget) -> dict[str, Any]:
    """Return a click in the middle of a target, as an action of the pack."""
    x1, y1, x2, y2 = target.box
    return {"type": kind, "x": (x1 + x2) // 2, "y": (y1 + y2) // 2, "target_box": list(target.box)}


def write_code(action: Mapping[str, Any]) -> str:
    """Return the pyautogui code of an action of the pack."""
    keys = tuple(action["keys"]) if action.get("keys") else None
    return write_pyautogui(
        Action(action["type"], action.get("x"), action.get("y"), text=action.get("text"), keys=keys)
    )


def at_point(tops: Sequence[TopWindow], point: Point) -> TopWindow | None:
    """Return the topmost window at a point."""
    for top in reversed(tops):
        if _inside(point, top.box):
            return top
    return None


def spot(box: Box, part: tuple[float, float]) -> Point:
    """Return the point at these parts of a box's width and height, each 0 to 1."""
    x1, y1, x2, y2 = box
    return round(x1 + part[0] * (x2 - x1)), round(y1 + part[1] * (y2 - y1))


def _inside(point: Point, box: Box) -> bool:
    x, y = point
    return box[0] <= x < box[2] and box[1] <= y < box[3]


def _area(box: Sequence[int]) -> int:
    return max(0, box[2] - box[0]) * max(0, box[3] - box[1])


def _overlap(first: Box, second: Box) -> bool:
    return _area(intersection(first, second)) > 0


def _shaped(part: UInt8Array, holes: Sequence[Sequence[int]], box: Box, cut: Box) -> UInt8Array:
    """Return RGB, or RGBA that is transparent outside the window's shape, as in round corners."""
    if not holes:
        return np.ascontiguousarray(part)
    opaque = np.full(part.shape[:2], 255, np.uint8)
    pixels = np.dstack([part, opaque])
    dx = box[0] - cut[0]
    dy = box[1] - cut[1]
    for y, x1, x2 in holes:
        if 0 <= y + dy < len(pixels):
            pixels[y + dy, max(x1 + dx, 0) : max(x2 + dx, 0)] = 0
    return pixels
