"""The outcome of a call of foreign code: a value, or an error with the last warnings logged."""

import collections
import logging
import traceback
from types import TracebackType
from typing import Any

from .stubs import MissingDependency

MAX_LINES = 20
WIDTH = 500


class OutcomeHandler(logging.Handler):
    """A context that records the exception that ends it, and warnings that `desktop_env` logs.

    Only `MissingDependency` and ordinary exceptions are recorded; an interrupt is raised.
    """

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.lines: collections.deque[str] = collections.deque(maxlen=MAX_LINES)
        self.value: Any = None
        self.error: BaseException | None = None

    def emit(self, record: logging.LogRecord) -> None:
        """Keep one line of the log."""
        self.lines.append(f"{record.levelname} {record.getMessage()}"[:WIDTH])

    def __enter__(self) -> "OutcomeHandler":
        logging.getLogger().addHandler(self)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> bool:
        logging.getLogger().removeHandler(self)
        self.error = error
        return isinstance(error, Exception | MissingDependency)

    def message(self) -> dict[str, Any]:
        """Return JSON: `value`, or `error` with its `kind` and place."""
        if self.error is None:
            return {"value": self.value, "log": list(self.lines)}
        kind = type(self.error).__name__
        if isinstance(self.error, MissingDependency):
            kind = "missing_package"
        location = ""
        for frame in traceback.extract_tb(self.error.__traceback__)[-1:]:
            file = frame.filename.rpartition("site-packages/")[2]
            location = f"{file}:{frame.lineno}"
        return {
            "error": str(self.error)[:WIDTH] or kind,
            "kind": kind,
            "place": location,
            "log": list(self.lines),
        }
