"""Errors of the live desktops; messages name the place, the value that was found and the fix."""

from hijack_data.errors import HijackError


class DesktopError(HijackError, RuntimeError):
    """A desktop does not start, does not answer, or does not reach the expected state."""


class DesktopTimeoutError(DesktopError, TimeoutError):
    """Something did not happen in time; the message names it and the log to read."""


class MissingCapabilityError(DesktopError):
    """A desktop lacks a capability that was asked of it (no firewall, no lock, no tree ...)."""


class MissingPackageError(DesktopError, ImportError):
    """A system package is not installed; the message names the command that installs it."""


class RootRequiredError(DesktopError, PermissionError):
    """Only root may do this; the message says what works without root."""


class DesktopImageError(DesktopError):
    """An image of the desktop cannot be built, read or used; the message names its file."""


class UnknownDesktopError(DesktopError, KeyError):
    """A desktop id is not registered."""


class GuestError(DesktopError):
    """The guest server refused a request, failed, or broke its protocol.

    `status` is the HTTP status, or `None` if there was no answer.
    """

    def __init__(self, message: str, status: int | None = None) -> None:
        self.status = status
        super().__init__(message)


class AgentSetupError(HijackError, RuntimeError):
    """An agent cannot be made, or cannot be used as it is: its key, prices or log are missing."""


class EndpointError(HijackError, RuntimeError):
    """The endpoint of a model cannot be reached, refuses, or answers nothing that can be read.

    `transient` tells whether the same request may succeed later; `retry_after` is after how many
    seconds, if the endpoint said so.
    """

    def __init__(
        self, message: str, transient: bool = False, retry_after: float | None = None
    ) -> None:
        self.transient = transient
        self.retry_after = retry_after
        super().__init__(message)


class ReplayError(HijackError, LookupError):
    """A request that the log of a replayed run does not have; the message names the step."""


class CostLimitError(HijackError, RuntimeError):
    """A run has cost as much as it may; the episodes that ended are kept."""


class ClusterError(HijackError, RuntimeError):
    """A cluster cannot be used, or one of its nodes cannot play; the message names the node."""
