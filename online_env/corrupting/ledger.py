"""What was applied to a desktop by hand, in a file of its run folder.

Another process can read it and undo what it lists.
"""

import json
import time
from pathlib import Path
from typing import Any, cast

from hijack_data.file_io import write_atomic
from hijack_data.locking import Lock, lock

LEDGER_FILE = "corrupted.json"
ENTRY_FIELDS = {"corruption", "at", "records"}


class Ledger:
    """What was applied to one desktop by hand and not undone yet, oldest first.

    Args:
        folder: The desktop's run folder, where it is kept in a file.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / LEDGER_FILE

    def entries(self) -> list[dict[str, Any]]:
        """Return `{"corruption", "at", "records"}` each; none if the file is missing or damaged."""
        try:
            data: object = json.loads(self._path.read_bytes())
        except (OSError, ValueError, RecursionError):
            return []
        listed = cast("list[Any]", data) if isinstance(data, list) else []
        entries = [cast("dict[str, Any]", entry) for entry in listed if isinstance(entry, dict)]
        return [entry for entry in entries if _is_whole(entry)]

    def add(self, corruption: str, records: list[dict[str, Any]]) -> dict[str, Any]:
        """Add what was just applied, and return its entry."""
        entry = {"corruption": corruption, "at": time.time(), "records": records}
        with self._locked():
            self._write([*self.entries(), entry])
        return entry

    def drop(self, entry: dict[str, Any]) -> None:
        """Remove what was undone."""
        with self._locked():
            self._write([old for old in self.entries() if old["at"] != entry["at"]])

    def _locked(self) -> Lock:
        """Lock the file: a page and a command, say, may change it at the same time."""
        return lock(self._path.with_suffix(".lock"), wait=True)

    def _write(self, entries: list[dict[str, Any]]) -> None:
        write_atomic(self._path, json.dumps(entries, indent=1))


def _is_whole(entry: dict[str, Any]) -> bool:
    """Return whether an entry of a ledger is as `add` writes it."""
    if not entry.keys() >= ENTRY_FIELDS:
        return False
    at, records = entry["at"], entry["records"]
    if not isinstance(entry["corruption"], str) or not isinstance(at, (int, float)):
        return False
    return isinstance(records, list) and all(
        isinstance(record, dict) and isinstance(record.get("effect"), str)
        for record in cast("list[dict[str, Any]]", records)
    )
