"""Readers: recorded trajectories in, one `Trajectory` at a time.

A new format is one file that registers a class: in this folder, in an installed package (entry
points `agenthijack.readers`), or `--format my_reader.py:MyReader`. See `base.Reader`.
"""

import importlib
import pkgutil

from .base import FileReader, Reader, Rejected, check_path, get_reader, names, register
from .recording_facts import RecordedTrajectory
from .safe_files import Part
from .survey import Survey, detect_format, survey

__all__ = [
    "FileReader",
    "Part",
    "Reader",
    "RecordedTrajectory",
    "Rejected",
    "Survey",
    "check_path",
    "detect_format",
    "get_reader",
    "names",
    "register",
    "survey",
]

for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f".{_module.name}", __name__)
