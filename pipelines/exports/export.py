"""Export a dataset: rows become examples, which the writer of a format stores in a folder."""

import os
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from hijack_data.errors import ActionError, ParameterError
from hijack_data.registry import Registry

from ..building.build_options import Progress
from ..choices import EXPORTS, ONLOOKER
from ..dataset.manifest import is_lazy
from ..dataset.opening import open_split, shard_split
from ..errors import BuildError
from ..prompts import PROMPTS
from .dialects import action_text, check_dialect
from .example import Example, PreviousStep, Row, check_task, checked_answer, is_hidden
from .onlooker import OnlookerReport, export_onlooker
from .output_folder import new_folder, write_report
from .stored_rows import row_faults, stored_rows


class Writer(Protocol):
    """Writes one export format; its constructor takes the folder to write into.

    A writer may also have `notes()`, which yields remarks for the report after `finish`.
    """

    def shard(self, index: int, examples: Iterator[Example]) -> None:
        """Write the examples of one shard; shards come in order."""
        ...

    def finish(self) -> None:
        """Write the files other than the shards."""
        ...


def _problems(writer: Any, _: str) -> Iterator[str]:
    """Yield what is wrong with a writer."""
    if not callable(writer):
        yield "a writer is a class that is called with the folder to write into"
        return
    if not isinstance(writer, type):
        return  # a function that returns a writer
    for method, arguments in (("shard", "index, examples"), ("finish", "")):
        if not callable(getattr(writer, method, None)):
            yield f"it has no {method}({arguments})"


FORMATS = Registry[Callable[[Path], Writer]](
    "export format",
    "exports",
    builtin=EXPORTS,
    problems=_problems,
    reserved={ONLOOKER: "pipelines.exports.onlooker:export_onlooker"},
)
register = FORMATS.register


@dataclass
class ExportReport:
    """The result of an export.

    Args:
        out: the folder.
        to: the format.
        dialect: how actions are written.
        examples: examples by corruption.
        hidden: rows that were left out because their target does not show, by corruption.
        unsaid: rows that were left out because the dialect cannot express their action, by reason.
        untold: rows that were left out because their task is unknown, by reason.
        notes: remarks of the writer.
    """

    out: str
    to: str
    dialect: str
    examples: Counter[str] = field(default_factory=Counter[str])
    hidden: Counter[str] = field(default_factory=Counter[str])
    unsaid: Counter[str] = field(default_factory=Counter[str])
    untold: Counter[str] = field(default_factory=Counter[str])
    notes: list[str] = field(default_factory=list[str])

    @property
    def total(self) -> int:
        """All examples."""
        return sum(self.examples.values())

    @property
    def exit_code(self) -> int:
        """0 when there are examples, otherwise 1."""
        return 0 if self.total else 1

    def to_data(self) -> dict[str, Any]:
        """Return the report as JSON data."""
        counts = {
            name: dict(getattr(self, name)) for name in ("examples", "hidden", "unsaid", "untold")
        }
        return {
            "out": self.out,
            "to": self.to,
            "dialect": self.dialect,
            "total": self.total,
            **counts,
            **({"notes": self.notes} if self.notes else {}),
        }

    def lines(self) -> list[str]:
        """Return the report as lines of text."""
        text = [f"{self.out}: {self.total} examples ({self.to}, actions in {self.dialect})"]
        text += [f"  {label}: {count}" for label, count in self.examples.items()]
        text += [
            f"  {label}: {count} left out, their target is hidden"
            for label, count in self.hidden.items()
        ]
        left_out = [*self.unsaid.items(), *self.untold.items()]
        text += [f"  left out {count}: {reason}" for reason, count in left_out]
        return text + [f"  {note}" for note in self.notes]


