"""Datasets in the formats that people train with: `export(DIR, OUT, to="chat")`, `push_to_hub`.

A new format is one class, a `Writer`: of an installed package (entry points `agenthijack.exports`),
or `--to my_export.py:MyWriter`.
"""

from .example import Example
from .export import FORMATS, ONLOOKER, ExportReport, Writer, export, register
from .hub import push_to_hub
from .onlooker import OnlookerReport

__all__ = [
    "FORMATS",
    "ONLOOKER",
    "Example",
    "ExportReport",
    "OnlookerReport",
    "Writer",
    "export",
    "push_to_hub",
    "register",
]
