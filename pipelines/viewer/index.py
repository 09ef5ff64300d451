"""What filters, counts and searches need to know of all rows, in memory: some twenty bytes a row and its id."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from hijack_data.errors import UnknownNameError, suggest

Rows: TypeAlias = npt.NDArray[np.int64]
Mask: TypeAlias = npt.NDArray[np.bool_]


@dataclass
class Column:
    """A column of text that repeats itself: int32 codes `[N]`, and the values that they stand for."""

    values: dict[str, int] = field(default_factory=dict[str, int])
    parts: list[npt.NDArray[np.int32]] = field(default_factory=list[npt.NDArray[np.int32]])

    def extend(self, values: Iterable[str]) -> None:
        """Add the values of more rows."""
        known = self.values
        self.parts.append(np.array([known.setdefault(value, len(known)) for value in values], np.int32))

    @property
    def codes(self) -> npt.NDArray[np.int32]:
        """The codes of all rows."""
        if len(self.parts) != 1:
            self.parts = [np.concatenate(self.parts)] if self.parts else [np.zeros(0, np.int32)]
        return self.parts[0]

    def equals(self, value: str) -> Mask:
        """Tell which rows have a value."""
        return self.codes == self.values.get(value, -1)

    def contains(self, text: str) -> Mask:
        """Tell which rows hold `text`, in whatever case."""
        return np.array([text in name.casefold() for name in self.values], bool)[self.codes]


class Index:
    """The rows that can be shown, in the order of the source.

    Args:
        columns: the names of the columns of text. `group` and `corruption` are always there: rows of one group and
            step show one screen, those of one group and corruption are a trajectory, step by step.
    """

    def __init__(self, columns: Sequence[str]) -> None:
        self.columns = {name: Column() for name in ("group", "corruption", "instruction", *columns)}
        self.ids: list[str] = []
        self._rows: list[Sequence[int]] = []
        self._steps: list[Sequence[int]] = []

    def extend(
        self, rows: Sequence[int], ids: Sequence[str], steps: Sequence[int], columns: Mapping[str, Sequence[str]]
    ) -> None:
        """Add rows: their numbers (rising), ids, steps, and the columns; a column that is left out is empty."""
        self._rows.append(rows)
        self._steps.append(steps)
        self.ids.extend(ids)
        for name, column in self.columns.items():
            column.extend(columns.get(name, [""] * len(rows)))

    def finish(self) -> None:
        """Make the arrays, after the last `extend`."""
        self.rows: Rows = np.array([row for part in self._rows for row in part], np.int64)
        self.steps: Rows = np.array([step for part in self._steps for step in part], np.int64)
        self._names = {name: list(column.values) for name, column in self.columns.items()}

    def __len__(self) -> int:
        return len(self.ids)

    def at(self, row: int) -> int | None:
        """Return the place of a row in the index, or `None`."""
        place = int(np.searchsorted(self.rows, row))
        return place if place < len(self) and self.rows[place] == row else None

    def value(self, name: str, place: int) -> str:
        """Return the value of a column."""
        return self._names[name][self.columns[name].codes[place]]

    def select(self, filters: Mapping[str, str], text: str) -> Rows:
        """Return the places of the rows that match. Raises `UnknownNameError` for a column that does not exist."""
        return np.flatnonzero(self._both(self._masks(filters, text)))

    def counts(self, filters: Mapping[str, str], text: str, names: Iterable[str]) -> dict[str, dict[str, int]]:
        """Return, for each column, its values with the number of rows that match all *other* filters."""
        masks = self._masks(filters, text)
        found: dict[str, dict[str, int]] = {}
        for name in names:
            others = self._both({key: mask for key, mask in masks.items() if key != name})
            column = self.columns[name]
            numbers = np.bincount(column.codes[others], minlength=len(column.values)).tolist()
            found[name] = dict(zip(column.values, numbers, strict=True))
        return found

    def trajectory(self, place: int) -> Rows:
        """Return the places of the steps of the same trajectory under the same corruption, in order."""
        found = self._alike(place, "group", "corruption")
        return found[np.argsort(self.steps[found], kind="stable")]

    def same_step(self, place: int) -> Rows:
        """Return the places of all rows of the same step: clean, and under each corruption."""
        found = self._alike(place, "group")
        return found[self.steps[found] == self.steps[place]]

    def _alike(self, place: int, *names: str) -> Rows:
        codes = (self.columns[name].codes for name in names)
        return np.flatnonzero(np.logical_and.reduce([code == code[place] for code in codes]))

    def _masks(self, filters: Mapping[str, str], text: str) -> dict[str, Mask]:
        unknown = next((name for name in filters if name not in self.columns), None)
        if unknown is not None:
            raise UnknownNameError(f"no filter {unknown!r}{suggest(unknown, self.columns)}")
        masks: dict[str, Mask] = {name: self.columns[name].equals(value) for name, value in filters.items()}
        wanted = text.strip().casefold()
        if wanted:
            ids: Any = np.fromiter((wanted in name.casefold() for name in self.ids), bool, len(self))
            masks["\0text"] = ids | self.columns["instruction"].contains(wanted)
        return masks

    def _both(self, masks: Mapping[str, Mask]) -> Mask:
        return np.logical_and.reduce(list(masks.values())) if masks else np.ones(len(self), bool)
