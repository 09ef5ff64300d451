"""`hijack report`: the results of a run, in several formats.

`build_report` computes one data object for a run (`model.RunReport`), which the formats only write.
`scores_by_name` returns its values by name, for release gates. `compare` reports on a data frame.
"""

from .build import build_report, load_report
from .data_frames import TableComparison, compare
from .model import AgentSummary, Cell, ReportError, RunIdentity, RunReport
from .named_scores import scores_by_name

__all__ = [
    "AgentSummary",
    "Cell",
    "ReportError",
    "RunIdentity",
    "RunReport",
    "TableComparison",
    "build_report",
    "compare",
    "load_report",
    "scores_by_name",
]
