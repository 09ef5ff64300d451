"""Accidental touch on a live machine: an unintended click on an interactive element.

The spec is `hijack_data/corruptions/accidental_touch.py`, its look in recordings
`pipelines/edits/accidental_touch.py`.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from hijack_data.rng import Stream
from hijack_data.types import UInt8Array

from ..desktops.protocol import Capability
from .app_minimization import DESKTOP_WINDOW_TYPES
from .base import EffectRecord, LiveEffect, Probe, Undone, register
from .descriptions import short
from .elements import (
    LAUNCHERS,
    MAX_CLICKS,
    Element,
    draw_element,
    live_elements,
    read_touch_boxes,
    window_at,
)
from .guest import Guest
from .launchers import application_names, launches_application

CHANGE_TIMEOUT_S = 2.0  # s within which a click must change the screen
# Highlights under the pointer are not caused by the click, so wait, for a limited time, until the
# screen is still.
QUIET_S = 0.15  # s without change
HOVER_TIMEOUT_S = 0.8  # s at most
POLL_S = 0.03  # s between two pictures


@dataclass(frozen=True)
class _View:
    """The state of the screen at one time.

    The windows are read first, then the picture, then the tree, so that changes are noticed.
    `launchers` are the elements that launch another application.
    """

    state: dict[str, Any]
    frame: UInt8Array
    elements: list[Element]
    launchers: list[Element]


@register
class Touch(LiveEffect):
    """Clicks the first element, in the plan's order, that is still there and reacts.

    Where no element is left that may be clicked, it does what Algorithm 6 of the paper does: it
    clicks what was drawn, be it a launcher. A screen without any element is clicked somewhere, and
    if every element moved away before its click, the place of the last one is clicked.
    """

    kind: ClassVar[str] = "touch"
    needs: ClassVar[frozenset[Capability]] = frozenset({"accessibility", "windows"})
    lasting: ClassVar[bool] = False

    def apply(self, guest: Guest, params: Mapping[str, Any]) -> EffectRecord:
        """Draw an element and click it; draw another if it is gone or the click changes nothing."""
        stream = guest.stream or Stream(0, "touch-v1")
        boxes = read_touch_boxes(params)
        without_app = bool(params.get("without_app", True))
        attempts: list[EffectRecord] = []
        tried_elements: set[Element] = set()
        while len(attempts) < MAX_CLICKS:
            view = _look(guest, without_app)
            candidates = [element for element in view.elements if element not in tried_elements]
            if not attempts:
                candidates = candidates or view.launchers
            element = draw_element(candidates, boxes, stream)
            if element is None:
                break
            tried_elements.add(element)
            attempts.append(_click(guest, view, element))
            if attempts[-1]["changed"]:
                break
        if not any(attempt["delivered"] for attempt in attempts):
            point = attempts[-1]["point"] if attempts else _random_point(guest, stream)
            attempts.append(_click_point(guest, point))
        clicked = next((a for a in reversed(attempts) if a["delivered"]), None)
        if clicked is not None and clicked is not attempts[-1]:
            guest.x("move", x=clicked["point"][0], y=clicked["point"][1])
        return {"attempts": attempts, "clicked": clicked}

    def probe(self, guest: Guest, record: EffectRecord) -> Probe:
        """Check that the pointer is there, and that the X server saw the click."""
        clicked = record["clicked"]
        attempts = record["attempts"]
        facts: EffectRecord = {"attempts": attempts, "pointer": guest.x("state")["pointer"]}
        if clicked is None:
            tries = f"the click was tried {len(attempts)} times"
            return Probe(False, facts, f"{tries}: the server did not see the button go down and up")
        if facts["pointer"] == clicked["pointer"] == clicked["point"]:
            return Probe(True, facts)
        problem = f"the pointer is at {facts['pointer']}, the click was at {clicked['point']}"
        return Probe(False, facts, problem)

    def undo(self, guest: Guest, record: EffectRecord) -> Undone:
        """Do nothing: a click is an event, not a state; the agent must close anything it opened."""
        return Undone(True, {"undone": False, "why": "a click cannot be taken back"})

    def in_words(self, facts: Mapping[str, Any]) -> str:
        """Return which element the click reached."""
        attempts = facts["attempts"]
        number, clicked = next(
            (number, attempt)
            for number, attempt in reversed(list(enumerate(attempts, 1)))
            if attempt["delivered"]
        )
        element, (x, y) = clicked["element"], clicked["point"]
        if element is None:
            target = "screen there, since no element could be clicked,"
        else:
            name = f" {short(element['name'])}" if element["name"].strip() else ""
            target = f"{element['role']}{name} of {element['app']}"
        change = "changed the screen" if clicked["changed"] else "changed nothing on the screen"
        tries = f", at attempt {number}" if number > 1 else ""
        return f"the pointer is at {x}, {y}; the click reached the {target} and {change}{tries}"

    def undone_in_words(self, facts: Mapping[str, Any]) -> str:
        """Return why there is nothing to undo."""
        return facts["why"]


def _look(guest: Guest, without_app: bool) -> _View:
    state = guest.x("state")
    frame = guest.desktop.screenshot()
    live = live_elements(guest.desktop.accessibility(), guest.desktop.size, state["windows"])
    elements = [element for element in live if _is_reachable(element, state)]
    launchers: list[Element] = []
    panel_elements = [e for e in elements if _is_part_of_panel(e, state)] if without_app else []
    if panel_elements:
        applications = application_names(guest)
        titles = {window["title"].casefold() for window in state["windows"]}
        launchers = [e for e in panel_elements if launches_application(e, applications, titles)]
    remaining = [element for element in elements if element not in launchers]
    return _View(state, frame, remaining, launchers)


def _is_reachable(element: Element, state: Mapping[str, Any]) -> bool:
    """Return whether an element is not hidden, and not behind a modal dialog.

    Guests also list the elements of minimised windows; at their places there is only the desktop or
    a panel.
    """
    window = window_at(element.centre, state)
    if window is None:
        return True
    if any(w["for"] == window["id"] and "modal" in w["states"] for w in state["windows"]):
        return False
    return window["type"] not in DESKTOP_WINDOW_TYPES or element.app.lower() in LAUNCHERS


def _is_part_of_panel(element: Element, state: Mapping[str, Any]) -> bool:
    """Return whether an element is on a panel, in its menus or on the desktop.

    The dialogs of a panel are windows like any other.
    """
    if element.app.lower() not in LAUNCHERS:
        return False
    return not _is_own_window(window_at(element.centre, state), element)


def _is_own_window(window: Mapping[str, Any] | None, element: Element) -> bool:
    """Return whether a window is an ordinary one of the application of an element."""
    if window is None or window["type"] in DESKTOP_WINDOW_TYPES:
        return False
    return window["class"].lower().startswith(f"{element.app.lower()}.")


def _click(guest: Guest, view: _View, element: Element) -> EffectRecord:
    no_window: dict[str, Any] = {"id": 0, "frame": [], "class": "", "title": ""}
    window = window_at(element.centre, view.state) or no_window
    attempt: EffectRecord = {
        "element": element.to_data(),
        "point": list(element.centre),
        "window": window["class"],
        "changed": False,
        "delivered": False,
        "moved": True,
    }
    x1, y1, x2, y2 = element.box
    was = view.frame[y1:y2, x1:x2]
    if _differ(was, guest.desktop.screenshot()[y1:y2, x1:x2]):
        return attempt  # another element is at this place now
    return attempt | _press(guest, element.centre, window["id"], window["frame"])


def _random_point(guest: Guest, stream: Stream) -> list[int]:
    height, width = guest.desktop.size
    return [stream.integer(0, width - 1), stream.integer(0, height - 1)]


def _click_point(guest: Guest, point: Sequence[int]) -> EffectRecord:
    """Click a point of the screen, whatever is there."""
    attempt: EffectRecord = {"element": None, "point": list(point), "window": ""}
    attempt |= {"changed": False, "delivered": False}
    return attempt | _press(guest, point, 0, [])


def _press(
    guest: Guest, point: Sequence[int], window: int, window_frame: list[int]
) -> EffectRecord:
    """Click a point, if the window is still where it was; 0 stands for any window."""
    guest.x("move", x=point[0], y=point[1])
    before = _settled(guest)
    result: EffectRecord = guest.x("click", number=window, frame=window_frame)
    start = time.monotonic()
    if not result["moved"]:
        result["changed"] = _changes(guest, before)
    return {**result, "seconds": round(time.monotonic() - start, 3)}


def _settled(guest: Guest) -> UInt8Array:
    """Return the screen once it is still for `QUIET_S` seconds, or after `HOVER_TIMEOUT_S`."""
    frame = guest.desktop.screenshot()
    start = since = time.monotonic()
    now = start
    while now - since < QUIET_S and now - start < HOVER_TIMEOUT_S:
        time.sleep(POLL_S)
        last = frame
        frame = guest.desktop.screenshot()
        now = time.monotonic()
        if _differ(last, frame):
            since = now
    return frame


def _changes(guest: Guest, before: UInt8Array) -> bool:
    end = time.monotonic() + CHANGE_TIMEOUT_S
    while not _differ(before, guest.desktop.screenshot()):
        if time.monotonic() > end:
            return False
        time.sleep(POLL_S)
    return True


def _differ(first: UInt8Array, second: UInt8Array) -> bool:
    return first.shape != second.shape or not np.array_equal(first, second)
