"""Lock screens: the session is really locked (effect `lock`), and unlocked as recorded."""

from collections.abc import Iterator

import numpy as np

from hijack_data.plan import Effect
from hijack_data.types import Box, UInt8Array

from ...effects import perform
from ...errors import DesktopError
from ...recording.captured_picture import ClickTarget, Picture
from ...recording.stage import PASSWORD, RecordingStage, spot, write_code
from . import UnrecordedScene
from .windows import FULL_WIDTH

NAME = "mate-screensaver"
# The dialog is not in the accessibility tree, so its parts are found with the pointer: a button
# lights up under it. These are places inside the dialog, as parts of its width and height.
BUTTONS = (("Leave Message", (0.11, 0.89)), ("Cancel", (0.40, 0.89)), ("Unlock", (0.68, 0.89)))
ENTRY = ("Password", (0.45, 0.66))


def record(stage: RecordingStage) -> Iterator[Picture | UnrecordedScene]:
    """Yield the dialog as it comes when a key wakes it."""
    yield from UnrecordedScene.instead("lock screen", _pictures(stage))


def _pictures(stage: RecordingStage) -> Iterator[Picture]:
    stage.park()
    locked = perform(Effect("lock", {}), stage.desktop)
    try:
        probe = locked.probe()
        if not probe.ok:
            raise DesktopError(f"the session is not locked: {probe.problem}")
        dialog = _dialog(stage)
        picture = _lock_screen(stage, dialog)
        yield picture
        if stage.screen[2] == FULL_WIDTH:
            made_by = f"{picture.made_by}; the dialog alone"
            yield picture.part("lock_dialog", dialog, made_by=made_by)
    finally:
        locked.undo()


def _lock_screen(stage: RecordingStage, dialog: Box) -> Picture:
    """Return the locked screen, and unlock it by the action that is recorded.

    Raises:
        DesktopError: The action does not unlock it.
    """
    entry = _entry(stage.settled(), dialog)
    targets = [entry, *(_button(stage, dialog, name, part) for name, part in BUTTONS)]
    stage.park()
    action = {"type": "type", "text": f"{PASSWORD}\n", "target_box": list(entry.box)}
    made_by = "effect lock; a key woke the dialog"
    picture = stage.whole_screen("lock_screen", "", made_by, targets, recover=action)
    locker = _locker(stage)
    stage.run(write_code(action))
    if not stage.wait_until_gone(locker, 6.0):
        raise DesktopError("the password does not unlock the session")
    return picture


def _locker(stage: RecordingStage) -> int:
    numbers = [top.id for top in stage.top_windows() if NAME in top.name.lower()]
    if not numbers:
        raise DesktopError("no window of the locker is on the screen")
    return numbers[-1]


def _dialog(stage: RecordingStage) -> Box:
    """Return the dialog's box.

    It is another program's window inside the locker's, smaller than the screen.

    Raises:
        DesktopError: There is none.
    """
    _, _, width, height = stage.screen
    dialogs: list[Box] = []
    for inner_box in stage.look("inner", number=_locker(stage))["boxes"]:
        x1, y1, x2, y2 = inner_box
        if 100 < x2 - x1 < width and 100 < y2 - y1 < height:
            dialogs.append((x1, y1, x2, y2))
    if not dialogs:
        raise DesktopError("the locker shows no dialog")
    return max(dialogs, key=lambda box: (box[2] - box[0]) * (box[3] - box[1]))


def _button(
    stage: RecordingStage, dialog: Box, name: str, part: tuple[float, float]
) -> ClickTarget:
    """Return the button that lights up when the pointer comes to it.

    Raises:
        DesktopError: Nothing lights up there.
    """
    _, top, _, bottom = dialog
    x, y = spot(dialog, part)
    stage.park()
    before = stage.settled()
    stage.park((x, y))
    after = stage.settled()
    lit = (after != before).any(axis=2)
    lit[: top + (bottom - top) * 3 // 4] = False  # the clock above changes as well
    lit[bottom:] = False  # the pointer left the panel
    rows = np.flatnonzero(lit.any(axis=1))
    columns = np.flatnonzero(lit.any(axis=0))
    if len(columns) < 40 or len(rows) < 15:
        raise DesktopError(f"the locker has no button {name!r} at ({x}, {y})")
    left = int(columns[0])
    right = int(columns[-1])
    box = (left, int(rows[0]), right + 1, int(rows[-1]) + 1)
    return ClickTarget(name, "push-button", box)


def _entry(frame: UInt8Array, dialog: Box) -> ClickTarget:
    """Return the field for the password: an area of one colour, with its border.

    Raises:
        DesktopError: There is none.
    """
    name, part = ENTRY
    x, y = spot(dialog, part)
    is_background = (frame == frame[y, x]).all(axis=2)
    top, bottom = _run(is_background[:, x], y)
    left, right = _run(is_background[top + 3], x)
    if right - left < 100 or bottom - top < 15:
        raise DesktopError(f"the locker has no field for a password at ({x}, {y})")
    return ClickTarget(name, "password-text", (left - 1, top - 1, right + 1, bottom + 1))


def _run(is_background: UInt8Array, at: int) -> tuple[int, int]:
    """Return the ends of the stretch of true values around `at`, half-open."""
    start = at
    while start > 0 and is_background[start - 1]:
        start -= 1
    stop = at
    while stop < len(is_background) and is_background[stop]:
        stop += 1
    return start, stop
