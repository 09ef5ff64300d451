"""Trajectory edits: what the corruptions that act on a machine look like in a recording.

One file an effect. An edit is given a step and an effect of the plan, and returns what the screen shows then, what
happened, and the action to take; or it raises `NotApplicable` where that would not be true.
"""

from collections.abc import Mapping

from . import accidental_touch, app_minimization, multi_apps, network_error, verification
from .base import Edit, EditedStep, Frame, NotApplicable

__all__ = ["EDITS", "USES_ELEMENTS", "Edit", "EditedStep", "Frame", "NotApplicable"]

# By the kind of effect that a plan names.
EDITS: Mapping[str, Edit] = {
    "launch_app": multi_apps.edit,
    "touch": accidental_touch.edit,
    "minimise": app_minimization.edit,
    "firewall": network_error.edit,
    "lock": verification.edit,
}
# Edits that place something by where the elements of the screen are.
USES_ELEMENTS = frozenset({"launch_app", "touch"})
