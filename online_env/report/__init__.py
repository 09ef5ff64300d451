"""`hijack report`: the results of a run, in every form in which they are read.

`build_report` makes one data object of a run (`model.RunReport`); the formats only write it.
`scores_by_name` gives its values by name, for release gates.
"""

from .build import build_report, load_report
from .model import AgentSummary, Cell, ReportError, RunIdentity, RunReport
from .named import scores_by_name

__all__ = [
    "AgentSummary",
    "Cell",
    "ReportError",
    "RunIdentity",
    "RunReport",
    "build_report",
    "load_report",
    "scores_by_name",
]
