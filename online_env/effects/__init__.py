"""Effects of corruptions on a live machine: applied, proved by a probe, and undone.

applied = perform(effect, desktop)
if not applied.probe().ok: ...      # the episode is invalid, never a zero
applied.undo()
"""

from .accidental_touch import Touch
from .app_freeze import Freeze
from .app_minimization import Minimise
from .base import (
    Applied,
    EffectError,
    LiveEffect,
    Probe,
    Undone,
    find,
    kinds,
    perform,
    register,
    resume,
    undo,
)
from .multi_apps import LaunchApp
from .network_error import Firewall
from .slow_network import SlowLink
from .verification import LockSession

__all__ = [
    "Applied",
    "EffectError",
    "Firewall",
    "Freeze",
    "LaunchApp",
    "LiveEffect",
    "LockSession",
    "Minimise",
    "Probe",
    "SlowLink",
    "Touch",
    "Undone",
    "find",
    "kinds",
    "perform",
    "register",
    "resume",
    "undo",
]
