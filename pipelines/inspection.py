"""`inspect_source`: the content of a source and the rows that a build would make of it."""

import os
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hijack_data.errors import HijackError, quantity
from hijack_data.paths import PathLike
from hijack_data.planner import Planner
from hijack_data.types import Trajectory

from .building.build_options import BuildOptions
from .building.build_report import MAX_SHOWN_INPUTS, BuildReport
from .building.dry_run import run_dry
from .building.row_settings import make_settings
from .building.shards import ShardTask, shard_tasks
from .choices import SAMPLE
from .dataset.columns import pyarrow
from .readers import Rejected, get_reader
from .readers.reader_options import ReaderOptions
from .readers.recorded_pictures import picture_file, read_picture
from .readers.recording_facts import read_facts
from .readers.safe_files import image_size
from .readers.survey import summary
from .sources import SourceItem, Sources

_SPACE = re.compile(r"Coordinates: (.*?)(?:[.;:]\s|\Z)", re.DOTALL)
UNKNOWN = "not said"
ONE_SHARD = 10**9  # rows: more than any sample has


@dataclass
class Inspection:
    """The result of `inspect_source`; all counts except those of `outlook` cover every trajectory.

    Args:
        sources: names of the inspected sources.
        formats: trajectories and steps by format.
        coordinates: the space of the recorded coordinates by format, as its reader documents it.
        sizes: pictures by size, `"1920x1080"` (width x height).
        actions: steps by type of action.
        apps: trajectories by application; `"not said"` counts those that name none.
        screens: trajectories by what their pictures show: desktop, web page or phone; `"not said"`
            counts those that do not say it, which no corruption of the machine is applied to.
        platforms: trajectories by operating system; `"not said"` counts those that name none.
        without_instruction: number of trajectories without an instruction.
        rejected: inputs that cannot be read, by field.
        examples: the first rejected inputs, each as one line of text.
        unread: files that may hold records but are of no known format.
        notes: remarks about the options of the build.
        outlook: report of a trial build of a few trajectories of each format and platform; `None`
            if none was asked for.
        looked_at: trajectories and steps of the trial build.
    """

    sources: tuple[str, ...]
    formats: dict[str, list[int]] = field(default_factory=dict[str, list[int]])
    coordinates: dict[str, str] = field(default_factory=dict[str, str])
    sizes: Counter[str] = field(default_factory=Counter[str])
    actions: Counter[str] = field(default_factory=Counter[str])
    apps: Counter[str] = field(default_factory=Counter[str])
    screens: Counter[str] = field(default_factory=Counter[str])
    platforms: Counter[str] = field(default_factory=Counter[str])
    without_instruction: int = 0
    rejected: Counter[str] = field(default_factory=Counter[str])
    examples: list[str] = field(default_factory=list[str])
    unread: list[str] = field(default_factory=list[str])
    notes: list[str] = field(default_factory=list[str])
    outlook: BuildReport | None = None
    looked_at: tuple[int, int] = (0, 0)

    @property
    def trajectories(self) -> int:
        """Number of trajectories that can be read."""
        return sum(count for count, _ in self.formats.values())

    @property
    def steps(self) -> int:
        """Number of steps that can be read."""
        return sum(count for _, count in self.formats.values())

    @property
    def exit_code(self) -> int:
        """0 if every input can be read and there are steps, otherwise 1."""
        complete = self.steps > 0 and not self.rejected
        return 0 if complete else 1

    def to_data(self) -> dict[str, Any]:
        """Return the inspection as JSON data."""
        formats = {name: self._format(name) for name in self.formats}
        return {
            "sources": list(self.sources),
            "formats": formats,
            "trajectories": self.trajectories,
            "steps": self.steps,
            "sizes": dict(self.sizes.most_common()),
            "actions": dict(self.actions.most_common()),
            "apps": dict(self.apps.most_common()),
            "screens": dict(self.screens.most_common()),
            "platforms": dict(self.platforms.most_common()),
            "without_instruction": self.without_instruction,
            "rejected": dict(self.rejected.most_common()),
            "examples": self.examples,
            "unread": self.unread,
            "notes": self.notes,
            "outlook": self._outlook(),
        }

    def _format(self, name: str) -> dict[str, Any]:
        trajectories, steps = self.formats[name]
        return {"trajectories": trajectories, "steps": steps, "coordinates": self.coordinates[name]}

    def _outlook(self) -> dict[str, Any] | None:
        if self.outlook is None:
            return None
        trajectories, steps = self.looked_at
        reasons = self.outlook.not_applicable
        return {
            "trajectories": trajectories,
            "steps": steps,
            "rows": dict(self.outlook.rows),
            "not_applicable": {label: dict(counts) for label, counts in reasons.items()},
        }

    def tables(self) -> Iterator[Any]:
        """Yield the tables and lines of text that a rich console prints."""
        from rich.markup import escape
        from rich.table import Table

        source_names = escape(", ".join(self.sources))
        content = _content(self.trajectories, self.steps)
        yield f"[bold]{source_names}[/]: {content}"
        yield ""
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        table.add_column("format")
        table.add_column("trajectories", justify="right")
        table.add_column("steps", justify="right")
        table.add_column("coordinates in the recording")
        for name, (trajectories, steps) in self.formats.items():
            space = escape(self.coordinates[name])
            table.add_row(name, str(trajectories), str(steps), space)
        yield table
        yield ""
        yield self._facts()
        if self.outlook is not None:
            yield ""
            yield from self._outlook_table(self.outlook)
        yield from self._problems()

    def _facts(self) -> Any:
        from rich.markup import escape
        from rich.table import Table

        table = Table(box=None, show_header=False, pad_edge=False, padding=(0, 2, 0, 0))
        facts = {
            "screens": self.sizes,
            "they show": self.screens,
            "platform": self.platforms,
            "applications": self.apps,
            "actions": self.actions,
        }
        for name, counts in facts.items():
            table.add_row(f"[dim]{name}[/]", escape(_listed(counts)))
        if self.without_instruction:
            without = _many(self.without_instruction, "trajectory")
            table.add_row("[dim]instruction[/]", f"{without} without")
        return table

    def _outlook_table(self, outlook: BuildReport) -> Iterator[Any]:
        from rich.markup import escape
        from rich.table import Table

        trajectories, steps = self.looked_at
        part = "all of them"
        if trajectories != self.trajectories:
            part = f"the first of each format and platform: {_content(trajectories, steps)}"
        yield f"[bold]What a build would give[/] ({part})"
        yield ""
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        table.add_column("corruption")
        table.add_column("rows", justify="right")
        table.add_column("not applicable")
        for label, rows in outlook.rows.items():
            reasons = outlook.not_applicable.get(label, {})
            texts = [f"{_many(count, 'step')}: {reason}" for reason, count in reasons.items()]
            table.add_row(label, str(rows), escape("; ".join(texts)))
        yield table

    def _problems(self) -> Iterator[str]:
        from rich.markup import escape

        total = sum(self.rejected.values())
        if total:
            yield ""
            yield f"[yellow]{quantity(total, 'input')} cannot be read[/]"
            for example in self.examples:
                yield f"  {escape(example)}"
            if total > len(self.examples):
                yield "  ..."
        if self.unread:
            yield ""
            yield f"[yellow]not read, of no known format[/]: {escape(summary(self.unread))}"
        for note in self.notes:
            yield f"note: {escape(note)}"


