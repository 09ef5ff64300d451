"""Errors of the local internet.

Import this file only to raise one: it loads NumPy (see `sites/__init__`).
"""

from online_env.errors import DesktopError


class SiteStateError(DesktopError):
    """A state folder that cannot be read or written, or whose content is not our JSON."""


class SiteAddressError(DesktopError):
    """An address or port that cannot be bound."""
