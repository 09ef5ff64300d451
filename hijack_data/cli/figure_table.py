"""Tables of figures for a terminal: what a narrow screen has no room for follows in a table below.

`rich` would cut cells short, and a figure without its last digits is another figure.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from rich.cells import cell_len
from rich.markup import escape
from rich.table import Table

_GAP = 2  # columns of the screen between two columns of a table
_INDENT = "  "


class FigureTable:
    """A table with a column of labels and columns of figures, as a `rich` renderable.

    Columns in which no row has a figure are left out.

    Args:
        label: the heading of the labels.
        blocks: the headings of the figures. Several in one block stay in one table, side by side.
        rows: a label and its figures, as texts; or a label alone, which is a heading of its own.
        title: what stands above the table; none if None.
    """

    def __init__(
        self,
        label: str,
        blocks: Iterable[str | Sequence[str]],
        rows: Iterable[Sequence[str]],
        title: str | None = None,
    ) -> None:
        self._headings = [label]
        self._blocks: list[list[int]] = []  # places in a row
        for block in blocks:
            first = len(self._headings)
            self._headings += [block] if isinstance(block, str) else block
            self._blocks.append(list(range(first, len(self._headings))))
        self._rows = [
            [row[column] if column < len(row) else "" for column in range(len(self._headings))]
            for row in rows
        ]
        self._title = title

    def __rich_console__(self, console: Any, options: Any) -> Iterator[Any]:
        """Yield as many tables as the width of the screen asks for."""
        if self._title is not None:
            yield escape(self._title)
        lines = [self._headings, *self._rows]
        widths = [max(map(cell_len, column)) for column in zip(*lines, strict=True)]
        widths[0] = min(widths[0], options.max_width // 2)
        for number, columns in enumerate(self._parts(widths, options.max_width)):
            if number:
                yield ""
            yield self._part(widths[0], columns)

    def _parts(self, widths: Sequence[int], room: int) -> list[list[int]]:
        """Return the places of the columns in each of the tables."""
        parts: list[list[int]] = [[]]
        width = widths[0]
        for block in self._blocks:
            columns = [column for column in block if self._has_figures(column)]
            block_width = sum(_GAP + widths[column] for column in columns)
            if parts[-1] and width + block_width > room:
                parts.append([])
                width = widths[0]
            parts[-1] += columns
            width += block_width
        return parts

    def _has_figures(self, column: int) -> bool:
        return not self._rows or any(row[column] for row in self._rows)

    def _part(self, label_width: int, columns: Sequence[int]) -> Table:
        table = Table(box=None, header_style="bold", pad_edge=False, padding=(0, _GAP, 0, 0))
        table.add_column(escape(self._headings[0]), overflow="fold", width=label_width)
        for column in columns:
            table.add_column(escape(self._headings[column]), justify="right", overflow="fold")
        for row in self._rows:
            table.add_row(*(escape(row[column]) for column in (0, *columns)))
        return table


def grouped(rows: Iterable[Sequence[str]]) -> Iterator[Sequence[str]]:
    """Yield rows without their first column, each new value of which is a row of its own before.

    So the names of agents, which may be long, need no column.
    """
    above: str | None = None
    for name, label, *figures in rows:
        if name != above:
            yield (name,)
            above = name
        yield (_INDENT + label, *figures)
