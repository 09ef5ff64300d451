"""The choice of the running desktop that a command acts on."""

import os
from typing import Any

from ..errors import UnknownDesktopError
from ..privilege import as_root
from .desktop import EmbeddedDesktop
from .runtime import registry


def choose(name: str | None) -> dict[str, Any]:
    """Return the record of `name`, or of the only desktop that runs.

    What a killed desktop left counts only if it is named.

    Raises:
        UnknownDesktopError: There is no such desktop, or `name` is missing and several run.
    """
    candidates = registry.running() if name is None else registry.records()
    records = {record["id"]: record for record in candidates}
    if name is not None and name in records:
        return records[name]
    if name is None and len(records) == 1:
        return next(iter(records.values()))
    unknown = ""
    if name is not None:
        unknown = f": {name!r} is not one of them"
    ids = ", ".join(records) or "none (hijack desktop up starts one)"
    hint = ""
    if os.geteuid() != 0:
        hint = f"; those of root: {as_root('desktop', 'list')}"
    raise UnknownDesktopError(f"say which desktop{unknown}; there are: {ids}{hint}")


def left_running() -> list[dict[str, Any]]:
    """Return the records of the desktops that `hijack desktop up` started, oldest first.

    Others belong to a process that uses them, such as a benchmark, and end with it.
    """
    ready = [record for record in registry.running() if record["state"] == "ready"]
    return [record for record in ready if not record.get("controller")]


def attach(name: str | None) -> EmbeddedDesktop:
    """Return a connection to `name`, or to the only desktop there is; errors as in `choose`."""
    record = choose(name)
    return EmbeddedDesktop.attach(record["id"])
