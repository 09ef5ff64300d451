"""What the author of a corruption or of a combinator imports.

    from hijack_data.plugin import Corruption, Draft, Paste, Scene, Stream, param, register

docs/write_a_corruption.md explains each of them.
"""

from .actions.input_faults import InputFault
from .batches import Corrupted
from .compose import Augmentation
from .corruption import Corruption, Draft, register
from .drawing.raster import png_recipe
from .errors import ParameterError
from .params import Every, param
from .plan import Effect, Paste, Plan, Resample
from .planner import Planner
from .rng import Stream, branch
from .safety import plan_avoiding
from .types import Scene

__all__ = [
    "Augmentation",
    "Corrupted",
    "Corruption",
    "Draft",
    "Effect",
    "Every",
    "InputFault",
    "ParameterError",
    "Paste",
    "Plan",
    "Planner",
    "Resample",
    "Scene",
    "Stream",
    "branch",
    "param",
    "plan_avoiding",
    "png_recipe",
    "register",
]
