"""Datasets in the formats that people train with: `export(DIR, OUT, to="chat")`, and `push_to_hub`."""

from .export import FORMATS, ONLOOKER, ExportReport, export
from .hub import push_to_hub
from .onlooker import OnlookerReport

__all__ = ["FORMATS", "ONLOOKER", "ExportReport", "OnlookerReport", "export", "push_to_hub"]
