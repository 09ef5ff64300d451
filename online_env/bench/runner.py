"""Run jobs, one after the other or side by side, and append the record of each attempt."""

import threading
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Protocol

from ..errors import CostLimitError
from ..results import records
from ..results.costs import Budget
from ..results.records import ResultRecord
from ..results.stop_rule import SequentialTest
from .jobs import Job


class RunListener(Protocol):
    """Callbacks on the progress of a run."""

    def begins(self, job: Job, number: int, attempt: int) -> None:
        """Job `number` (from 1) begins, for the first time or (`attempt` from 1 on) again."""
        ...

    def ended(self, job: Job, number: int, record: ResultRecord) -> None:
        """An episode has ended."""
        ...


def run_jobs(
    listed: Sequence[Job],
    folder: Path,
    retries: int,
    episode: Callable[[Job, int], ResultRecord],
    listener: RunListener,
    earlier: Mapping[Job, Sequence[ResultRecord]] | None = None,
    *,
    at_once: int = 1,
    stop: Callable[[], object] = lambda: None,
    budget: Budget | None = None,
    reserve: Callable[[], AbstractContextManager[object]] = nullcontext,
    test: SequentialTest | None = None,
) -> Counter[str]:
    """Run every job and append a record for each attempt.

    An episode that failed through no fault of the agent (it is invalid, or the desktop died) is
    repeated up to `retries` times; if all attempts fail, the last record counts.

    Args:
        listed: The jobs; they begin in this order.
        folder: The folder of the run, made by `records.create`.
        retries: How many more attempts such an episode gets.
        episode: Runs a job (attempt 0, 1, ...) and returns its record; called in as many threads
            as jobs run at once.
        listener: Called before and after each attempt, never twice at a time.
        earlier: The attempts of an interrupted run.
        at_once: How many jobs run side by side.
        stop: Interrupts the running episodes; called if one job raises, or at Ctrl-C.
        budget: The budget. Once it is spent, no further attempt begins, running attempts are
            finished, and its `CostLimitError` is raised.
        reserve: Returns a context that is entered before each attempt and waits for a desktop.
        test: Once it is over, no further job begins; those that have begun are finished.

    Returns:
        How many jobs ended `"ok"`, `"invalid"` and `"error"`.
    """
    before = earlier or {}
    run = _Run(folder, retries, episode, listener, budget, reserve, test)
    numbered = list(enumerate(listed, 1))
    outcomes: Counter[str] = Counter()
    if at_once == 1:
        outcomes.update(run.finish(number, job, before.get(job, ())) for number, job in numbered)
    else:
        outcomes.update(_side_by_side(run, numbered, before, at_once, stop))
    if run.refused is not None:
        raise run.refused
    return outcomes


def _side_by_side(
    run: "_Run",
    numbered: Sequence[tuple[int, Job]],
    before: Mapping[Job, Sequence[ResultRecord]],
    at_once: int,
    stop: Callable[[], object],
) -> list[str]:
    """Run jobs in threads; return how they ended."""
    with ThreadPoolExecutor(at_once, thread_name_prefix="episodes") as pool:
        futures = [pool.submit(run.finish, n, job, before.get(job, ())) for n, job in numbered]
        try:
            return [future.result() for future in as_completed(futures)]
        except BaseException:
            run.stopped = True
            pool.shutdown(wait=False, cancel_futures=True)
            stop()
            raise


class _Run:
    """The jobs of a run, of which several may run at once."""

    def __init__(
        self,
        folder: Path,
        retries: int,
        episode: Callable[[Job, int], ResultRecord],
        listener: RunListener,
        budget: Budget | None,
        reserve: Callable[[], AbstractContextManager[object]],
        test: SequentialTest | None,
    ) -> None:
        self._folder = folder
        self._retries = retries
        self._episode = episode
        self._listener = listener
        self._budget = budget
        self._reserve = reserve
        self._test = test
        self._one_at_a_time = threading.Lock()
        self.stopped = False
        self.refused: CostLimitError | None = None

    def finish(self, number: int, job: Job, earlier: Sequence[ResultRecord]) -> str:
        """Run a job until no further attempt is due; return how it ended."""
        attempt_records = list(earlier)
        while needs_attempt(attempt_records, self._retries):
            with self._reserve():
                with self._one_at_a_time:
                    if not self._may_begin(is_first=not attempt_records):
                        return "left"
                    self._listener.begins(job, number, len(attempt_records))
                record = self._episode(job, len(attempt_records))
            with self._one_at_a_time:
                if self.stopped:
                    return "stopped"
                record = records.stored_record(self._folder, record)
                records.append(self._folder, record)
                if self._budget is not None:
                    self._budget.add(record)
                if self._test is not None:
                    self._test.add(record)
                self._listener.ended(job, number, record)
            attempt_records.append(record)
        return attempt_records[-1]["status"]

    def _may_begin(self, is_first: bool) -> bool:
        if is_first and self._test is not None and self._test.is_over:
            return False
        if self.refused is None and self._budget is not None:
            try:
                self._budget.check()
            except CostLimitError as error:
                self.refused = error
        return self.refused is None


def needs_attempt(attempt_records: Sequence[ResultRecord], retries: int) -> bool:
    """Return whether a job with these attempts needs another one."""
    if not attempt_records:
        return True
    last = attempt_records[-1]
    failed_here = last["status"] == "invalid" or last.get("cause") == "machine"
    return failed_here and len(attempt_records) <= retries