def inspect_source(
    source: PathLike | Sequence[PathLike],
    *,
    format: str | None = None,
    corruptions: Mapping[str, Planner] | str = "all",
    sample: int = SAMPLE,
    seed: int = 0,
    assets: PathLike | None = None,
    coordinates: str | None = None,
    boxes: str | None = None,
    apps: Sequence[str] | str | None = None,
    platform: str | None = None,
    allow_platform_mismatch: bool = False,
) -> Inspection:
    """Return what one source or several contain, and which rows a build would make of them.

    Nothing is built: for a few trajectories of each format and platform, the corruptions are
    planned as a build plans them. All options mean what they mean for `build`.

    Args:
        source: a file or folder of recordings, or a list of them.
        format: name of the reader of all files; by default each file's reader is found.
        corruptions: planners by label, or text, as `build` takes them.
        sample: number of trajectories of each source, format and platform for which the
            corruptions are planned, at least 0; 0 plans none.
        seed: seed of those plans.
        assets: folder of recorded pictures.
        coordinates: the space of the coordinates, if the recording does not state it.
        boxes: the order of a box's numbers, if the recording does not state it.
        apps: applications in the trajectories whose source names none.
        platform: the machine of the trajectories whose source names none.
        allow_platform_mismatch: count rows that show an Xfce desktop in recordings of other
            platforms, too.

    Raises:
        SourceError: no such source, nothing in it, or no known format.
        AssetError: recorded pictures are needed and missing.
        BuildError: an option does not fit the corruptions or the formats.
        ConfigError, ParameterError, UnknownNameError: a mistake in the corruptions, the seed, a
            name, or `agenthijack.yaml`.
        MissingDependencyError: pyarrow is not installed.
    """
    pyarrow()
    choices = ReaderOptions(coordinates, boxes)
    sources = Sources.open(source, format, choices, apps=apps, platform=platform)
    sources.refuse_nothing()
    inspection = Inspection(tuple(sources.names))
    sampled: list[SourceItem] = []
    counts: Counter[tuple[object, ...]] = Counter()
    for read in sources.read():
        if isinstance(read.item, Rejected):
            _reject(inspection, read.item)
            continue
        _count(inspection, read.item)
        facts = read_facts(read.item)
        # the kind of screen decides which corruptions apply
        key = (os.fspath(read.root), read.item.source, facts.screen, facts.platform)
        counts[key] += 1
        if counts[key] <= sample:
            sampled.append(read)
    inspection.unread = sources.unread
    inspection.notes += [*sources.advice(), *sources.exclusions()]
    inspection.coordinates = {name: coordinate_space(name) for name in inspection.formats}
    if sampled:
        _plan(
            inspection,
            sampled,
            corruptions=corruptions,
            seed=seed,
            assets=assets,
            allow_platform_mismatch=allow_platform_mismatch,
        )
    return inspection


