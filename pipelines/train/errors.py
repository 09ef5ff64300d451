"""Errors of training."""

from hijack_data.errors import HijackError


class TrainError(HijackError, RuntimeError):
    """A training run that cannot go on, or a file of one that does not fit."""


class LeakError(HijackError, ValueError):
    """Tasks to be trained on are among those that the evaluation reports."""
