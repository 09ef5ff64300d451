"""Errors of the server; OpenEnv sends their text to the client."""

from hijack_data.errors import HijackError

from ..errors import DesktopError


class ServerBusyError(HijackError, RuntimeError):
    """No desktop is free now; the message states after how many seconds to try again.

    `retry_after` is that number.
    """

    def __init__(self, message: str, retry_after: int) -> None:
        self.retry_after = retry_after
        super().__init__(f"{message}; try again in {retry_after} s (retry_after={retry_after})")


class LeaseExpiredError(HijackError, RuntimeError):
    """The client was silent for too long, and has lost its desktop."""


class DesktopLostError(DesktopError):
    """The desktop ended in the middle of an episode, which does not count."""


class HeldOutTaskError(HijackError, ValueError):
    """A client asked a training server for a task on which results are reported."""
