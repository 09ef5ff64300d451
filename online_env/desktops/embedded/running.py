"""Which of the running desktops a command means."""

import os
from typing import Any

from ...errors import UnknownDesktopError
from . import registry
from .desktop import EmbeddedDesktop


def choose(name: str | None) -> dict[str, Any]:
    """The record of `name`, or of the only desktop there is. Raises `UnknownDesktopError`."""
    records = {record["id"]: record for record in registry.records()}
    if name is None and len(records) == 1:
        return next(iter(records.values()))
    if name not in records:
        known = ", ".join(records) or "none"
        others = "" if os.geteuid() == 0 else "; those of root: sudo hijack desktop list"
        raise UnknownDesktopError(f"say which desktop: {name!r} is not one of them; there are: {known}{others}")
    return records[name]


def attach(name: str | None) -> EmbeddedDesktop:
    """A connection to `name`, or to the only desktop there is. Raises `UnknownDesktopError`."""
    return EmbeddedDesktop.attach(choose(name)["id"])