def export(
    folder: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    to: str,
    dialect: str = "pyautogui",
    keep_hidden: bool = False,
    balance: float | None = None,
    split: str | None = None,
    progress: Progress | None = None,
) -> ExportReport | OnlookerReport:
    """Export a dataset for training. The same dataset and arguments give the same bytes.

    Args:
        folder: a dataset that `build` made, materialised or lazy.
        out: the folder to create; it must be empty or not exist.
        to: `chat` (messages and image files, JSON lines), `verl` (Parquet), `webdataset` (tar
            files), `atif` (a `trajectory.json` an episode), `onlooker` (Parquet: reminders,
            summaries and recovery steps), the name of a plug-in's writer, or
            `package.module:Writer` or `path/to/file.py:Writer`, see `Writer`.
        dialect: how actions are written: `pyautogui`, `ui_tars` or `ui_tars_1.5`.
        keep_hidden: also export rows whose target is less than half visible; they teach clicks on
            hidden targets.
        balance: with `onlooker` only: frames without a reminder for each that has one, 0 to 1000; 1
            by default.
        split: the split to export; required if the dataset has several.
        progress: called with rows done, rows in all, and a text.

    Raises:
        BuildError: `out` exists already or cannot be written, no row has a reminder or an event
            (`onlooker`), or `balance` is given with another format.
        DatasetError: the folder is not a finished dataset, a row is damaged, or the split is
            missing.
        ParameterError: `balance` is out of range.
        UnknownNameError: there is no such format or dialect.
        PluginError: the file, module or plug-in of the writer cannot be loaded.
    """
    make_writer = None if to == ONLOOKER else FORMATS.get(FORMATS.find(to))
    check_dialect(dialect)
    if make_writer is None:
        ratio = 1.0 if balance is None else balance
        return export_onlooker(
            folder,
            out,
            dialect=dialect,
            keep_hidden=keep_hidden,
            balance=ratio,
            split=split,
            progress=progress,
        )
    if balance is not None:
        raise BuildError(f"balance is for the format {ONLOOKER!r}; leave it out for {to!r}")
    rows = open_split(folder, split)
    report = ExportReport(os.fspath(out), to, dialect)
    with new_folder(Path(out), Path(folder)) as export_folder:
        writer = make_writer(export_folder)
        rows_done = 0
        for index, shard in enumerate(rows.manifest["shards"]):
            stored = stored_rows(rows.folder / shard["file"], is_lazy(rows.manifest))
            writer.shard(index, _examples(stored, index, report, keep_hidden, shard_split(shard)))
            rows_done += int(shard["rows"])
            if progress is not None:
                progress(rows_done, len(rows), "rows")
        writer.finish()
        report.notes += getattr(writer, "notes", list[str])()
        write_report(
            export_folder,
            {
                **report.to_data(),
                "keep_hidden": keep_hidden,
                "content": rows.fingerprint,
                **({} if split is None else {"split": split}),
            },
        )
    return report


def _examples(
    rows: Iterator[tuple[Row, Callable[[], bytes]]],
    shard: int,
    report: ExportReport,
    keep_hidden: bool,
    split: str,
) -> Iterator[Example]:
    number = 0
    history = _History()
    for row, png in rows:
        if is_hidden(row) and not keep_hidden:
            report.hidden[row["corruption"]] += 1
            continue
        try:
            check_task(row)
        except ActionError as error:
            report.untold[str(error)] += 1
            continue
        try:
            answer = checked_answer(action_text(row, report.dialect))
        except (ActionError, ParameterError) as error:
            report.unsaid[f"{row['action']['type']}: {error}"] += 1
            continue
        report.examples[row["corruption"]] += 1
        key = f"{shard:05d}-{number:06d}"
        step = PreviousStep(png(), answer)
        previous = history.add(row, step)
        answer_form = PROMPTS[report.dialect]
        yield Example(key, row, answer_form, answer, step.png, report.dialect, previous, split)
        number += 1


class _History:
    """The last steps of the corruptions that are faults of the input, of one trajectory."""

    def __init__(self) -> None:
        self._trajectory = ""
        self._last: dict[str, tuple[int, PreviousStep]] = {}

    def add(self, row: Row, step: PreviousStep) -> PreviousStep | None:
        """Add a row; return the step before it, if the row has faults and no step is missing."""
        if not row_faults(row):
            return None
        if row["trajectory_id"] != self._trajectory:
            self._trajectory = row["trajectory_id"]
            self._last.clear()
        number, previous = self._last.get(row["corruption"], (None, None))
        self._last[row["corruption"]] = row["step"], step
        return previous if number in (row["step"], row["step"] - 1) else None
