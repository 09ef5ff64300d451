"""Accidental touch on a live machine: an unintended click on an interactive element.

The spec is `hijack_data/corruptions/accidental_touch.py`, its look in recordings
`pipelines/edits/accidental_touch.py`.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from hijack_data.errors import HijackError
from hijack_data.rng import Stream
from hijack_data.types import Box, UInt8Array, as_boxes

from ..desktops.protocol import Capability
from .app_minimization import DESKTOP_WINDOW_TYPES
from .base import EffectError, EffectRecord, LiveEffect, Probe, Undone, register
from .descriptions import short
from .elements import LAUNCHERS, Element, live_elements, window_at
from .guest import Guest

MAX_CLICKS = 5
CHANGE_TIMEOUT_S = 2.0  # s within which a click must change the screen
# Highlights under the pointer are not caused by the click, so wait, for a limited time, until the
# screen is still.
QUIET_S = 0.15  # s without change
HOVER_TIMEOUT_S = 0.8  # s at most
POLL_S = 0.03  # s between two pictures
MAX_OFFSET_PIXELS = 8  # pixels by which an element may be away from the plan's box


@dataclass(frozen=True)
class _View:
    """The state of the screen at one time.

    The windows are read first, then the picture, then the tree, so that changes are noticed.
    """

    state: dict[str, Any]
    frame: UInt8Array
    elements: list[Element]


@register
class Touch(LiveEffect):
    """Clicks the first element, in the plan's order, that is still there and reacts."""

    kind: ClassVar[str] = "touch"
    needs: ClassVar[frozenset[Capability]] = frozenset({"accessibility", "windows"})
    lasting: ClassVar[bool] = False

    def apply(self, guest: Guest, params: Mapping[str, Any]) -> EffectRecord:
        """Draw an element and click it; draw another if it is gone or the click changes nothing."""
        stream = guest.stream or Stream(0, "touch-v1")
        boxes = _boxes(params)
        without_app = bool(params.get("without_app", True))
        record: EffectRecord = {"attempts": [], "clicked": None}
        tried_elements: set[Element] = set()
        while len(record["attempts"]) < MAX_CLICKS and record["clicked"] is None:
            view = _look(guest, without_app)
            candidates = [element for element in view.elements if element not in tried_elements]
            element = _draw(candidates, boxes, stream)
            if element is None:
                break
            tried_elements.add(element)
            attempt = _click(guest, view, element)
            record["attempts"].append(attempt)
            if attempt["changed"]:
                record["clicked"] = attempt
        return record

    def probe(self, guest: Guest, record: EffectRecord) -> Probe:
        """Check that the pointer is there, and the X server saw a click that changed the screen."""
        clicked = record["clicked"]
        attempts = record["attempts"]
        facts: EffectRecord = {"attempts": attempts, "pointer": guest.x("state")["pointer"]}
        if not attempts:
            return Probe(False, facts, "no interactive element is on the screen")
        if clicked is None:
            problem = f"{len(attempts)} elements were tried, and nothing changed on the screen"
            return Probe(False, facts, problem)
        problems: list[str] = []
        if not clicked["delivered"]:
            problems.append("the server did not see the button go down and up")
        if not facts["pointer"] == clicked["pointer"] == clicked["point"]:
            problems.append(
                f"the pointer is at {facts['pointer']}, the element was at {clicked['point']}"
            )
        return Probe(not problems, facts, "; ".join(problems))

    def undo(self, guest: Guest, record: EffectRecord) -> Undone:
        """Do nothing: a click is an event, not a state; the agent must close anything it opened."""
        return Undone(True, {"undone": False, "why": "a click cannot be taken back"})

    def in_words(self, facts: Mapping[str, Any]) -> str:
        """Return which element the click reached."""
        attempts = facts["attempts"]
        element, (x, y) = attempts[-1]["element"], attempts[-1]["point"]
        reached = element["role"]
        if element["name"].strip():
            reached += f" {short(element['name'])}"
        tries = f", at attempt {len(attempts)}" if len(attempts) > 1 else ""
        return (
            f"the pointer is at {x}, {y}; the click reached the {reached} of {element['app']} and"
            f" changed the screen{tries}"
        )

    def undone_in_words(self, facts: Mapping[str, Any]) -> str:
        """Return why there is nothing to undo."""
        return facts["why"]


def _look(guest: Guest, without_app: bool) -> _View:
    state = guest.x("state")
    frame = guest.desktop.screenshot()
    found = live_elements(guest.desktop.accessibility(), guest.desktop.size, state["windows"])
    elements = [e for e in found if _can_be_clicked(e, state, without_app)]
    return _View(state, frame, elements)


def _can_be_clicked(element: Element, state: Mapping[str, Any], without_app: bool) -> bool:
    """Return whether an element is not hidden, and not behind a modal dialog.

    Guests also list the elements of minimised windows; at their places there is only the desktop or
    a panel. `without_app` leaves out what launches applications: panels, their menus and the
    desktop, but not the dialogs of a panel, which are windows like any other.
    """
    window = window_at(element.centre, state)
    if without_app and element.app.lower() in LAUNCHERS and not _is_own_window(window, element):
        return False
    if window is None:
        return True
    if any(w["for"] == window["id"] and "modal" in w["states"] for w in state["windows"]):
        return False
    return window["type"] not in DESKTOP_WINDOW_TYPES or element.app.lower() in LAUNCHERS


def _is_own_window(window: Mapping[str, Any] | None, element: Element) -> bool:
    """Return whether a window is an ordinary one of the application of an element."""
    if window is None or window["type"] in DESKTOP_WINDOW_TYPES:
        return False
    return window["class"].lower().startswith(f"{element.app.lower()}.")


def _draw(candidates: Sequence[Element], boxes: Sequence[Box], stream: Stream) -> Element | None:
    """Return the element at the first of the plan's boxes that has one, otherwise a random one."""
    if not candidates:
        return None
    for box in boxes:
        distances = [_distance(element.box, box) for element in candidates]
        nearest = min(distances)
        if nearest <= MAX_OFFSET_PIXELS:
            return candidates[distances.index(nearest)]
    return stream.choice(candidates)


def _distance(first: Box, second: Box) -> int:
    return max(abs(a - b) for a, b in zip(first, second, strict=True))


def _click(guest: Guest, view: _View, element: Element) -> EffectRecord:
    x, y = element.centre
    no_window: dict[str, Any] = {"id": 0, "frame": [], "class": "", "title": ""}
    window = window_at(element.centre, view.state) or no_window
    attempt: EffectRecord = {
        "element": element.to_data(),
        "point": [x, y],
        "window": window["class"],
        "changed": False,
        "delivered": False,
        "moved": True,
    }
    x1, y1, x2, y2 = element.box
    was = view.frame[y1:y2, x1:x2]
    if _differ(was, guest.desktop.screenshot()[y1:y2, x1:x2]):
        return attempt  # another element is at this place now
    guest.x("move", x=x, y=y)
    before = _settled(guest)
    attempt |= guest.x("click", number=window["id"], frame=window["frame"])
    start = time.monotonic()
    if not attempt["moved"]:
        attempt["changed"] = _changes(guest, before)
    attempt["seconds"] = round(time.monotonic() - start, 3)
    return attempt


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


def _boxes(params: Mapping[str, Any]) -> list[Box]:
    try:
        rows = as_boxes(params.get("boxes", ())).tolist()
    except HijackError as error:
        raise EffectError(f"touch: {error}") from None
    return [(x1, y1, x2, y2) for x1, y1, x2, y2 in rows]
