"""The display of a run: a progress bar on a terminal, and a line for each episode."""

import sys
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from hijack_data.cli.printable_console import PrintableConsole

from ..report.formatting import shorten
from ..results.records import ResultRecord
from .estimates import format_duration

if TYPE_CHECKING:
    from .jobs import Job

COLOURS = {"invalid": "yellow", "error": "red"}
RATE_PERIOD_S = 60.0  # seconds between two lines about the rate, in a log


class ProgressDisplay:
    """Prints the progress of a run to a terminal or a log; use it in a `with` statement.

    Args:
        listed: All jobs of the run.
        console: Where it is shown.
        finished: How many jobs had ended before, in a run that is resumed.
        clock: Returns seconds; it must never be set back.
    """

    def __init__(
        self,
        listed: "Sequence[Job]",
        console: PrintableConsole,
        finished: int = 0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._console = console
        self._count = len(listed)
        self._finished_before = finished
        self._clock = clock
        self._start = self._last_line_time = clock()
        self._finished_jobs: set[int] = set()
        self._bar: Progress | None = None
        if sys.stdout.isatty():
            columns: list[Any] = [
                BarColumn(24),
                MofNCompleteColumn(),
                TextColumn("{task.fields[pace]}"),
                TextColumn("{task.description}", markup=False),
            ]
            self._bar = Progress(*columns, console=console, transient=True)
            self._task = self._bar.add_task(
                "starts a desktop", total=len(listed), completed=finished, pace=""
            )

    def __enter__(self) -> "ProgressDisplay":
        self._start = self._last_line_time = self._clock()
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def begins(self, job: "Job", number: int, attempt: int) -> None:
        """Show the job that begins now, for the first time or again."""
        self._finished_jobs.discard(number)  # the last attempt did not count
        if self._bar is None:
            return
        text = f"{job} (again)" if attempt else str(job)
        self._bar.update(self._task, completed=self._finished_count, description=text)

    def ended(self, job: "Job", number: int, record: ResultRecord) -> None:
        """Print one line on the episode."""
        self._finished_jobs.add(number)
        status = record["status"]
        result = status
        explanation = record["problem"]
        if status == "ok":
            result = f"{record['score']:.2f}"
            explanation = record["reason"]
        line = (
            f"[{number}/{self._count}] {job}  {result}  {record['steps']} steps "
            f" {record['seconds']:.1f} s  {explanation}"
        )
        style = COLOURS.get(status)
        self._print(shorten(line), style)
        if self._bar is not None:
            self._bar.update(self._task, completed=self._finished_count, pace=self.pace)
        elif self._clock() - self._last_line_time >= RATE_PERIOD_S:
            self._last_line_time = self._clock()
            self._print(f"{self._finished_count} of {self._count} episodes, {self.pace}", "dim")

    @property
    def _finished_count(self) -> int:
        return self._finished_before + len(self._finished_jobs)

    @property
    def pace(self) -> str:
        """The rate of episodes per hour, and the time left at that rate."""
        elapsed = self._clock() - self._start
        if not self._finished_jobs or elapsed <= 0:
            return ""
        rate = len(self._finished_jobs) / elapsed
        remaining_s = (self._count - self._finished_count) / rate
        return f"{3600 * rate:.0f} an hour, {format_duration(remaining_s)} left"

    def _print(self, text: str, style: str | None) -> None:
        self._console.print(text, style=style, markup=False, soft_wrap=True)
