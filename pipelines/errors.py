"""Errors of building, opening and checking datasets."""

from hijack_data.errors import HijackError

# How to continue or to replace a build, for a shell and for Python.
RESUME = "--resume (in Python: resume=True)"
OVERWRITE = "--overwrite (in Python: overwrite=True)"


class SourceError(HijackError, ValueError):
    """A source that is empty, of no known format, or (in a strict build) unreadable in part."""


class BuildError(HijackError, ValueError):
    """A build that is impossible with this output folder, corruption or option."""


class DatasetError(HijackError, ValueError):
    """A folder that is not a complete dataset of ours."""
