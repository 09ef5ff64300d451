"""Whether a run is complete: its exit code, and a line about missing episodes."""

from ..results.reading import Run
from .model import RunReport


def exit_code(run: Run) -> int:
    """Return 1 if something is missing, damaged, invalid or failed, else 0."""
    return 1 if run.damaged or run.missing or run.failures else 0


def report_exit_code(report: RunReport) -> int:
    """Return the exit code of the run of a finished report."""
    run = report.run
    has_failures = any(row.invalid or row.errors for row in report.summaries)
    return 1 if run.damaged or run.missing or has_failures else 0


def missing_line(run: Run) -> str:
    """Return how many planned episodes have no record, and the remedy."""
    progress = f"{run.planned - run.missing} of {run.planned} planned episodes are there"
    command = "score" if run.is_scored else "bench"
    return f"{progress}, {run.missing} are missing; hijack {command} ... --resume runs them"
