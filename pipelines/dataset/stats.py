"""The figures of a dataset: counts, visible shares of targets, changed shares of pictures."""

import math
import os
from array import array
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from hijack_data.errors import quantity

from ..errors import DatasetError
from .columns import pyarrow
from .manifest import is_lazy, read_manifest

# Bins of the visible share of the target; the first is "hidden", the last "all of it".
EDGES = (0.0, 0.25, 0.5, 0.75, 1.0)
BINS = ("none", "under 25 %", "25 to 50 %", "50 to 75 %", "75 to 100 %", "all of it")
COLUMNS_READ = (
    "corruption",
    "source",
    "fidelity",
    "severity",
    "event",
    "reminder",
    "inserted",
    "target_visible",
    "changed_pixels",
    "width",
    "height",
)
BATCH = 4096


@dataclass(kw_only=True)
class LabelStats:
    """The figures of the rows of one corruption.

    Args:
        rows: number of rows.
        fidelity: rows by fidelity.
        severity: rows by level; `None` for parameters of no level.
        source: rows by format of the recording.
        event: rows by event, of those that have one.
        reminders: number of rows with a reminder.
        inserted: number of rows that an event added.
        visible: rows by the visible share of the target, in the order of `BINS`; rows without a
            target are not counted.
        changed_shares: share of the pixels that changed, 0..1, of each row.
    """

    rows: int = 0
    fidelity: Counter[str] = field(default_factory=Counter[str])
    severity: Counter[int | None] = field(default_factory=Counter["int | None"])
    source: Counter[str] = field(default_factory=Counter[str])
    event: Counter[str] = field(default_factory=Counter[str])
    reminders: int = 0
    inserted: int = 0
    visible: list[int] = field(default_factory=lambda: [0] * len(BINS))
    changed_shares: "array[float]" = field(default_factory=lambda: array("f"))

    def add(self, row: dict[str, Any]) -> None:
        """Count a row."""
        self.rows += 1
        self.fidelity[row["fidelity"]] += 1
        self.severity[row["severity"]] += 1
        self.source[row["source"]] += 1
        if row["event"]:
            self.event[row["event"]] += 1
        self.reminders += row["reminder"] is not None
        self.inserted += row["inserted"]
        pixels = max(1, row["width"] * row["height"])
        self.changed_shares.append(row["changed_pixels"] / pixels)
        if row["target_visible"] is not None:
            self.visible[_bin(row["target_visible"])] += 1

    def to_data(self) -> dict[str, Any]:
        """Return the figures as JSON data."""
        low = 0
        middle = 0
        high = 0
        if self.changed_shares:
            low, middle, high = map(float, np.quantile(self.changed_shares, (0, 0.5, 1)))
        return {
            "rows": self.rows,
            "fidelity": dict(sorted(self.fidelity.items())),
            "severity": {str(key): self.severity[key] for key in sorted(self.severity, key=str)},
            "source": dict(sorted(self.source.items())),
            "event": dict(sorted(self.event.items())),
            "reminders": self.reminders,
            "inserted": self.inserted,
            "target_visible": dict(zip(BINS, self.visible, strict=True)),
            "without_target": self.rows - sum(self.visible),
            "changed": {"min": low, "median": middle, "max": high},
        }


