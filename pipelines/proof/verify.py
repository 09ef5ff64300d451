"""Check a dataset against its manifest, against itself and, if it is given, against its source.

The code of the build makes the rows again, from the clean rows or from the source.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby, zip_longest
from pathlib import Path
from typing import Any

from hijack_data import extras
from hijack_data.errors import AssetError, HijackError, quantity, shorten_list
from hijack_data.pack import VARIABLE, AssetPack
from hijack_data.paths import PathLike
from hijack_data.plan import CLEAN

from ..building.build_report import Findings
from ..building.loaded_files import check_loaded
from ..building.row_settings import has_detector, settings_from
from ..building.shards import ShardTask, shard_tasks
from ..building.splits import Splits
from ..building.step_rows import RowSettings
from ..dataset.manifest import read_manifest
from ..dataset.opening import shard_rows
from ..dataset.shard import ShardRecord
from ..errors import DatasetError
from ..readers.base import Rejected
from ..readers.recorded_actions import RecordedStep
from ..sources import Sources
from .manifest_checks import (
    companion_files,
    derived_fields,
    library_notes,
    shard_problems,
    shard_records,
    stray_files,
)
from .recorded_steps import (
    STEP_COLUMNS,
    RecordedFacts,
    Recordings,
    damaged_row,
    provable_settings,
    recorded_step,
    trajectory_step,
)
from .row_checks import StepChecker
from .row_order import WHOLE_STEP, RowOrder, ShardTally


@dataclass
class VerifyReport(Findings):
    """The result of `verify`.

    Args:
        folder: the dataset.
        problems: the problems found, each with the file or row; empty if there are none.
        rows: number of rows that were read.
        regenerated: number of corrupted rows whose picture was made again and is the same.
        shards: number of files that were checked.
        notes: remarks that are not problems by themselves, such as a newer asset pack.
        unproved: the corruptions whose plans were not made again, and why.
    """

    rows: int = 0
    regenerated: int = 0
    shards: int = 0
    notes: list[str] = field(default_factory=list[str])
    unproved: list[str] = field(default_factory=list[str])

    def lines(self) -> list[str]:
        """Return the report as lines of text."""
        state = "all is well" if self.ok else quantity(len(self.problems), "problem")
        size = f"{quantity(self.rows, 'row')} in {quantity(self.shards, 'file')}"
        head = f"{self.folder}: {size}, {self.regenerated} made again: {state}"
        return [
            head,
            *self.listed(),
            *(f"  note: {note}" for note in (*self.notes, *self.unproved)),
        ]


def verify(
    folder: PathLike, *, source: PathLike | Sequence[PathLike] | None = None
) -> VerifyReport:
    """Check a dataset against its manifest, against itself and, if it is given, against its source.

    The files must be those of the manifest, with its hashes and rows, and no others; each picture
    must decode to `image_sha256`; ids, order and counts must be those of the build. The rows of
    each step are made again from its clean row, the seed and the parameters, by the code that
    builds them, and every column must be the same. Plans that depend on more (elements,
    applications, earlier steps) are used as stored, and noted.

    A check fails with `DatasetError` (the folder is not a finished dataset, or was built with
    corruptions of a file that is not loaded, see `hijack --load`), `SourceError` (there is no
    source), `AssetError` (rows of events have to be made again without an asset pack) or
    `MissingDependencyError` (elements have to be detected and OpenCV is not installed).

    Args:
        folder: the dataset.
        source: the recordings that it was built from, or a list of several. All rows, whatever
            their plans depend on, are then made again from the recordings and must equal those of
            the dataset.
    """
    path = Path(folder)
    manifest = read_manifest(path)
    parameters = manifest["parameters"]
    check_loaded(parameters, os.fspath(folder))
    report = VerifyReport(os.fspath(folder))
    settings = settings_from(parameters, os.fspath(folder))
    records = shard_records(manifest, path)
    report.notes += [*_pack_notes(parameters.get("assets")), *library_notes(parameters)]
    report.problems += [*stray_files(path, records), *companion_files(path, manifest)]
    _Check(path, manifest, records, settings, report).run(source)
    if not report.problems:
        report.problems += derived_fields(path, manifest, records, settings)
    return report


def _pack_notes(built_with: dict[str, str] | None) -> list[str]:
    """Return a note if the asset pack of this machine is not the one of the build."""
    if built_with is None:
        return []
    try:
        installed = AssetPack.load().digest
    except AssetError as error:
        return [f"recorded pictures cannot be looked at: {error}"]
    if installed == built_with["sha256"]:
        return []
    return [
        f"the asset pack here ({installed[:12]}) is not the one of the build"
        f" ({built_with['sha256'][:12]}); set {VARIABLE} to that one where rows cannot be made"
        " again"
    ]


@dataclass
class _Check:
    """One check of all rows of a dataset."""

    folder: Path
    manifest: Mapping[str, Any]
    records: list[ShardRecord]
    settings: RowSettings | None
    report: VerifyReport

    def __post_init__(self) -> None:
        settings = self.settings
        counts = self.manifest["counts"]["rows"]
        self.labels = {label: rank for rank, label in enumerate(counts)}
        if settings is not None:
            clean_labels = [CLEAN] if settings.clean else []
            names = [*clean_labels, *(label for label, _ in settings.planners)]
            self.labels = {label: rank for rank, label in enumerate(names)}
        parameters = self.manifest["parameters"]
        self.order = RowOrder(self.labels, bool(parameters["clean"]))
        self.planners = None if settings is None else dict(settings.planners)
        self.seed, self.label_policy = int(parameters["seed"]), str(parameters["label_policy"])
        # What can be made again from clean rows alone: of one step, and of all of a trajectory.
        build_settings = settings or RowSettings(
            (), self.seed, bool(parameters["clean"]), self.label_policy
        )
        self.step_settings = provable_settings(build_settings, with_inputs=False)
        self.trajectory_settings = provable_settings(
            build_settings, with_inputs=build_settings.clean
        )
        self.trajectories: dict[str, tuple[RecordedStep, ...]] = {}
        self.rejected = frozenset(
            entry["where"] for record in self.records for entry in record.rejected
        )

    def run(self, source: PathLike | Sequence[PathLike] | None) -> None:
        """Check all files."""
        if source is None:
            self._note_unproved()
        tasks = iter(()) if source is None else self._tasks(source)
        for record, task in zip_longest(self.records, tasks):
            if record is None:
                first = task.trajectories[0].id if task.trajectories else "none"
                self.report.problems.append(
                    f"the recordings hold more, from trajectory {first!r} on"
                )
                return
            if source is not None and task is None:
                self.report.problems.append(
                    f"{record.file}: the recordings hold less than the dataset"
                )
            self._check_file(record, task)

    def _note_unproved(self) -> None:
        if self.settings is None:
            self.report.unproved.append(
                "the manifest cannot hold the corruptions of this build: plans were not made again"
                " from the seed"
            )
            return
        proved = {label for label, _ in self.trajectory_settings.planners}
        unproved = [(label, p) for label, p in self.settings.planners if label not in proved]
        labels = [label for label, planner in unproved if not planner.inputs]
        if labels:
            self.report.unproved.append(
                f"the pictures of {', '.join(labels)} were drawn again from their stored plans;"
                " that"
                " the seed gives these plans was not checked, since they also follow from what the"
                " dataset does not hold (elements, applications, the steps before): --source"
                " RECORDINGS checks it, too"
            )
        faults = [label for label, planner in unproved if planner.inputs]
        if faults:
            self.report.unproved.append(
                f"the rows of {', '.join(faults)} were not made again: that the action before was"
                " hit as their events say is not checked without --source RECORDINGS, since it"
                " follows from plans of plug-ins, or from actions that only clean rows hold"
            )
        inputs = [label for label, planner in self.settings.planners if planner.inputs]
        partial = sorted(set().union(*map(_partial_trajectories, self.records)))
        if partial and len(faults) < len(inputs):
            labels = [label for label in inputs if label not in faults]
            self.report.unproved.append(
                f"the rows of {', '.join(labels)} of {shorten_list(partial)} were not made again,"
                " since some steps there were rejected: that the action before was hit as their"
                " events say is not checked without --source RECORDINGS"
            )

    def _tasks(self, source: PathLike | Sequence[PathLike]) -> Iterator[ShardTask]:
        # returns the shards of the source, as the build makes them
        parameters = self.manifest["parameters"]
        settings = self.settings
        if settings is None:
            raise DatasetError(
                f"{self.folder}: the manifest cannot hold the corruptions of this build, so its"
                " rows cannot be made again from the source; verify without source=, or build"
                " again and compare"
            )
        if settings.detect and not has_detector():
            raise extras.missing(
                "finding the elements of the source's pictures needs opencv", "vision"
            )
        sources = Sources.reopen(source, parameters)
        splits = Splits(parameters.get("splits"))
        rejected: list[Rejected] = []
        yield from shard_tasks(
            sources.read(parameters.get("limit")),
            int(parameters["rows_per_shard"]),
            settings.variants,
            rejected.append,
            splits,
        )
        late = sum(len(record.rejected) for record in self.records)
        expected = sum(self.manifest["counts"]["rejected"].values()) - late
        if len(rejected) != expected:
            self.report.problems.append(
                f"the recordings hold {len(rejected)} inputs that cannot be read, the manifest"
                f" counts {expected}"
            )

    def _check_file(self, record: ShardRecord, task: ShardTask | None) -> None:
        file = self.folder / record.file
        name = record.file
        if not file.is_file():
            self.report.problems.append(f"{name}: missing")
            return
        self.report.shards += 1
        self.report.problems += shard_problems(file, record)
        tally = ShardTally()
        before = self.report.rows
        recordings = None
        if task is not None and self.settings is not None:
            recordings = Recordings(task, self.settings)
        try:
            if recordings is None:
                for problem in self._read_trajectories(file, record):
                    self.report.problems.append(f"{name}: {problem}")
            for problem in self._check_steps(file, record, tally, recordings):
                self.report.problems.append(f"{name}: {problem}")
        except DatasetError as error:
            self.report.problems.append(str(error))
        rows = self.report.rows - before
        if rows != record.rows:
            self.report.problems.append(
                f"{name}: the manifest says {record.rows} rows, {rows} were read"
            )
        else:
            self.report.problems += [
                f"{name}: {text}" for text in tally.problems(record, self.settings)
            ]
        if recordings is not None:
            self.report.problems += [f"{name}: {text}" for text in recordings.problems(record)]

    def _read_trajectories(self, file: Path, record: ShardRecord) -> Iterator[str]:
        """Read the trajectories of a file whose clean rows are all there; yield damaged rows.

        Only faults of the input need them.
        """
        self.trajectories = {}
        if not any(planner.inputs for _, planner in self.trajectory_settings.planners):
            return
        incomplete = _partial_trajectories(record)
        steps: dict[str, list[RecordedStep]] = {}
        for row in shard_rows(file, list(STEP_COLUMNS)):
            try:
                if row["corruption"] == CLEAN and row["trajectory_id"] not in incomplete:
                    steps.setdefault(row["trajectory_id"], []).append(trajectory_step(row))
            except HijackError as error:
                yield f"row {row.get('id')}: {error}"
            except (AttributeError, KeyError, RecursionError, TypeError, ValueError) as error:
                yield f"row {row.get('id')}: {damaged_row(error)}"
        self.trajectories = {name: tuple(items) for name, items in steps.items()}

    def _check_steps(
        self, file: Path, record: ShardRecord, tally: ShardTally, recordings: Recordings | None
    ) -> Iterator[str]:
        """Yield the problems of the rows of a file."""
        for key, group in groupby(
            shard_rows(file), lambda row: (row["trajectory_id"], row["step"])
        ):
            rows = list(group)
            self.report.rows += len(rows)
            try:
                tally.add(rows)
                yield from self.order.problems(rows)
                if recordings is None:
                    yield from self._check_step(rows, self._find_recorded_step(rows, record))
                else:
                    yield from self._compare_with_source(rows, key, recordings)
            except (AttributeError, KeyError, TypeError, ValueError) as error:
                yield f"row {rows[0].get('id')}: {damaged_row(error)}"
        if recordings is not None:
            for _, step in recordings.steps:
                yield from self._check_step([], step)

    def _compare_with_source(
        self, rows: list[dict[str, Any]], key: tuple[str, int], recordings: Recordings
    ) -> Iterator[str]:
        """Yield the problems of the rows of a step, which is read from the source."""
        if key not in recordings.keys:
            yield (
                f"row {rows[0]['id']}: its step is not in the recordings, or in another file of the"
                " dataset"
            )
            return
        for step_key, step in recordings.steps:
            if step_key != key:
                yield from self._check_step([], step)  # this step has no rows
                continue
            if step is None:
                yield f"row {rows[0]['id']}: its step cannot be read from the recordings"
            yield from self._check_step(rows, step)
            return

    def _find_recorded_step(
        self, rows: list[dict[str, Any]], record: ShardRecord
    ) -> RecordedFacts | None:
        """Return the recorded step of some rows; a damaged row is reported by its own check."""
        trajectory = rows[0]["trajectory_id"]
        key = record.samples.get(trajectory)
        steps = self.trajectories.get(trajectory)
        settings = self.step_settings if steps is None else self.trajectory_settings
        try:
            return recorded_step(rows, key, settings, steps)
        except HijackError:
            return None

    def _check_step(
        self, rows: list[dict[str, Any]], recorded: RecordedFacts | None
    ) -> Iterator[str]:
        proof = StepChecker(
            rows=rows,
            recorded=recorded,
            planners=self.planners,
            ranks=self.labels,
            seed=self.seed,
            label_policy=self.label_policy,
            rejected=self.rejected,
        )
        yield from proof.problems()
        self.report.regenerated += proof.regenerated


def _partial_trajectories(record: ShardRecord) -> set[str]:
    """Return the trajectories of a file of which a whole step was rejected."""
    rejected = [entry for entry in record.rejected if entry.get("field") in WHOLE_STEP]
    return {entry.get("where", "").rpartition(", step ")[0] for entry in rejected}
