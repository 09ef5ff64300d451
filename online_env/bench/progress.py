"""The display of a run: a progress bar on a terminal, and a line for each episode."""

import sys
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from ..results.records import ResultRecord
from .estimates import format_duration

if TYPE_CHECKING:
    from .jobs import Job

COLOURS = {"invalid": "yellow", "error": "red"}
LONGEST = 300  # characters of a line
RATE_PERIOD_S = 60.0  # seconds between two lines about the rate, in a log


def shorten(text: str) -> str:
    """Return a text as one line of limited length; the whole text is in the records."""
    line = " ".join(text.split("\n"))
    if len(line) <= LONGEST:
        return line
    return line[: LONGEST - 4] + " ..."


class ProgressDisplay:
    """Prints the progress of a run to a terminal or a log; use it in a `with` statement.

    Args:
        listed: All jobs of the run.
        console: Where it is shown.
        done: How many jobs had ended before, in a run that is resumed.
        clock: Returns seconds; it must never be set back.
    """

    def __init__(
        self,
        listed: "Sequence[Job]",
        console: Console,
        done: int = 0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._console = console
        self._count = len(listed)
        self._before = done
        self._clock = clock
        self._start = self._told = clock()
        self._ended: set[int] = set()
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
                "starts a desktop", total=len(listed), completed=done, pace=""
            )

    def __enter__(self) -> "ProgressDisplay":
        self._start = self._told = self._clock()
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def begins(self, job: "Job", number: int, attempt: int) -> None:
        """Show the job that begins now, for the first time or again."""
        self._ended.discard(number)  # the last attempt did not count
        if self._bar is None:
            return
        text = f"{job} (again)" if attempt else str(job)
        self._bar.update(self._task, completed=self._done, description=text)

    def ended(self, job: "Job", number: int, record: ResultRecord) -> None:
        """Print one line on the episode."""
        self._ended.add(number)
        status = record["status"]
        result = status
        why = record["problem"]
        if status == "ok":
            result = f"{record['score']:.2f}"
            why = record["reason"]
        line = (
            f"[{number}/{self._count}] {job}  {result}  {record['steps']} steps "
            f" {record['seconds']:.1f} s  {why}"
        )
        style = COLOURS.get(status)
        self._print(shorten(line), style)
        if self._bar is not None:
            self._bar.update(self._task, completed=self._done, pace=self.pace)
        elif self._clock() - self._told >= RATE_PERIOD_S:
            self._told = self._clock()
            self._print(f"{self._done} of {self._count} episodes, {self.pace}", "dim")

    @property
    def _done(self) -> int:
        return self._before + len(self._ended)

    @property
    def pace(self) -> str:
        """The rate of episodes per hour, and the time left at that rate."""
        passed = self._clock() - self._start
        if not self._ended or passed <= 0:
            return ""
        rate = len(self._ended) / passed
        left = (self._count - self._done) / rate
        return f"{3600 * rate:.0f} an hour, {format_duration(left)} left"

    def _print(self, text: str, style: str | None) -> None:
        self._console.print(text, style=style, markup=False, soft_wrap=True)
