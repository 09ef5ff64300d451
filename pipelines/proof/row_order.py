"""Compare rows with each other: ids, counts, and the order of trajectories and steps."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from hijack_data.errors import short_repr
from hijack_data.plan import CLEAN
from hijack_data.plugin import Corruption

from ..building.step_rows import RowSettings
from ..dataset.shard import ShardRecord
from ..edits.variants import has_effects

_Row = Mapping[str, Any]
# Columns that are the same in every row of a trajectory.
ABOUT = ("source", "domain", "instruction")
# A rejection for one of these fields drops a whole step.
WHOLE_STEP = ("image", "target_box")


@dataclass
class RowOrder:
    """Follows the rows of a dataset, step by step, over all its files.

    Args:
        labels: the rank of each corruption in the order of the build.
        clean: whether each step has a clean row.
    """

    labels: Mapping[str, int]
    clean: bool
    _finished_trajectories: set[str] = field(default_factory=set[str])
    _trajectory: str | None = None
    _step: int = -1
    _about: dict[str, Any] = field(default_factory=dict[str, Any])

    def problems(self, rows: list[dict[str, Any]]) -> Iterator[str]:
        """Yield the problems with the order of a step's rows; each problem names a row."""
        first = rows[0]
        yield from self._sequence_problems(first)
        yield from self._trajectory_problems(rows)
        for name, count in Counter(row["id"] for row in rows).items():
            if count > 1:
                yield f"row {name}: its id stands at {count} rows"
        yield from self._label_problems(rows)
        has_clean = any(row["corruption"] == CLEAN for row in rows)
        if self.clean and not has_clean:
            yield (
                f"row {first['id']}: its step has no clean row, and the build writes one for each"
                " step"
            )

    def _trajectory_problems(self, rows: list[dict[str, Any]]) -> Iterator[str]:
        """Yield a problem for each column that differs from the rest of its trajectory."""
        for name in ABOUT:
            expected = self._about.setdefault(name, rows[0][name])
            for row in rows:
                if row[name] != expected:
                    yield (
                        f"row {row['id']}: {name} is {short_repr(row[name])}, "
                        f"in the first row of its trajectory it is {short_repr(expected)}"
                    )
                    break

    def _label_problems(self, rows: list[dict[str, Any]]) -> Iterator[str]:
        """Yield unknown labels, and labels in another order than that of the build."""
        ranks: list[int] = []
        for row in rows:
            label = row["corruption"]
            if label in self.labels:
                ranks.append(self.labels[label])
                continue
            labels = ", ".join(self.labels)
            yield f"row {row['id']}: corruption is {short_repr(label)}, the build has {labels}"
        if ranks != sorted(ranks):
            yield (
                f"row {rows[0]['id']}: the rows of its step stand in another order than the build"
                " writes"
            )

    def _sequence_problems(self, row: _Row) -> Iterator[str]:
        trajectory = row["trajectory_id"]
        step = row["step"]
        if trajectory != self._trajectory:
            if trajectory in self._finished_trajectories:
                yield (
                    f"row {row['id']}: trajectory {trajectory!r} was there before, apart from"
                    " this row"
                )
            self._finished_trajectories.add(trajectory)
            self._trajectory = trajectory
            self._step = -1
            self._about = {}
        if step <= self._step:
            yield f"row {row['id']}: step {step} stands after step {self._step} of its trajectory"
        self._step = step


@dataclass
class ShardTally:
    """The numbers of rows, steps and trajectories in one file."""

    rows: Counter[str] = field(default_factory=Counter[str])
    inserted: Counter[str] = field(default_factory=Counter[str])
    trajectories: int = 0
    steps: int = 0
    _trajectory: object = None

    def add(self, rows: list[dict[str, Any]]) -> None:
        """Count the rows of one step."""
        self.rows.update(row["corruption"] for row in rows)
        self.inserted.update(row["corruption"] for row in rows if row["inserted"])
        self.steps += 1
        self.trajectories += rows[0]["trajectory_id"] != self._trajectory
        self._trajectory = rows[0]["trajectory_id"]

    def problems(self, record: ShardRecord, settings: RowSettings | None) -> Iterator[str]:
        """Yield the counts of the manifest that differ from the rows of a file."""
        row_counts = record.counts["rows"]
        for label in {**row_counts, **self.rows}:
            number = row_counts.get(label, 0)
            if number != self.rows[label]:
                yield f"the manifest counts {number} rows of {label}, there are {self.rows[label]}"
        rejected = sum(entry.get("field") in WHOLE_STEP for entry in record.rejected)
        steps = record.steps - rejected
        if settings is None or not settings.clean:
            return
        if self.steps != steps:
            yield f"the manifest counts {steps} steps with rows, there are {self.steps}"
        if not rejected and self.trajectories != record.trajectories:
            yield (
                f"the manifest counts {record.trajectories} trajectories, there are"
                f" {self.trajectories}"
            )
        for label, planner in settings.planners:
            if (
                isinstance(planner, Corruption)
                and planner.steps is None
                and not has_effects(planner)
                and not planner.inputs
            ):
                yield from _count_problems(label, self.rows[label], record, steps)


def _count_problems(label: str, rows: int, record: ShardRecord, steps: int) -> Iterator[str]:
    """Yield a problem if a corruption that acts at every step has no result for some of them."""
    reasons = record.counts["not_applicable"].get(label, {})
    without_row = sum(reasons.values()) + record.counts["dropped"].get(label, 0)
    broken = sum(entry.get("where", "").endswith(f", {label}") for entry in record.rejected)
    if rows + without_row + broken != steps:
        yield (
            f"{label}: {rows} rows, {without_row} without a row and {broken} rejected are not"
            f" the {steps} steps of the file"
        )
