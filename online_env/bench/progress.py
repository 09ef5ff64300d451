"""The display of a run: a progress bar on a terminal, and a line for each episode."""

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from .records import ResultRecord

if TYPE_CHECKING:
    from .jobs import Job

COLOURS = {"invalid": "yellow", "error": "red"}
LONGEST = 300  # characters of a line


def shorten(text: str) -> str:
    """Return a text as one line of limited length; the whole text is in the records."""
    line = " ".join(text.split("\n"))
    if len(line) <= LONGEST:
        return line
    return line[: LONGEST - 4] + " ..."


class ProgressDisplay:
    """Prints the progress of a run to a terminal or a log; use it in a `with` statement."""

    def __init__(self, listed: "Sequence[Job]", console: Console) -> None:
        self._console = console
        self._count = len(listed)
        self._bar: Progress | None = None
        if sys.stdout.isatty():
            columns: list[Any] = [
                BarColumn(24),
                MofNCompleteColumn(),
                TextColumn("{task.description}"),
                TimeRemainingColumn(),
            ]
            self._bar = Progress(*columns, console=console, transient=True)
            self._task = self._bar.add_task("starts a desktop", total=len(listed))

    def __enter__(self) -> "ProgressDisplay":
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def begins(
        self,
        job: "Job",
        number: int,
        attempt: int,
    ) -> None:
        """Show the job that runs now, for the first time or again."""
        if self._bar is None:
            return
        text = f"{job} (again)" if attempt else str(job)
        self._bar.update(self._task, completed=number - 1, description=text)

    def ended(
        self,
        job: "Job",
        number: int,
        record: ResultRecord,
    ) -> None:
        """Print one line on the episode."""
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
        self._console.print(
            shorten(line),
            style=style,
            markup=False,
            soft_wrap=True,
        )
        if self._bar is not None:
            self._bar.update(self._task, completed=number)
