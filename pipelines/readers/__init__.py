"""Readers: recorded trajectories in, one `Trajectory` at a time.

A new format is one file that registers a class: in this folder, in an installed package (entry
points `agenthijack.readers`), or `--format my_reader.py:MyReader`. See `base.Reader`.
"""

import importlib
import pkgutil

from .base import FileReader, Reader, Rejected, existing, get_reader, names, register
from .files import Part
from .screens import RecordedTrajectory
from .survey import Survey, detect_format, survey

__all__ = [
    "FileReader",
    "Part",
    "Reader",
    "RecordedTrajectory",
    "Rejected",
    "Survey",
    "detect_format",
    "existing",
    "get_reader",
    "names",
    "register",
    "survey",
]

for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f".{_module.name}", __name__)
