"""The clean rows of a dataset, corrupted while they are read."""

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, TypeAlias

import yaml

from hijack_data.config import dump
from hijack_data.errors import HijackError, ParameterError
from hijack_data.plan import CLEAN
from hijack_data.planner import Planner
from hijack_data.samples import SamplePlanner

from .dataset_rows import DamagedRowError, DatasetRows, RowData, entries_by_label

# Trajectories by turns: those that a search uses, and those on which it is confirmed.
RowPart: TypeAlias = Literal["all", "search", "held_out"]


class PlannedRows:
    """The clean rows of a dataset, each once under every corruption; a `RowFeed`.

    A row's plan is that of `hijack build` with the same seed, but for the elements, which rows do
    not have.

    Args:
        folder: The dataset.
        planners: The conditions by label; `None` is clean.
        seed: Of all draws.
        part: Which of its trajectories.

    Raises:
        ParameterError: A corruption acts on the machine or the input, which rows do not have; or
            the dataset has no clean rows.
    """

    def __init__(
        self, folder: Path, planners: Mapping[str, Planner | None], seed: int, part: RowPart = "all"
    ) -> None:
        for label, planner in planners.items():
            if planner is not None and (planner.effects or planner.inputs):
                raise ParameterError(
                    f"{label} acts on the machine or its input, and rows are pictures: build it"
                    " into the dataset (hijack build), or play it live (hijack bench)"
                )
        self._rows = DatasetRows(folder)
        self.folder = folder
        self.content = self._rows.content
        corrupting = {label: planner for label, planner in planners.items() if planner is not None}
        self.entries: Mapping[str, Any] = (
            entries_by_label(yaml.safe_load(dump(corrupting))) if corrupting else {}
        )
        self._seed = seed
        self._labels = list(planners)
        self._planners = {
            label: None if planner is None else SamplePlanner(planner, seed)
            for label, planner in planners.items()
        }
        self._clean = list(self._clean_rows(part))
        if not self._clean:
            raise ParameterError(
                f"{folder}: has no clean rows in the part {part!r}; build a dataset with clean rows"
                " of two trajectories or more"
            )

    def _clean_rows(self, part: RowPart) -> Iterator[tuple[int, str, RowData]]:
        """Yield number, split and light columns of the clean rows of a part."""
        trajectories: dict[str, int] = {}
        for number, split, row in _read_clean_heads(self.folder.resolve(), self.content):
            place = trajectories.setdefault(row["trajectory_id"], len(trajectories))
            if part == "all" or (place % 2 == 1) == (part == "held_out"):
                yield number, split, row

    def heads(self) -> Iterator[tuple[str, RowData]]:
        """Yield the split and the light columns of each row; see `RowFeed.heads`."""
        for _, split, row in self._clean:
            for label in self._labels:
                # How many pixels change is not known before the row is read.
                changed = {} if label == CLEAN else {"changed_pixels": None}
                yield split, {**row, **changed, **self._names(row, label), "seed": self._seed}

    def row(self, number: int) -> RowData:
        """Return one row, corrupted; see `RowFeed.row`.

        Raises:
            DamagedRowError: Its picture cannot be read, or it cannot be corrupted.
        """
        place, condition = divmod(number, len(self._labels))
        label = self._labels[condition]
        row = self._rows.row(self._clean[place][0])
        planner = self._planners[label]
        if planner is None:
            return row
        row = {key: value for key, value in row.items() if key != "action_code"}
        try:
            changes = planner.corrupt(
                row, row, lambda size, _: planner.plan(size, row, row["trajectory_id"]), seed=None
            )
        except HijackError as error:
            raise DamagedRowError(f"{self.folder}: row {row['id']!r}: {label}: {error}") from error
        return {**row, **changes, **self._names(row, label)}

    def _names(self, row: RowData, label: str) -> RowData:
        name = f"{row['trajectory_id']}/{row['step']:04d}/"
        return {"corruption": label, "id": f"{name}{label}"}


@lru_cache(maxsize=1)  # every round of a search, and every worker, needs the same
def _read_clean_heads(folder: Path, content: str) -> Sequence[tuple[int, str, RowData]]:
    """Return number, split and light columns of the clean rows of the dataset with a content."""
    heads = enumerate(DatasetRows(folder).heads())
    return [(number, split, row) for number, (split, row) in heads if row["corruption"] == CLEAN]
