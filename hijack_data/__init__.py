"""AgentHijack: nine corruptions of a desktop, to build datasets, train and evaluate GUI agents.

>>> import numpy as np
>>> import hijack_data as hj
>>> screen = np.full((1080, 1920, 3), 240, np.uint8)
>>> marks = hj.Marks(number=5)
>>> plan = marks.plan(hj.Scene(size=(1080, 1920)), seed=7, sample="traj-3", step=0)
>>> hj.apply(plan, screen).shape
(1080, 1920, 3)

Authors of plug-ins import from `hijack_data.plugin`; torchvision transforms are in
`hijack_data.transforms`, Grain transforms in `hijack_data.grain`.
"""

import importlib
import sys
from typing import TYPE_CHECKING

from . import shadowed as _shadowed

if TYPE_CHECKING:  # the same names, for type checkers; tests/test_api.py compares the two
    from . import plugin as plugin
    from ._apply import apply as apply
    from .compose import OneOf as OneOf
    from .compose import Schedule as Schedule
    from .compose import Sequence as Sequence
    from .coords import CoordMap as CoordMap
    from .corruption import corruption_names as corruption_names
    from .corruption import from_plan as from_plan
    from .corruption import make_corruption as make_corruption
    from .corruptions import AccidentalTouch as AccidentalTouch
    from .corruptions import AppMinimization as AppMinimization
    from .corruptions import Marks as Marks
    from .corruptions import MultiApps as MultiApps
    from .corruptions import NetworkError as NetworkError
    from .corruptions import PopUps as PopUps
    from .corruptions import Resolution as Resolution
    from .corruptions import Subtitle as Subtitle
    from .corruptions import Verification as Verification
    from .elements import Elements as Elements
    from .elements import scene_from as scene_from
    from .errors import HijackError as HijackError
    from .plan import Plan as Plan
    from .planner import Planner as Planner
    from .prepared_plans import prepare as prepare
    from .safety import Safety as Safety
    from .safety import judge as judge
    from .types import Action as Action
    from .types import Scene as Scene
    from .types import Step as Step
    from .types import Trajectory as Trajectory

__version__ = "0.1.0"

# Where each name is defined. They are imported on first use (PEP 562), so that a process which
# needs only `errors` or `types`, such as those of a desktop, does not wait for the whole library.
_HOMES = {
    "_apply": ("apply",),
    "compose": ("OneOf", "Schedule", "Sequence"),
    "coords": ("CoordMap",),
    "corruption": ("corruption_names", "from_plan", "make_corruption"),
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
    "elements": ("Elements", "scene_from"),
    "errors": ("HijackError",),
    "plan": ("Plan",),
    "planner": ("Planner",),
    "prepared_plans": ("prepare",),
    "safety": ("Safety", "judge"),
    "types": ("Action", "Scene", "Step", "Trajectory"),
}
# Names that only `hijack_data.plugin` has; the error for them says so.
_FOR_AUTHORS = frozenset(
    {
        *("Augmentation", "Corrupted", "Corruption", "Draft", "Effect", "Every", "InputFault"),
        *("ParameterError", "Paste", "Resample", "Stream", "branch", "param", "plan_avoiding"),
        *("png_recipe", "register"),
    }
)
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = sorted(_HOME_OF)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> object:
    """Import a name from the module that defines it.

    Raises:
        AttributeError: there is no such name; if authors of plug-ins have it, the message says so.
    """
    if name == "plugin":  # so that `hijack_data.plugin` needs no import of its own
        return importlib.import_module(f".{name}", __name__)
    if name not in _HOME_OF:
        advice = f"; import it from {__name__}.plugin" if name in _FOR_AUTHORS else ""
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}{advice}")
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


_shadowed.warn_of_shadows()