def coordinate_space(name: str) -> str:
    """Return the first sentence of a reader's docstring about the space of its coordinates.

    Raises:
        UnknownNameError: no format is called `name`.
    """
    documentation = type(get_reader(name)).__doc__ or ""
    sentence = _SPACE.search(" ".join(documentation.split()))
    return sentence[1].rstrip(".") if sentence else UNKNOWN


def _plan(
    inspection: Inspection,
    sampled: list[SourceItem],
    *,
    corruptions: Mapping[str, Planner] | str,
    seed: int,
    assets: PathLike | None,
    allow_platform_mismatch: bool,
) -> None:
    """Plan the corruptions of the sampled trajectories, and add the report to `inspection`."""
    options = BuildOptions(
        corruptions=corruptions,
        seed=seed,
        assets=assets,
        allow_platform_mismatch=allow_platform_mismatch,
    )
    settings, notes = make_settings(options.resolved())

    def tasks(reject: Callable[[Rejected], None]) -> Iterator[ShardTask]:
        return shard_tasks(iter(sampled), ONE_SHARD, settings.variants, reject)

    inspection.outlook = run_dry(tasks, settings)
    inspection.notes += (*notes, *inspection.outlook.notes)
    items = [read.item for read in sampled]
    steps = sum(len(item.steps) for item in items if isinstance(item, Trajectory))
    inspection.looked_at = len(items), steps


def _reject(inspection: Inspection, record: Rejected) -> None:
    inspection.rejected[record.field or "(record)"] += 1
    if len(inspection.examples) < MAX_SHOWN_INPUTS:
        inspection.examples.append(str(record))


def _count(inspection: Inspection, trajectory: Trajectory) -> None:
    counts = inspection.formats.setdefault(trajectory.source, [0, 0])
    counts[0] += 1
    counts[1] += len(trajectory.steps)
    facts = read_facts(trajectory)
    inspection.apps.update(facts.apps or (UNKNOWN,))
    inspection.screens[facts.screen or UNKNOWN] += 1
    inspection.platforms[facts.platform or UNKNOWN] += 1
    inspection.without_instruction += not trajectory.instruction
    for step in trajectory:
        inspection.actions[step.action.type] += 1
        inspection.sizes[_size(step.image)] += 1


def _size(image: str) -> str:
    """Return the size of a picture as text; the report of a build explains unreadable ones."""
    with suppress(HijackError, OSError, ValueError):
        in_a_record = os.fspath(picture_file(image)) != image
        picture = read_picture(image, "") if in_a_record else Path(image)
        height, width = image_size(picture)
        return f"{width}x{height}"
    return "unreadable"


def _content(trajectories: int, steps: int) -> str:
    return f"{_many(trajectories, 'trajectory')}, {_many(steps, 'step')}"


def _many(count: int, noun: str) -> str:
    if count == 1:
        return f"1 {noun}"
    plural = f"{noun[:-1]}ies" if noun.endswith("y") else f"{noun}s"
    return f"{count} {plural}"


def _listed(counts: Counter[str], limit: int = 8) -> str:
    first = [f"{name} ({count})" for name, count in counts.most_common(limit)]
    if len(counts) > limit:
        first.append(f"and {len(counts) - limit} more")
    return ", ".join(first) or UNKNOWN
