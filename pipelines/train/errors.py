"""Errors of training."""

from hijack_data.errors import HijackError


class TrainError(HijackError, RuntimeError):
    """A training run that cannot continue, or a file that does not belong to the run."""


class LeakError(HijackError, ValueError):
    """Training tasks are among the tasks reported by the evaluation."""
