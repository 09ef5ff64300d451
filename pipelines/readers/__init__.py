"""Readers: recorded trajectories in, one `Trajectory` at a time.

A new format is one file in this folder that registers a class; see `base.Reader`.
"""

import importlib
import pkgutil

from .base import Reader, Rejected, detect_format, existing, get_reader, names, register
from .screens import RecordedTrajectory

__all__ = ["Reader", "RecordedTrajectory", "Rejected", "detect_format", "existing", "get_reader", "names", "register"]

for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f".{_module.name}", __name__)
