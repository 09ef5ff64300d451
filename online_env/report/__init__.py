"""`hijack report`: the results of a run, in several formats.

`build_report` computes one data object for a run (`model.RunReport`), which the formats only write.
`scores_by_name` returns its values by name, for release gates. `compare` reports on a data frame.
"""

from importlib import import_module
from typing import TYPE_CHECKING

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


def __getattr__(name: str) -> object:
    """Import a name from the module that defines it.

    Raises:
        AttributeError: there is no such name.
    """
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name], __name__), name)
