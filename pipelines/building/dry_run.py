"""A build that writes nothing: its rows are made, counted and discarded."""

import hashlib
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from ..readers import Rejected
from .build_report import BuildReport, transparency_note
from .quarantine import Quarantine
from .row_settings import in_order
from .shards import ShardTask, shard_rows
from .step_rows import RowCounts, RowSettings

Tasks = Callable[[Callable[[Rejected], None]], Iterable[ShardTask]]


def run_dry(
    tasks: Tasks,
    settings: RowSettings,
    *,
    strict: bool = False,
    tick: Callable[[int], None] | None = None,
) -> BuildReport:
    """Return the report of a build without writing it.

    Args:
        tasks: called with a function for rejected inputs; returns the shards.
        settings: those of the build.
        strict: whether the first rejected input is a `SourceError`.
        tick: called with the number of rows of each step when it is done.
    """
    # Plans, not pixels: a picture that is not stored need not be compressed.
    settings = replace(settings, lazy=True)
    tally = RowCounts()
    files = 0
    with TemporaryDirectory() as state, closing(Quarantine(Path(state), strict)) as quarantine:
        for task in tasks(quarantine.reject):
            deque(shard_rows(task, settings, tally, hashlib.sha256(), tick), maxlen=0)
            files += 1
        for record in tally.rejected:
            quarantine.reject(record)
        return BuildReport(
            out="",
            rows=in_order(tally.rows, settings),
            rejected=quarantine.total,
            examples=tuple(quarantine.examples),
            not_applicable={
                label: dict(reasons) for label, reasons in tally.not_applicable.items()
            },
            dropped=dict(tally.dropped),
            shards=files,
            kept=0,
            notes=tuple(transparency_note(tally.transparent)),
            dry_run=True,
        )