@dataclass(kw_only=True)
class Stats:
    """The figures of a dataset, by corruption in the order of the build."""

    folder: str
    output: str
    trajectories: int
    steps: int
    shards: int
    bytes: int
    labels: dict[str, LabelStats]
    counts: dict[str, Any]

    @property
    def rows(self) -> int:
        """All rows."""
        return sum(label_stats.rows for label_stats in self.labels.values())

    def to_data(self) -> dict[str, Any]:
        """JSON data."""
        counts = self.counts
        return {
            "folder": self.folder,
            "output": self.output,
            "rows": self.rows,
            "trajectories": self.trajectories,
            "steps": self.steps,
            "shards": self.shards,
            "bytes": self.bytes,
            "corruptions": {
                label: label_stats.to_data() for label, label_stats in self.labels.items()
            },
            "dropped": counts["dropped"],
            "not_applicable": counts["not_applicable"],
            "rejected": counts["rejected"],
        }

    def lines(self) -> list[str]:
        """Return lines of text: a summary, the events, and the samples without a row."""
        text = [
            f"{self.folder}: {self.rows} rows ({self.output}) from {self.steps} steps of"
            f" {self.trajectories} trajectories, {self.bytes / 1e6:.1f} MB in"
            f" {quantity(self.shards, 'file')}"
        ]
        for label, label_stats in self.labels.items():
            for event, count in sorted(label_stats.event.items()):
                text.append(f"{label}: {quantity(count, 'row')}: {event}")
            if label_stats.inserted:
                text.append(f"{label}: {quantity(label_stats.inserted, 'step')} inserted")
            if label_stats.reminders:
                text.append(f"{label}: {quantity(label_stats.reminders, 'row')} with a reminder")
        for label, count in self.counts["dropped"].items():
            text.append(f"{label}: {count} dropped, their target does not show")
        for label, reasons in self.counts["not_applicable"].items():
            for reason, count in reasons.items():
                text.append(f"{label}: not applicable to {quantity(count, 'step')}: {reason}")
        for field_name, count in self.counts["rejected"].items():
            text.append(f"{quantity(count, 'input')} rejected ({field_name})")
        return text

    def tables(self) -> list[Any]:
        """Return the figures for a terminal: text and `rich` tables."""
        from rich.markup import escape

        from hijack_data.cli.figure_table import FigureTable

        rows: list[list[str]] = []
        visible_rows: list[list[str]] = []
        for label, label_stats in self.labels.items():
            data = label_stats.to_data()
            listed = [_counts_text(data[name]) for name in ("severity", "fidelity", "source")]
            rows.append([label, str(label_stats.rows), changed_text(data), *listed])
            visible_rows.append(
                [label, *map(str, label_stats.visible), str(data["without_target"])]
            )
        head, *remarks = map(escape, self.lines())
        names = ("rows", "changed", "severity", "fidelity", "source")
        return [
            head,
            "",
            FigureTable("corruption", names, rows),
            "",
            FigureTable("target shows", (*BINS, "no target"), visible_rows),
            *remarks,
        ]


def stats(folder: str | os.PathLike[str]) -> Stats:
    """Count the rows of a dataset, without reading a picture.

    Raises:
        DatasetError: the folder is not a dataset, or an unfinished one, or a file cannot be read.
    """
    path = Path(folder)
    manifest = read_manifest(path)
    labels = {label: LabelStats() for label in manifest["counts"]["rows"]}
    for shard in manifest["shards"]:
        for row in _rows(path / shard["file"]):
            labels.setdefault(row["corruption"], LabelStats()).add(row)
    source = manifest["source"]
    return Stats(
        folder=os.fspath(folder),
        output="lazy" if is_lazy(manifest) else "materialised",
        trajectories=source["trajectories"],
        steps=source["steps"],
        shards=len(manifest["shards"]),
        bytes=sum(shard["bytes"] for shard in manifest["shards"]),
        labels=labels,
        counts=manifest["counts"],
    )


def percent_text(share: float) -> str:
    """Return a share as whole percent, which are 0 and 100 only if it is exactly so.

    They are rounded down, so that a share below a half is not said to be 50 %.
    """
    percent = math.floor(100 * share + 1e-9)
    return "under 1 %" if share > 0 and not percent else f"{percent} %"


def changed_text(data: dict[str, Any]) -> str:
    """Return the changed share of the pictures as text: the median, the least and the largest."""
    shares = data["changed"]
    low, middle, high = (100 * shares[name] for name in ("min", "median", "max"))
    return f"{middle:.1f} % ({low:.1f} to {high:.1f})"


def _bin(share: float) -> int:
    if share <= 0:
        return 0
    if share >= 1:
        return len(BINS) - 1
    return int(np.searchsorted(EDGES, share, side="right"))


def _rows(file: Path) -> Iterator[dict[str, Any]]:
    pa = pyarrow()
    try:
        with pa.parquet.ParquetFile(file) as parquet:
            for batch in parquet.iter_batches(BATCH, columns=list(COLUMNS_READ)):
                yield from batch.to_pylist()
    except (pa.ArrowException, OSError, KeyError) as error:
        raise DatasetError(f"{file}: cannot be read ({error}); hijack verify says more") from None


def _counts_text(counts: dict[str, int]) -> str:
    if len(counts) == 1:
        return next(iter(counts))
    return ", ".join(f"{name} {count}" for name, count in counts.items())
