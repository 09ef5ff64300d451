"""AgentHijack: nine corruptions of a desktop, to build datasets, train and evaluate GUI agents.

>>> import numpy as np
>>> import hijack_data as hj
>>> screen = np.full((1080, 1920, 3), 240, np.uint8)
>>> marks = hj.make_corruption("marks", number=5)
>>> plan = marks.plan(hj.Scene(size=(1080, 1920)), seed=7, sample="traj-3", step=0)
>>> hj.apply(plan, screen).shape
(1080, 1920, 3)
"""

import importlib
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # the same names, for type checkers; tests/test_api.py compares the two
    from ._apply import apply as apply
    from .compose import Augmentation as Augmentation
    from .compose import Corrupted as Corrupted
    from .compose import OneOf as OneOf
    from .compose import Schedule as Schedule
    from .compose import Sequence as Sequence
    from .coords import CoordMap as CoordMap
    from .corruption import Corruption as Corruption
    from .corruption import Draft as Draft
    from .corruption import from_plan as from_plan
    from .corruption import get as make_corruption
    from .corruption import names as corruption_names
    from .corruption import register as register
    from .corruptions import AccidentalTouch as AccidentalTouch
    from .corruptions import AppMinimization as AppMinimization
    from .corruptions import Marks as Marks
    from .corruptions import MultiApps as MultiApps
    from .corruptions import NetworkError as NetworkError
    from .corruptions import PopUps as PopUps
    from .corruptions import Resolution as Resolution
    from .corruptions import Subtitle as Subtitle
    from .corruptions import Verification as Verification
    from .drawing.raster import png_recipe as png_recipe
    from .elements import Elements as Elements
    from .elements import scene_from as scene_from
    from .errors import HijackError as HijackError
    from .params import Every as Every
    from .params import param as param
    from .plan import Effect as Effect
    from .plan import Paste as Paste
    from .plan import Plan as Plan
    from .plan import Resample as Resample
    from .planner import Planner as Planner
    from .rng import Stream as Stream
    from .safety import Safety as Safety
    from .safety import judge as judge
    from .safety import plan_avoiding as plan_avoiding
    from .types import Action as Action
    from .types import Scene as Scene
    from .types import Step as Step
    from .types import Trajectory as Trajectory

__version__ = "0.1.0"

# Where each name is defined. They are imported on first use (PEP 562), so that a process which
# needs only `errors` or `types`, such as those of a desktop, does not wait for the whole library.
_HOMES = {
    "_apply": ("apply",),
    "compose": ("Augmentation", "Corrupted", "OneOf", "Schedule", "Sequence"),
    "coords": ("CoordMap",),
    "corruption": ("Corruption", "Draft", "from_plan", "get", "names", "register"),
    "corruptions": (
        "AccidentalTouch",
        "AppMinimization",
        "Marks",
        "MultiApps",
        "NetworkError",
        "PopUps",
        "Resolution",
        "Subtitle",
        "Verification",
    ),
    "drawing.raster": ("png_recipe",),
    "elements": ("Elements", "scene_from"),
    "errors": ("HijackError",),
    "params": ("Every", "param"),
    "plan": ("Effect", "Paste", "Plan", "Resample"),
    "planner": ("Planner",),
    "rng": ("Stream",),
    "safety": ("Safety", "judge", "plan_avoiding"),
    "types": ("Action", "Scene", "Step", "Trajectory"),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = sorted(_HOME_OF)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> object:
    """Import a name from the module that defines it.

    Raises:
        AttributeError: there is no such name.
    """
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home = importlib.import_module(f".{_HOME_OF[name]}", __name__)
    value = getattr(home, name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names, the loaded submodules and the special attributes."""
    present = globals()
    modules = [name for name in present if f"{__name__}.{name}" in sys.modules]
    special = [name for name in present if name.startswith("__")]
    return sorted({*__all__, *modules, *special})
