"""Export a dataset as the training data of an onlooker.

Shards are read one after the other, and each shard step by step; two steps are in memory at a time.
"""

import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from hijack_data.errors import ActionError, ParameterError

from ...building.build_options import Progress
from ...dataset.manifest import is_lazy
from ...dataset.opening import Dataset, open_split, shard_rows
from ...edits.input_faults import describe_fault
from ...errors import BuildError
from ...prompts import PROMPTS
from ..dialects import action_text
from ..example import Example, Row, check_task, checked_answer, is_hidden
from ..output_folder import new_folder, write_report
from ..stored_rows import holds_several_actions, recorded_faults, row_faults, stored_rows
from .messages import NONE, chat, reminder_messages, summarise, summary_messages
from .report import OnlookerReport
from .sampling import COLUMNS_READ, WITH_REMINDER, OnlookerSampler
from .screen_change import ScreenChange, measure
from .step_frames import RowFrame, StepFrames, frames_by_step, transitions
from .tables import TABLES, TableWriter, about

MADE_BY = "template"
# The corruptions whose rows have a reminder.
REMINDING = ("network_error", "verification")


def export_onlooker(
    folder: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    dialect: str = "pyautogui",
    keep_hidden: bool = False,
    balance: float = 1.0,
    split: str | None = None,
    progress: Progress | None = None,
) -> OnlookerReport:
    """Export `reminders`, `summaries` and `recovery`.

    See `pipelines.exports.export` for arguments and errors. Only the actions of recovery steps are
    labels, so only recovery steps are left out if their target is hidden.
    """
    dataset = open_split(folder, split)
    manifest = dataset.manifest
    sampler = OnlookerSampler(int(manifest["parameters"]["seed"]), balance)
    _check_events(dataset)
    report = OnlookerReport(os.fspath(out), dialect, balance)
    with (
        new_folder(Path(out), Path(folder)) as export_folder,
        _Tables(export_folder, report, keep_hidden) as tables,
    ):
        rows_done = 0
        for index, shard in enumerate(manifest["shards"]):
            file = dataset.folder / shard["file"]
            choice = sampler.choose_rows(shard_rows(file, COLUMNS_READ))
            tables.shard(index, _frames(file, is_lazy(manifest)), choice)
            rows_done += int(shard["rows"])
            if progress is not None:
                progress(rows_done, len(dataset), "rows")
        report.short = sampler.short
        content = {"keep_hidden": keep_hidden, "content": dataset.fingerprint}
        part = {} if split is None else {"split": split}
        write_report(export_folder, report.to_data() | content | part)
    return report


