"""The content of an output: a report, with the additions of the command's options."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from .comparison import RunComparison
from .model import RunReport
from .paper import PaperTable


@dataclass(frozen=True, kw_only=True)
class ReportDocument:
    """A report with its requested additions.

    Attributes:
        report: of the run.
        comparison: with another run.
        paper: the paper's table, with ours below it.
        full: whether a text for terminals has everything, not only what fits a screen.
    """

    report: RunReport
    comparison: RunComparison | None = None
    paper: PaperTable | None = None
    full: bool = False

    def extras(self) -> Mapping[str, Any]:
        """Return comparison and paper as JSON data; keys without data are left out."""
        additions = {"comparison": self.comparison, "paper": self.paper}
        return {key: asdict(value) for key, value in additions.items() if value is not None}
