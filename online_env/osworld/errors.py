"""Errors of running OSWorld's own environment."""

from ..errors import DesktopError


class OsworldError(DesktopError):
    """OSWorld's environment is missing or broken, or its process ended."""


class TaskRefusedError(OsworldError):
    """A task that can't be evaluated here; `reasons` lists what is missing."""

    def __init__(self, task: str, reasons: list[str]) -> None:
        self.reasons = reasons
        listed = "; ".join(reasons)
        super().__init__(f"task {task} can't be evaluated here: {listed}")


class EvaluatorError(OsworldError):
    """OSWorld's own code raised an exception; `kind` is its type. This is no score."""

    def __init__(self, message: str, kind: str = "", log: "list[str] | None" = None) -> None:
        self.kind = kind
        self.log = log or []
        super().__init__(message)
