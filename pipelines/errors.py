"""Errors of building, opening and checking datasets."""

from hijack_data.errors import HijackError

# How to continue or to replace a build, for a shell and for Python.
RESUME = "--resume (in Python: resume=True)"
OVERWRITE = "--overwrite (in Python: overwrite=True)"


class SourceError(HijackError, ValueError):
    """A source that is empty, of an unknown format, or (in a strict build) partly unreadable."""


class BuildError(HijackError, ValueError):
    """A build that is impossible with the given output folder, corruption or option."""


class DatasetError(HijackError, ValueError):
    """A folder that is not a complete AgentHijack dataset."""