class _Tables:
    """Fills the tables, shard by shard."""

    def __init__(self, folder: Path, report: OnlookerReport, keep_hidden: bool) -> None:
        self.report = report
        self.keep_hidden = keep_hidden
        self.tables = {name: TableWriter(folder, name) for name in TABLES}
        self.index = 0

    def __enter__(self) -> "_Tables":
        return self

    def __exit__(self, *_: object) -> None:
        self._finish_shard()

    def shard(self, index: int, frames: Iterable[RowFrame], choice: Mapping[int, str]) -> None:
        """Write the examples of a shard; `choice` names the rows that become reminder pairs."""
        self.index = index
        before: StepFrames | None = None
        number = 0
        for step in frames_by_step(frames):
            for frame in step.frames:
                self._reminder(frame, choice.get(number))
                self._recovery(frame)
                number += 1
            self._summaries(before, step)
            before = step
        self._finish_shard()

    def _finish_shard(self) -> None:
        for table in self.tables.values():
            table.finish_file()

    def _add(self, table: str, row: Mapping[str, Any]) -> None:
        self.tables[table].add(self.index, row)

    def _reminder(self, frame: RowFrame, kind: str | None) -> None:
        row = frame.row
        if kind is None or self._lacks_task("reminder", row):
            return
        reminder = NONE
        if kind == WITH_REMINDER:
            reminder = str(row["reminder"])
            self.report.reminders[row["corruption"]] += 1
        else:
            self.report.none[kind] += 1
        example = {
            "screenshot": frame.png,
            "reminder": reminder,
            "kind": kind,
            "messages": reminder_messages(row["instruction"], reminder),
        }
        self._add("reminders", about(row) | example)

    def _recovery(self, frame: RowFrame) -> None:
        row = frame.row
        # One picture cannot show that an action got lost, so it is no recovery step.
        if not row["inserted"] or row_faults(row) or self._lacks_task("recovery", row):
            return
        if is_hidden(row) and not self.keep_hidden:
            self.report.hidden[row["corruption"]] += 1
            return
        dialect = self.report.dialect
        try:
            answer = checked_answer(action_text(row, dialect))
        except (ActionError, ParameterError) as error:
            self._skip(f"recovery by {row['action']['type']}", error)
            return
        self.report.recovery[row["corruption"]] += 1
        question = Example("", row, PROMPTS[dialect], answer, frame.png).question
        example = {
            "event": row["event"],
            "action": row["action"],
            "target_box": row["target_box"],
            "screenshot": frame.png,
            "answer": answer,
            "messages": chat(question, answer),
        }
        self._add("recovery", about(row) | example)

    def _summaries(self, before: StepFrames | None, after: StepFrames) -> None:
        change: ScreenChange | None = None
        for start, frame in transitions(before, after, self._skip_event):
            if change is None and before is not None and before.clean and after.clean:
                change = measure(before.clean.pixels, after.clean.pixels)
            self._summary(start, frame, change)

    def _summary(self, start: RowFrame, frame: RowFrame, change: ScreenChange | None) -> None:
        row = start.row
        event = _find_event(start, frame)
        if self._lacks_task("summary", row):
            return
        try:
            action = self._action(row)
        except (ActionError, ParameterError) as error:
            self._skip(f"summary of {row['action']['type']}", error)
            return
        self.report.summaries[frame.row["corruption"]] += 1
        changed_share = None
        if event is None and change is not None:
            changed_share = change.share
        summary = summarise(row, event, change)
        example = {
            "before_id": row["id"],
            "before": start.png,
            "action": row["action"],
            "action_text": action,
            "after": frame.png,
            "event": event,
            "changed": changed_share,
            "summary": summary,
            "made_by": MADE_BY,
            "messages": summary_messages(row["instruction"], action, summary),
        }
        self._add("summaries", about(frame.row) | example)

    def _action(self, row: Row) -> str:
        """Return the action as text of the dialect, or as recorded; several only as recorded.

        Raises:
            ActionError: the dialect cannot express the action, and no code was recorded.
            ParameterError: a value of the action is out of its range, and no code was recorded.
        """
        if holds_several_actions(row):
            return str(row["action_code"])
        try:
            return action_text(row, self.report.dialect)
        except (ActionError, ParameterError):
            if not row["action_code"]:
                raise
            return str(row["action_code"])

    def _lacks_task(self, example_kind: str, row: Row) -> bool:
        """Return whether a row has no instruction, and count it if so."""
        try:
            check_task(row)
        except ActionError as error:
            self._skip(example_kind, error)
            return True
        return False

    def _skip_event(self, label: str, reason: str) -> None:
        self._skip(f"summary of {label}", reason)

    def _skip(self, example_kind: str, reason: object) -> None:
        self.report.skipped[f"{example_kind}: {reason}"] += 1


def _frames(file: Path, lazy: bool) -> Iterator[RowFrame]:
    for row, png in stored_rows(file, lazy):
        yield RowFrame(row, png())


def _find_event(start: RowFrame, frame: RowFrame) -> str | None:
    """Return what happened between two frames that the agent did not do, or `None`.

    A run says which actions arrived changed, whatever corruption its rows have.
    """
    event: str | None = frame.row["event"]
    if start.row["step"] == frame.row["step"]:  # the same recorded action, which got lost
        return event
    sentences = [describe_fault(fault) for fault in recorded_faults(start.row)]
    if event is not None and event not in sentences:
        sentences.append(event)
    return " ".join(sentences) or None


def _check_events(dataset: Dataset) -> None:
    """Refuse a dataset in which nothing ever happened.

    Raises:
        BuildError: no row has a reminder or an event.
    """
    columns = ["reminder", "event"]
    for shard in dataset.manifest["shards"]:
        rows = shard_rows(dataset.folder / shard["file"], columns)
        if any(row.get(name) is not None for row in rows for name in columns):
            return
    counts = dataset.manifest.get("counts", {})
    unfit: Mapping[str, Mapping[str, int]] = counts.get("not_applicable", {})
    reasons = [f"{name}: {reason}" for name in REMINDING for reason in unfit.get(name, {})]
    explanation = f" (not applicable there: {'; '.join(reasons)})" if reasons else ""
    raise BuildError(
        f"{dataset.folder}: no row has a reminder or an event, so there is nothing for an onlooker"
        " to learn from; build it with --corruptions all, or with"
        f" {' or '.join(REMINDING)}{explanation}"
    )
