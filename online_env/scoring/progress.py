"""The display of a scoring run: a bar on a terminal, otherwise a line now and then."""

import sys
import time
from typing import Any

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from hijack_data.cli.printable_console import PrintableConsole

from ..results.reading import ResultRecord

LINE_PERIOD_S = 5.0  # s between two lines


class ScoreDisplay:
    """Shows how far a run is, and each row that failed; use it in a `with` statement.

    Args:
        total: rows of all agents that are to be scored.
        console: where it is shown.
    """

    def __init__(self, total: int, console: PrintableConsole) -> None:
        self._total = total
        self._console = console
        self._done = 0
        self._start = time.monotonic()
        self._last_line_time = self._start
        self._bar: Progress | None = None
        if console.is_terminal and sys.stdout.isatty():
            columns: list[Any] = [
                BarColumn(24),
                MofNCompleteColumn(),
                TextColumn("{task.description}"),
                TimeRemainingColumn(),
            ]
            self._bar = Progress(*columns, console=console, transient=True)
            self._task = self._bar.add_task("starts", total=total)

    def __enter__(self) -> "ScoreDisplay":
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def tick(self, agent: str, record: ResultRecord) -> None:
        """Count a record."""
        self._done += 1
        if record["status"] != "ok":
            problem = f"{record['status']}: {record['row']}: {record['problem']}"
            self._say(" ".join(problem.split())[:300])
        if self._bar is not None:
            self._bar.update(self._task, completed=self._done, description=agent)
        elif time.monotonic() - self._last_line_time > LINE_PERIOD_S:
            self._last_line_time = time.monotonic()
            rate = self._done / (self._last_line_time - self._start)
            remaining_s = (self._total - self._done) / rate
            progress = f"{self._done}/{self._total} rows"
            self._say(f"{agent}: {progress}, {rate:.1f} rows/s, {remaining_s:.0f} s left")

    def notice(self, text: str) -> None:
        """Show what a user should know."""
        self._say(f"note: {text}")

    def _say(self, text: str) -> None:
        self._console.print(text, markup=False, soft_wrap=True)
