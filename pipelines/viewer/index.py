"""An in-memory index of the columns that filters, counts and searches need.

A row takes about twenty bytes plus its id.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from hijack_data.errors import UnknownNameError, suggest

RowNumbers: TypeAlias = npt.NDArray[np.int64]
Codes: TypeAlias = npt.NDArray[np.int32]
Mask: TypeAlias = npt.NDArray[np.bool_]
# The name of the mask of the text search; no column has this name.
_TEXT = "\0text"


@dataclass
class Column:
    """A column of repeating text: int32 codes `[N]`, and the values that they stand for."""

    values: dict[str, int] = field(default_factory=dict[str, int])
    parts: list[Codes] = field(default_factory=list[Codes])

    def extend(self, values: Iterable[str]) -> None:
        """Add the values of more rows."""
        codes_by_value = self.values
        codes = [codes_by_value.setdefault(value, len(codes_by_value)) for value in values]
        self.parts.append(np.array(codes, np.int32))

    @property
    def codes(self) -> Codes:
        """The codes of all rows, int32 `[N]`."""
        if not self.parts:
            self.parts = [np.zeros(0, np.int32)]
        if len(self.parts) > 1:
            self.parts = [np.concatenate(self.parts)]
        return self.parts[0]

    def equals(self, value: str) -> Mask:
        """Return which rows have a value, bool `[N]`."""
        return self.codes == self.values.get(value, -1)

    def contains(self, text: str) -> Mask:
        """Return which rows contain `text` in any case, bool `[N]`; `text` is case-folded."""
        matches = [text in name.casefold() for name in self.values]
        return np.array(matches, bool)[self.codes]


class Index:
    """The rows that can be shown, in the order of the source.

    Rows of one group and step show one screen; those of one group and corruption are a trajectory.

    Args:
        columns: the names of the columns of text. `group`, `corruption` and `instruction` always
            exist.
    """

    def __init__(self, columns: Sequence[str]) -> None:
        names = ("group", "corruption", "instruction", *columns)
        self.columns = {name: Column() for name in names}
        self.ids: list[str] = []
        self._rows: list[Sequence[int]] = []
        self._steps: list[Sequence[int]] = []

    def extend(
        self,
        rows: Sequence[int],
        ids: Sequence[str],
        steps: Sequence[int],
        columns: Mapping[str, Sequence[str]],
    ) -> None:
        """Add rows.

        Args:
            rows: their numbers, rising.
            ids: their ids.
            steps: the numbers of their steps.
            columns: their text by column; a column that is left out is empty.
        """
        self._rows.append(rows)
        self._steps.append(steps)
        self.ids.extend(ids)
        empty = [""] * len(rows)
        for name, column in self.columns.items():
            column.extend(columns.get(name, empty))

    def finish(self) -> None:
        """Make the arrays, after the last `extend`."""
        self.rows: RowNumbers = np.array(list(chain.from_iterable(self._rows)), np.int64)
        self.steps: RowNumbers = np.array(list(chain.from_iterable(self._steps)), np.int64)
        self._names = {name: list(column.values) for name, column in self.columns.items()}

    def __len__(self) -> int:
        return len(self.ids)

    def at(self, row: int) -> int | None:
        """Return the position of a row in the index, or `None`."""
        position = int(np.searchsorted(self.rows, row))
        if position == len(self) or self.rows[position] != row:
            return None
        return position

    def value(self, name: str, position: int) -> str:
        """Return the value of a column."""
        code = self.columns[name].codes[position]
        return self._names[name][code]

    def select(self, filters: Mapping[str, str], text: str) -> RowNumbers:
        """Return the positions of the rows that match, int64 `[M]`.

        Raises:
            UnknownNameError: a filter names an unknown column.
        """
        masks = self._masks(filters, text)
        return np.flatnonzero(self._all_masks(masks))

    def counts(
        self, filters: Mapping[str, str], text: str, names: Iterable[str]
    ) -> dict[str, dict[str, int]]:
        """Return, for each column, its values with the number of rows that match the other filters.

        Args:
            filters: the wanted value by column.
            text: the text that ids or instructions must contain.
            names: the columns to count.
        """
        masks = self._masks(filters, text)
        counts: dict[str, dict[str, int]] = {}
        for name in names:
            matches = self._all_masks({key: mask for key, mask in masks.items() if key != name})
            column = self.columns[name]
            numbers = np.bincount(column.codes[matches], minlength=len(column.values))
            counts[name] = dict(zip(column.values, numbers.tolist(), strict=True))
        return counts

    def trajectory(self, position: int) -> RowNumbers:
        """Return the positions of the same trajectory under the same corruption, in order."""
        positions = self._positions_like(position, "group", "corruption")
        order = np.argsort(self.steps[positions], kind="stable")
        return positions[order]

    def same_step(self, position: int) -> RowNumbers:
        """Return the positions of all rows of the same step: clean, and under each corruption."""
        positions = self._positions_like(position, "group")
        return positions[self.steps[positions] == self.steps[position]]

    def _positions_like(self, position: int, *names: str) -> RowNumbers:
        """Return the positions of the rows that share the values of some columns."""
        mask = np.ones(len(self), bool)
        for name in names:
            codes = self.columns[name].codes
            mask &= codes == codes[position]
        return np.flatnonzero(mask)

    def _masks(self, filters: Mapping[str, str], text: str) -> dict[str, Mask]:
        masks: dict[str, Mask] = {}
        for name, value in filters.items():
            if name not in self.columns:
                raise UnknownNameError(f"no filter {name!r}{suggest(name, self.columns)}")
            masks[name] = self.columns[name].equals(value)
        query = text.strip().casefold()
        if query:
            in_id = (query in name.casefold() for name in self.ids)
            ids = np.fromiter(in_id, bool, len(self))
            masks[_TEXT] = ids | self.columns["instruction"].contains(query)
        return masks

    def _all_masks(self, masks: Mapping[str, Mask]) -> Mask:
        """Return which rows are in all masks, bool `[N]`."""
        mask_of_all = np.ones(len(self), bool)
        for mask in masks.values():
            mask_of_all &= mask
        return mask_of_all
