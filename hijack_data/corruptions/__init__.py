"""The paper's nine corruptions, one file each, in the paper's order.

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

__all__ = [
    "AccidentalTouch",
    "AppMinimization",
    "Marks",
    "MultiApps",
    "NetworkError",
    "PopUps",
    "Resolution",
    "Subtitle",
    "Verification",
]
