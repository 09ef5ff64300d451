"""Rejected inputs, written to disk at once, so that a broken source of any size takes no memory."""

import json
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import IO

from hijack_data.file_io import replace_atomic

from ..dataset.shard import ShardRecord
from ..errors import SourceError
from ..readers import Rejected
from .build_report import MAX_SHOWN_INPUTS

QUARANTINE = "quarantine.jsonl"
_INCOMING = "rejected.jsonl"


class Quarantine:
    """Collects rejected inputs; if `strict`, the first one is an error."""

    def __init__(self, state: Path, strict: bool) -> None:
        self._path = state / _INCOMING
        self._strict = strict
        self._file = self._path.open("w", encoding="utf-8")
        self.by_field: Counter[str] = Counter()
        self.examples: list[str] = []

    @property
    def total(self) -> int:
        """Number of rejected inputs so far."""
        return sum(self.by_field.values())

    def reject(self, record: Rejected) -> None:
        """Store an input that a reader rejected; raises `SourceError` in a strict build."""
        self._count(record)
        self._file.write(_line(record))

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def check(self, record: ShardRecord) -> None:
        """Check that a shard of a strict build has no rejected input.

        Raises:
            SourceError: the shard has one.
        """
        if self._strict and record.rejected:
            raise SourceError(_strictly(Rejected(**record.rejected[0])))

    def write(self, out: Path, shards: Iterable[ShardRecord]) -> None:
        """Write all rejected inputs: those of readers in order, then those of each shard."""
        self.close()
        late = [Rejected(**data) for shard in shards for data in shard.rejected]
        for record in late:
            self._count(record)

        def write(path: Path) -> None:
            with (
                path.open("w", encoding="utf-8") as file,
                self._path.open(encoding="utf-8") as early,
            ):
                _copy(early, file)
                file.writelines(_line(record) for record in late)

        replace_atomic(out / QUARANTINE, write)

    def _count(self, record: Rejected) -> None:
        if self._strict:
            raise SourceError(_strictly(record))
        self.by_field[record.field or "(record)"] += 1
        if len(self.examples) < MAX_SHOWN_INPUTS:
            self.examples.append(str(record))


def _copy(source: IO[str], target: IO[str]) -> None:
    for line in source:
        target.write(line)


def _line(record: Rejected) -> str:
    return json.dumps(record.to_data()) + "\n"


def _strictly(record: Rejected) -> str:
    return (
        f"{record} (without --strict, in Python strict=True, it would be left out and the rest"
        " built)"
    )
