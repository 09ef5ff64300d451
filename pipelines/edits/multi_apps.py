"""Multi apps in a recording: a recorded window of another application beside the target.

The spec is `hijack_data/corruptions/multi_apps.py`, the effect on a live machine
`online_env/effects/multi_apps.py`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import ClassVar

import numpy as np

from hijack_data.actions.pyautogui_functions import KEYBOARD, POINTER
from hijack_data.apps import is_browser, is_mentioned, may_be_same, normalize_app
from hijack_data.geometry import intersection, intersection_area, largest_free_rectangle
from hijack_data.pack import Asset
from hijack_data.plan import Effect, Paste
from hijack_data.types import Box, BoxArray, Point, Scene, Size, Step, as_boxes, clip_boxes

from .base import NAME_APPS, Edit, EditedStep, Frame, NotApplicable, between_bars
from .input_faults import recorded_calls

# Pixels kept free around the target.
TARGET_MARGIN_PX = 8
# Places tried along each side of a space beside the target.
GRID = 5
# Actions that have the same meaning wherever the window is. Other actions are at a place, or go to
# the active window.
ANYWHERE = ("wait", "done", "fail")
KEYS = frozenset({"type", "hotkey", "key_down", "key_up"})


@dataclass(frozen=True)
class _Placement:
    """A possible place of a window.

    Args:
        asset: the window.
        corner: its upper left corner on the screen.
        covered: how many elements it covers by half or more.
    """

    asset: Asset
    corner: Point
    covered: int

    @property
    def sort_key(self) -> tuple[int, int]:
        """The sort key, the lower the better: covered elements first, then the smaller window."""
        height, width = self.asset.size
        return self.covered, -height * width


class LaunchAppEdit(Edit):
    """Pastes a window so that the target and as many other elements as possible stay visible."""

    kind: ClassVar[str] = "launch_app"
    event: ClassVar[str] = (
        "Another application was opened; its window stands beside what the task needs."
    )
    uses_elements: ClassVar[bool] = True

    def apply(self, frame: Frame, effect: Effect) -> EditedStep:
        """Return the screen with the window; see `Edit.apply`.

        Raises:
            NotApplicable: the event cannot be shown realistically; the message is the reason.
        """
        frame.check_desktop()
        scene = _with_action_target(frame)
        _check_step(frame, scene)
        first = str(effect.params["app"])
        names = [first, *(str(name) for name in effect.params.get("then", ()))]
        windows = list(_windows(frame, names))
        if not windows:
            raise NotApplicable(
                "no window of an application that the recording does not use was recorded"
            )
        for name, assets in windows:
            best = _best(_placements(assets, scene))
            if best:
                return self._paste_window(frame.stream.choice(best), _notes(frame, name, first))
        raise NotApplicable("no room beside the target")

    def _paste_window(self, placement: _Placement, notes: Iterator[str]) -> EditedStep:
        x, y = placement.corner
        height, width = placement.asset.size
        return self.make_step(
            ops=(Paste(placement.asset.recipe(), (placement.corner,)),),
            fidelity="composited",
            boxes=((x, y, x + width, y + height),),
            notes=tuple(notes),
        )


def _check_step(frame: Frame, scene: Scene) -> None:
    """Refuse a step if it is unknown which part of the screen another window must leave free.

    Raises:
        NotApplicable: the event cannot be shown realistically; the message is the reason.
    """
    if not frame.apps and not frame.guess:
        raise NotApplicable(
            "the recording does not say which applications it uses, so none is known to be"
            f" another; {NAME_APPS}"
        )
    acts = getattr(frame.step, "acts", True)
    if acts and _begins_with_keys(frame.step):
        raise NotApplicable("the action begins with keys, which would go to the second window")
    if scene.target is None and acts and frame.step.action.type not in ANYWHERE:
        raise NotApplicable(
            "the action names no place on the screen that a second window could leave free"
        )


def _begins_with_keys(step: Step) -> bool:
    """Return whether an action presses keys before any button of the mouse.

    Keys go to the active window, whatever element the recording names as their target. Keys that
    are held around a click are a part of it.
    """
    if step.action.type in KEYS:
        return True
    for call in recorded_calls(step):
        if call.function in KEYBOARD and call.function not in ("keyDown", "keyUp"):
            return True
        if call.function in POINTER and call.function not in ("moveTo", "moveRel", "move"):
            return False
    return False


def _notes(frame: Frame, name: str, planned_app: str) -> Iterator[str]:
    if name != planned_app:
        yield f"a window of {name} was recorded, and none of {planned_app} that fits"
    if not frame.apps:
        yield "which applications the recording uses is not known"


def _with_action_target(frame: Frame) -> Scene:
    """Return the scene with the whole path of the action as its target.

    The path of a drag is visible from its start to its end.
    """
    action = frame.step.action
    target = frame.scene.target
    points = [point for point in (action.point, action.end) if point is not None]
    boxes = [(x, y, x + 1, y + 1) for x, y in points]
    if target:
        boxes.append(target)
    if not boxes:
        return frame.scene
    left, top, right, bottom = zip(*boxes, strict=True)
    return replace(frame.scene, target=(min(left), min(top), max(right), max(bottom)))


def _windows(frame: Frame, names: Sequence[str]) -> Iterator[tuple[str, list[Asset]]]:
    """Yield recorded windows by application, those that the plan names first.

    A window that may be the recording's own is never used, nor is one of a program that the
    instruction names: the task may be done in it. A screenshot without a recording is assumed to
    show a browser.
    """
    windows_by_app: dict[str, list[Asset]] = {}
    for asset in frame.pack.pictures("window"):
        windows_by_app.setdefault(normalize_app(asset.app), []).append(asset)
    for name in dict.fromkeys([*names, *windows_by_app]):
        if name in windows_by_app and not _belongs_to_recording(name, frame):
            yield name, windows_by_app[name]


def _belongs_to_recording(name: str, frame: Frame) -> bool:
    if is_mentioned(name, frame.trajectory.instruction):
        return True
    if not frame.apps:
        return is_browser(name)
    return any(may_be_same(name, app) for app in frame.apps)


def _best(places: Iterator[_Placement]) -> list[_Placement]:
    """Return all placements with the best sort key."""
    placements = list(places)
    least = min((placement.sort_key for placement in placements), default=None)
    return [placement for placement in placements if placement.sort_key == least]


def _placements(windows: Sequence[Asset], scene: Scene) -> Iterator[_Placement]:
    """Yield where each window can stand."""
    obstacles = [box for box in scene.obstacles.tolist() if tuple(box) != scene.target]
    boxes = as_boxes(obstacles)
    for asset in windows:
        height, width = asset.size
        for x, y in sorted(_corners(asset.size, scene, boxes)):
            covered = _count_covered((x, y, x + width, y + height), boxes)
            yield _Placement(asset, (x, y), covered)


def _corners(window: Size, scene: Scene, boxes: BoxArray) -> set[Point]:
    """Return corners to try: spread over each space beside the target, and in the free place."""
    target = as_boxes([scene.target] if scene.target else [])
    free = largest_free_rectangle(scene.size, np.concatenate([boxes, target]))
    corners: set[Point] = set()
    for space in _beside(scene):
        corners |= _within(window, space, GRID)
        corners |= _within(window, intersection(space, free), 2)
    return corners


def _within(window: Size, space: Box, count: int) -> set[Point]:
    """Return `count` corners along each side of a space; none if the window is larger."""
    height, width = window
    left, top, right, bottom = space
    across = right - left - width
    down = bottom - top - height
    if min(across, down) < 0:
        return set()
    shares = [k / (count - 1) for k in range(count)]
    pairs = product(shares, shares)
    return {(left + int(across * a), top + int(down * b)) for a, b in pairs}


def _beside(scene: Scene) -> list[Box]:
    """Return the spaces left of, right of, above and below the target.

    Without a target, it is the screen between its bars, because windows don't cover panels.
    """
    height, width = scene.size
    first, end = between_bars(scene.size)
    area = (0, first, width, end)
    if scene.target is None:
        return [area]
    x1, y1, x2, y2 = clip_boxes(as_boxes([scene.target]), scene.size)[0].tolist()
    sides = [
        (0, 0, x1 - TARGET_MARGIN_PX, height),
        (x2 + TARGET_MARGIN_PX, 0, width, height),
        (0, 0, width, y1 - TARGET_MARGIN_PX),
        (0, y2 + TARGET_MARGIN_PX, width, height),
    ]
    return [intersection(side, area) for side in sides]


def _count_covered(window: Box, boxes: BoxArray) -> int:
    """Return how many elements are covered by half or more."""
    areas = (boxes[:, 2:] - boxes[:, :2]).astype(np.int64).prod(axis=1)
    covered = 2 * intersection_area(window, boxes) >= np.maximum(areas, 1)
    return int(np.count_nonzero(covered))
