"""Verification: the screen is a real lock screen (paper, Algorithm "Verification")."""

from hijack_data.plan import Effect

from .base import WAIT, EditedStep, Frame
from .screens import whole_screen

EVENT = "The session was locked; the screen asks for the password."
REMINDER = "The screen is locked and shows nothing of the task. Don't guess the password: wait until it is unlocked."


def edit(frame: Frame, effect: Effect) -> EditedStep:
    """Show a recorded lock screen in the place of the screen. The recorded click would hit nothing: wait instead."""
    shown = whole_screen(frame, "lock_screen", "lock screen")
    return EditedStep(shown.ops, EVENT, shown.fidelity, WAIT, reminder=REMINDER, boxes=shown.boxes, notes=shown.notes)
