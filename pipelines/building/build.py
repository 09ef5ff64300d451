"""Build a dataset: recorded trajectories in, Parquet shards with corrupted and clean rows out."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Unpack

from hijack_data.file_io import write_atomic
from hijack_data.paths import PathLike

from ..dataset.columns import pyarrow
from ..dataset.manifest import TRANSPARENT, make_manifest, total_counts, write_manifest
from ..dataset.shard import ShardRecord
from ..errors import BuildError
from ..readers import Rejected
from ..readers.reader_options import ReaderOptions
from ..readers.safe_files import is_utf8
from ..sources import SourceItem, Sources
from .build_options import BuildKeywords, BuildOptions, Progress, with_options
from .build_report import BuildReport, transparency_note
from .dataset_card import CARD, CONFIG, make_card
from .dry_run import run_dry
from .engine_registry import Engine, get_engine
from .item_buffer import read_items
from .loaded_files import check_loaded
from .output_folder import OutFolder, parameters_in
from .quarantine import Quarantine
from .replacement import replacement_folder
from .row_settings import build_config, in_order, make_settings, manifest_parameters
from .shards import ShardTask, shard_tasks
from .splits import Splits, choose_splits
from .step_rows import RowSettings


@with_options
def build(
    source: PathLike | Sequence[PathLike],
    out: PathLike,
    options: BuildOptions | None = None,
    **overrides: Unpack[BuildKeywords],
) -> BuildReport:
    """Build a dataset from recordings.

    The same source and options give the same bytes, whatever the number of workers and however
    often the build was killed and resumed. Inputs that cannot be read are left out and listed in
    `quarantine.jsonl`.

    Args:
        source: a file or folder of recordings, or a list of them. A folder may hold several
            formats: each file is read by its own reader. If two trajectories have the same id, that
            of the second is prefixed with the name of its source (or, within one source, of its
            format).
        out: the folder to create, outside the source; it must be empty or not exist.
        options: see `BuildOptions`, which describes every option.
        **overrides: the same options as keywords; they override `options`.

    Raises:
        AssetError: recorded pictures are needed and missing.
        BuildError: `out` cannot be used, or an option is wrong.
        ConfigError, ParameterError, UnknownNameError: a mistake in the configuration, a value out
            of range, or an unknown corruption, reader, engine or platform.
        DatasetError: `resume` without the file of corruptions that the build used, see
            `hijack_data.loading`.
        MissingDependencyError: pyarrow, isal or Ray is not installed.
        SourceError: the source does not exist, is empty, or is of no known format.
    """
    requested = replace(options or BuildOptions(), **overrides)
    pyarrow()
    engine = get_engine(requested.engine, requested.ray_address)
    requested.check()
    if requested.resume:
        check_loaded(parameters_in(Path(out)), os.fspath(out))
    plan = _plan_build(source, Path(out), requested)
    items, steps = read_items(plan.sources, requested.limit, count=requested.progress is not None)
    meter = _Meter(requested.progress, plan.settings.variants, steps)
    if requested.dry_run:
        return plan.dry_run(items, meter)
    return plan.run(items, meter, engine)


def _plan_build(
    source: PathLike | Sequence[PathLike], out: Path, requested: BuildOptions
) -> "_BuildPlan":
    """Open the sources and check everything that can be checked before records are read."""
    choices = ReaderOptions(requested.coordinates, requested.boxes, requested.episode_key)
    sources = Sources.open(
        source, requested.format, choices, apps=requested.apps, platform=requested.platform
    )
    options = requested.resolved()
    settings, notes = make_settings(options)
    splits = choose_splits(options.splits)
    for path in sources.paths:
        _check_apart(out, path)
    return _BuildPlan(
        out=out, options=options, sources=sources, settings=settings, splits=splits, notes=notes
    )


@dataclass
class _Meter:
    """Counts the processed steps, and reports them to the caller.

    It counts steps because the number of rows is not known before they are made.
    """

    progress: Progress | None
    variants: int
    total: int
    rows: int = 0

    def __call__(self, rows: int) -> None:
        self.rows += rows
        if self.progress is not None:
            self.progress(self.rows // self.variants, self.total, "steps")


@dataclass(frozen=True, kw_only=True)
class _BuildPlan:
    """A prepared build: its checked options and its opened sources."""

    out: Path
    options: BuildOptions
    sources: Sources
    settings: RowSettings
    splits: Splits
    notes: tuple[str, ...]

    def tasks(
        self, items: Iterator[SourceItem], reject: Callable[[Rejected], None]
    ) -> Iterator[ShardTask]:
        """Yield the shards; `reject` is called with each input that a reader could not read."""
        per_shard = self.options.rows_per_shard
        return shard_tasks(items, per_shard, self.settings.variants, reject, self.splits)

    def dry_run(self, items: Iterator[SourceItem], meter: _Meter) -> BuildReport:
        """Make all rows, write nothing, and return the report."""
        report = run_dry(
            lambda reject: self.tasks(items, reject),
            self.settings,
            strict=self.options.strict,
            tick=meter,
        )
        notes = (*self.notes, *self.sources.notes(), *report.notes)
        return replace(report, out=os.fspath(self.out), notes=notes)

    def run(self, items: Iterator[SourceItem], meter: _Meter, engine: Engine) -> BuildReport:
        """Write the dataset and return the report."""
        options = self.options
        parameters = manifest_parameters(self.settings, options, self.sources, self.splits)
        with replacement_folder(self.out, options.overwrite) as folder_path:
            folder = OutFolder(folder_path)
            with folder.open(parameters, options.resume):
                quarantine = Quarantine(folder.state, options.strict)
                with closing(quarantine):
                    job = _Job(plan=self, folder=folder, quarantine=quarantine, meter=meter)
                    job.run(self.tasks(items, quarantine.reject), options.workers, engine)
                    return job.finish(parameters)


@dataclass(kw_only=True)
class _Job:
    """One run of a build, in an output folder that it has locked."""

    plan: _BuildPlan
    folder: OutFolder
    quarantine: Quarantine
    meter: _Meter
    shards: dict[int, ShardRecord] = field(default_factory=dict[int, ShardRecord])
    kept_shards: int = 0

    def run(self, tasks: Iterator[ShardTask], workers: int, engine: Engine) -> None:
        """Make the shards that do not exist yet."""
        settings = self.plan.settings
        records = engine(self._missing(tasks), settings, self.folder.path, workers, self.meter)
        # Close now, so that workers do not live as long as the traceback of an error.
        with closing(records):
            for record in records:
                self._take(record)
                self.folder.save(record)

    def finish(self, parameters: Mapping[str, Any]) -> BuildReport:
        """Write the files beside the shards, the manifest last."""
        plan = self.plan
        out = self.folder.path
        shards = [self.shards[index] for index in sorted(self.shards)]
        self.quarantine.write(out, shards)
        config = build_config(plan.settings, plan.splits)
        rejected = self.quarantine.by_field
        manifest = make_manifest(parameters, config, plan.sources.names, shards, rejected)
        rows = in_order(manifest["counts"]["rows"], plan.settings)
        manifest["counts"]["rows"] = rows
        if config is None:
            (out / CONFIG).unlink(missing_ok=True)  # left by an earlier build
        else:
            write_atomic(out / CONFIG, config)
        has_faults = any(planner.inputs for _, planner in plan.settings.planners)
        write_atomic(out / CARD, make_card(manifest, has_faults))
        write_manifest(out, manifest)
        self.folder.finish(shards)
        counts = total_counts(shards)
        return BuildReport(
            out=os.fspath(plan.out),
            rows=rows,
            rejected=self.quarantine.total,
            examples=tuple(self.quarantine.examples),
            not_applicable=counts["not_applicable"],
            dropped=counts["dropped"],
            shards=len(shards),
            kept=self.kept_shards,
            notes=(
                *plan.notes,
                *plan.sources.notes(),
                *transparency_note(counts.get(TRANSPARENT, 0)),
                *_empty_splits(shards, plan.splits),
            ),
        )

    def _missing(self, tasks: Iterator[ShardTask]) -> Iterator[ShardTask]:
        for task in tasks:
            record = self.folder.keep(task)
            if record is None:
                yield task
                continue
            self.kept_shards += 1
            self._take(record)
            self.meter(task.steps * self.plan.settings.variants)

    def _take(self, record: ShardRecord) -> None:
        self.quarantine.check(record)
        self.shards[record.index] = record


def _empty_splits(shards: list[ShardRecord], splits: Splits) -> Iterator[str]:
    if len(splits.names) < 2:
        return
    for name in splits.names:
        prefix = f"{name}-"
        rows = sum(shard.rows for shard in shards if Path(shard.file).name.startswith(prefix))
        if not rows:
            yield (
                f"split {name}: no row; with so few trajectories chance decides, take larger shares"
                " or one split"
            )


def _check_apart(out: Path, source: Path) -> None:
    try:
        is_named = is_utf8(os.path.abspath(out))
        inside = is_named and source.is_dir() and out.resolve().is_relative_to(source.resolve())
    except (OSError, RuntimeError, ValueError) as error:
        raise BuildError(f"{out}: not a usable path ({error})") from None
    if not is_named:
        raise BuildError(f"{os.fspath(out)!r}: this name is not UTF-8; choose another")
    if inside:
        raise BuildError(f"{out}: lies in the source {source}; choose a folder outside it")
