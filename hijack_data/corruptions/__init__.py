"""The corruptions, one file each: the paper's nine in the paper's order, then the everyday faults.

That is the order in which they are listed.
"""

# isort: off
from .pop_ups import PopUps
from .resolution import Resolution
from .marks import Marks
from .subtitle import Subtitle
from .multi_apps import MultiApps
from .accidental_touch import AccidentalTouch
from .app_minimization import AppMinimization
from .network_error import NetworkError
from .verification import Verification

from .missed_input import MissedInput
from .repeated_input import RepeatedInput
from .slipped_pointer import SlippedPointer
from .app_freeze import AppFreeze
from .slow_network import SlowNetwork

__all__ = [
    "AccidentalTouch",
    "AppFreeze",
    "AppMinimization",
    "Marks",
    "MissedInput",
    "MultiApps",
    "NetworkError",
    "PopUps",
    "RepeatedInput",
    "Resolution",
    "SlippedPointer",
    "SlowNetwork",
    "Subtitle",
    "Verification",
]
