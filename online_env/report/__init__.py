"""`hijack report`: the results of a run, in several formats.

`build_report` computes one data object for a run (`model.RunReport`), which the formats only write.
`scores_by_name` returns its values by name, for release gates. `compare` reports on a data frame.
"""

from typing import TYPE_CHECKING

from hijack_data.lazy_names import lazy_names

if TYPE_CHECKING:  # the same names, for type checkers
    from .build import build_report as build_report
    from .build import load_report as load_report
    from .data_frames import TableComparison as TableComparison
    from .data_frames import compare as compare
    from .model import AgentSummary as AgentSummary
    from .model import Cell as Cell
    from .model import ReportError as ReportError
    from .model import RunIdentity as RunIdentity
    from .model import RunReport as RunReport
    from .named_scores import scores_by_name as scores_by_name

# Where each name is defined. They are imported on first use: `hijack report --help` needs none.
_HOMES = {
    "AgentSummary": ".model",
    "Cell": ".model",
    "ReportError": ".model",
    "RunIdentity": ".model",
    "RunReport": ".model",
    "TableComparison": ".data_frames",
    "build_report": ".build",
    "compare": ".data_frames",
    "load_report": ".build",
    "scores_by_name": ".named_scores",
}

__all__ = sorted(_HOMES)  # pyright: ignore[reportUnsupportedDunderAll]

__getattr__ = lazy_names(__name__, _HOMES)
