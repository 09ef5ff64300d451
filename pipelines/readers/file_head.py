"""The beginning of a file, read once, by which the readers recognize their format."""

import json
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import cast

from .fields import FieldError, JsonObject, listed, objects
from .safe_files import MAX_HEAD_RECORDS, MAX_RECORD_BYTES, first_records, parse_any

JSON = ".json"
# Bodies of logs hold their entries in one of these lists.
LISTS = ("messages", "items", "input", "output")
_HEAD_BYTES = 1 << 18


class FileHead:
    """A file and its first records; nothing is read before a reader asks for it.

    Args:
        path: the file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    @cached_property
    def records(self) -> list[JsonObject]:
        """The first objects: of the list in a `.json`, or else of the lines of a file.

        They are empty for a file that cannot be read. Repeated keys are no error here.
        """
        try:
            if not self.path.is_file():
                return []
            if self.path.suffix != JSON:
                return first_records(self.path)
            if self.path.stat().st_size > MAX_RECORD_BYTES:
                return self._first_of_many()
            value = parse_any(self.path, unique=False)
        except FieldError:
            return first_records(self.path)  # JSON lines under the wrong name
        except (OSError, RecursionError):
            return []
        if isinstance(value, list):
            return objects(list(islice(cast("list[object]", value), MAX_HEAD_RECORDS)))
        return objects([value])

    @cached_property
    def keys(self) -> list[frozenset[str]]:
        """The keys of each of the first records."""
        return [frozenset(record) for record in self.records]

    @cached_property
    def entries(self) -> list[JsonObject]:
        """The first entries of a log: its records, and those in the lists of a body."""
        entries: list[JsonObject] = []
        for record in self.records:
            entries.append(record)
            if "role" not in record:
                for name in LISTS:
                    entries += objects(listed(record.get(name))[:MAX_HEAD_RECORDS])
        return entries

    def _first_of_many(self) -> list[JsonObject]:
        """Return the first object of a `.json` file that is too large to be parsed."""
        with self.path.open("rb") as file:
            text = file.read(_HEAD_BYTES).decode("utf-8-sig", errors="ignore").lstrip()
        try:
            value, _ = json.JSONDecoder().raw_decode(text.removeprefix("[").lstrip())
        except (ValueError, RecursionError):
            return []
        return objects([value])
