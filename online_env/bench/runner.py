"""Carries out jobs, one after the other, and keeps what each leaves."""

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol

from . import records
from .jobs import Job
from .records import Record


class Teller(Protocol):
    """Who is told how a run goes."""

    def begins(self, job: Job, number: int, attempt: int) -> None:
        """Job `number` (from 1) begins, for the first time or (`attempt` from 1 on) again."""
        ...

    def ended(self, job: Job, number: int, record: Record) -> None:
        """An episode has ended."""
        ...


def run_jobs(
    listed: Sequence[Job],
    folder: Path,
    retries: int,
    episode: Callable[[Job, int], Record],
    teller: Teller,
) -> Counter[str]:
    """Run every job and append a record for each attempt.

    What is invalid is run again, at most `retries` times; it stays invalid if it never succeeds.

    Args:
        listed: what to run, in this order.
        folder: of the run, made by `records.create`.
        retries: more attempts at an invalid episode.
        episode: runs a job (attempt 0, 1, ...) and returns its record.
        teller: is told how it goes.

    Returns:
        How many jobs ended `"ok"`, `"invalid"` and `"error"`.
    """
    statuses: Counter[str] = Counter()
    for number, job in enumerate(listed, 1):
        status = ""
        for attempt in range(retries + 1):
            teller.begins(job, number, attempt)
            record = episode(job, attempt)
            records.append(folder, record)
            teller.ended(job, number, record)
            status = record["status"]
            if status != "invalid":
                break
        statuses[status] += 1
    return statuses
