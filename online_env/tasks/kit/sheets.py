"""Workbooks of Calc: made, read and compared on our side, and worked with by the keyboard."""

import io
import zipfile
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any, TypeAlias
from xml.etree import ElementTree

from ..base import Outcome
from ..hand import Hand
from ..tree_nodes import TreeNode
from .office import APP, OfficeTask

CellValue: TypeAlias = str | int | float | bool | None
_MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
_EXACT = 1e-6  # numbers are stored with 15 digits


@dataclass(frozen=True, kw_only=True)
class SheetCell:
    """What a cell holds.

    Args:
        entry: What was entered: a value, or a formula that begins with `=`.
        value: The value that is stored of it; `None` for a formula that was never computed.
        number_format: How a number is shown, such as `0.00%`.
        marks: Whether it is `bold`, `italic`, `underlined`, `struck` or `filled`.
    """

    entry: CellValue
    value: CellValue
    number_format: str = "General"
    marks: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class BookContent:
    """What a workbook holds.

    Args:
        cells: By the name of the sheet and the address of the cell; empty cells are left out.
        sheets: The names of the sheets, in order.
        frozen: By sheet, the first cell that scrolls, such as `A2`; `None` if all do. A range, if
            what does not scroll does not begin with the first row or column.
        hidden: The rows and columns that do not show, by sheet, and `all` of a hidden sheet.
        merged: The ranges that became one cell, by sheet.
    """

    cells: Mapping[tuple[str, str], SheetCell]
    sheets: tuple[str, ...]
    frozen: Mapping[str, str | None]
    hidden: Mapping[str, tuple[str, ...]]
    merged: Mapping[str, tuple[str, ...]]

    def value(self, address: str, sheet: str = "") -> CellValue:
        """Return the stored value of a cell, of the first sheet by default."""
        cell = self.cells.get((sheet or self.sheets[0], address))
        return None if cell is None else cell.value

    def entry(self, address: str, sheet: str = "") -> CellValue:
        """Return what was entered in a cell, of the first sheet by default."""
        cell = self.cells.get((sheet or self.sheets[0], address))
        return None if cell is None else cell.entry

    def values(self, sheet: str) -> dict[str, CellValue]:
        """Return the stored values of a sheet by address; empty cells are left out."""
        return {address: cell.value for (of, address), cell in self.cells.items() if of == sheet}


class SheetTask(OfficeTask):
    """A task on one workbook, which is open in Calc at the start."""

    library = "openpyxl"

    def load(self, data: bytes) -> Any:
        """Return a workbook of openpyxl."""
        import openpyxl

        return openpyxl.load_workbook(io.BytesIO(data))

    def content(self, data: bytes) -> BookContent:
        """Return what a workbook holds."""
        return read_book(data)

    def put(self, cells: Mapping[str, CellValue]) -> Outcome:
        """Return what enters values and formulas in the first sheet, behind the screen.

        Args:
            cells: The entries by address.
        """

        def change(workbook: Any) -> None:
            for address, entry in cells.items():
                workbook.worksheets[0][address] = entry

        return self.edit_document(change)


def book(sheets: Mapping[str, Sequence[Sequence[CellValue]]]) -> Any:
    """Return a workbook with a bold header in each sheet.

    Args:
        sheets: The rows of each sheet, the header first, by the sheet's name.
    """
    import openpyxl
    from openpyxl.styles import Font
    from openpyxl.utils import get_column_letter

    workbook = openpyxl.Workbook()
    workbook.remove(workbook.worksheets[0])
    for name, rows in sheets.items():
        sheet = workbook.create_sheet(name)
        for row in rows:
            sheet.append(list(row))
        for cell in sheet[1]:
            cell.font = Font(bold=True)
        for index, column in enumerate(zip_longest(*rows, fillvalue=""), 1):
            width = max(len(str(value)) for value in column) + 3
            sheet.column_dimensions[get_column_letter(index)].width = max(width, 9)
    return workbook


def read_book(data: bytes) -> BookContent:
    """Return what a workbook holds.

    Raises:
        KeyError: It is a zip file of another kind.
        ValueError: It cannot be read.
    """
    import openpyxl

    entered: Any = openpyxl.load_workbook(io.BytesIO(data))
    stored: Any = openpyxl.load_workbook(io.BytesIO(data), data_only=True)
    cells: dict[tuple[str, str], SheetCell] = {}
    for sheet in entered.worksheets:
        shared = _array_formulas(sheet)
        # Rows would be made of all cells up to the last one, which may be XFD1048576.
        for cell in sheet._cells.values():
            if cell.value is not None:
                cells[sheet.title, cell.coordinate] = SheetCell(
                    entry=shared.get(cell.coordinate, cell.value),
                    value=stored[sheet.title][cell.coordinate].value,
                    number_format=cell.number_format,
                    marks=_marks(cell),
                )
    return BookContent(
        cells=cells,
        sheets=tuple(entered.sheetnames),
        frozen={sheet.title: _frozen(sheet) for sheet in entered.worksheets},
        hidden={sheet.title: _hidden(sheet) for sheet in entered.worksheets},
        merged={
            sheet.title: tuple(sorted(map(str, sheet.merged_cells.ranges)))
            for sheet in entered.worksheets
        },
    )


def changes(
    after: BookContent, before: BookContent, but: Collection[str] = (), *, frozen: bool = False
) -> Iterator[str]:
    """Yield the cells and sheets that differ, except for some.

    Args:
        after: The workbook as it is.
        before: The workbook as it was made.
        but: Addresses of cells of the first sheet of `before`, or `sheet!address`, that may differ,
            and names of sheets that may be there, at any place, or differ.
        frozen: Whether rows may be frozen.
    """
    sheet_names = tuple(name for name in after.sheets if name not in but)
    expected_names = tuple(name for name in before.sheets if name not in but)
    if sheet_names != expected_names:
        yield f"the sheets are {', '.join(after.sheets)}"
    if sheet_names[:1] != expected_names[:1]:
        return
    for address in sorted({*after.cells, *before.cells}):
        if not _is_excepted(address, before.sheets[0], but):
            yield from _difference(address, after.cells.get(address), before.cells.get(address))
    for name in (name for name in before.sheets if name in after.sheets and name not in but):
        if after.hidden.get(name) != before.hidden[name]:
            yield f"hidden in {name}: {after.hidden.get(name)}, not {before.hidden[name]}"
        if after.merged.get(name) != before.merged[name]:
            yield f"cells of {name} were merged or taken apart"
        if not frozen and after.frozen.get(name) != before.frozen[name]:
            yield f"rows or columns of {name} are frozen"


def is_number(actual: CellValue, expected: float) -> bool:
    """Return whether a stored value is a number, and the one that is wanted."""
    if isinstance(actual, bool) or not isinstance(actual, (int, float)):
        return False
    return abs(actual - expected) <= _EXACT * max(1.0, abs(expected))


def uses(entry: CellValue, *addresses: str) -> bool:
    """Return whether an entry is a formula that takes all of these cells, alone or in ranges.

    A name in a formula may stand for any of them.
    """
    from openpyxl.formula import Tokenizer
    from openpyxl.formula.tokenizer import Token

    if not isinstance(entry, str) or not entry.startswith("="):
        return False
    tokens = Tokenizer(entry).items
    references = [token.value for token in tokens if token.subtype == Token.RANGE]
    return all(any(_holds(reference, address) for reference in references) for address in addresses)


def with_values(data: bytes, values: Mapping[str, float]) -> bytes:
    """Return a workbook whose first sheet has values stored beside its formulas.

    openpyxl stores formulas alone.

    Args:
        data: The file.
        values: The values, by the addresses of the formulas.
    """
    result = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(data)) as source,
        zipfile.ZipFile(result, "w", zipfile.ZIP_DEFLATED) as target,
    ):
        for name in source.namelist():
            part = source.read(name)
            if name == "xl/worksheets/sheet1.xml":
                part = _with_cached_values(part, values)
            target.writestr(name, part)
    return result.getvalue()


def go_to(hand: Hand, address: str) -> None:
    """Select a cell or a range of the open sheet by the name box."""
    hand.press("ctrl", "shift", "t")
    hand.find("text", app=APP, state="focused")
    hand.replace(f"{address}\n")
    hand.find("table", app=APP, state="focused")


def enter(hand: Hand, address: str, text: str) -> None:
    """Enter a value or a formula in a cell of the open sheet."""
    go_to(hand, address)
    hand.type(f"{text}\n")


def show_sheet(hand: Hand, name: str) -> None:
    """Open a sheet by its tab."""
    hand.click_on("page-tab", name, app=APP)
    hand.find("table", f"Sheet {name}", app=APP)


def visible_cells(hand: Hand) -> dict[str, str]:
    """Wait for cells that hold something, and return their texts by address.

    Empty cells, and cells out of sight, are left out.

    Raises:
        DesktopTimeoutError: No cell in sight holds anything.
    """
    hand.wait("a cell with a text", lambda node: _is_filled(node, node.name))
    cells = [node for node in hand.look() if node.role == "table-cell" and APP in node.app]
    return {node.name: node.text for node in cells if node.box and node.text}


def read_cells(hand: Hand, addresses: Sequence[str]) -> list[str]:
    """Wait until cells in sight hold something, and return their texts.

    Raises:
        DesktopTimeoutError: One of them is empty, or not in sight.
    """
    for address in (addresses[-1], addresses[0]):
        hand.wait(f"cell {address}", lambda node, name=address: _is_filled(node, name))
    cells = visible_cells(hand)
    return [cells.get(address, "") for address in addresses]


def _is_filled(node: TreeNode, address: str) -> bool:
    return node.role == "table-cell" and node.name == address and bool(node.box and node.text)


def _holds(reference: str, address: str) -> bool:
    """Return whether a range of a formula holds a cell; a name, which is none, may."""
    from openpyxl.utils import cell

    try:
        left, top, right, bottom = cell.range_boundaries(reference.rpartition("!")[2])
    except ValueError:
        return True
    row, column = cell.coordinate_to_tuple(address)
    return (left or 1) <= column <= (right or column) and (top or 1) <= row <= (bottom or row)


def _array_formulas(sheet: Any) -> dict[str, str]:
    """Return the formulas that were entered for several cells at once, by each of the cells."""
    from openpyxl.utils.cell import range_boundaries

    formulas: dict[str, str] = {}
    for address, area in sheet.array_formulae.items():
        text = formulas[address] = sheet[address].value.text
        if ":" not in area:
            continue
        bounds: Any = range_boundaries(area)
        left, top, right, bottom = bounds
        for (row, column), cell in sheet._cells.items():  # the area may be a whole column
            if top <= row <= bottom and left <= column <= right:
                formulas[cell.coordinate] = text
    return formulas


def _marks(cell: Any) -> tuple[str, ...]:
    font = cell.font
    marks = {
        "bold": font.b,
        "italic": font.i,
        "underlined": font.u not in (None, "none"),
        "struck": font.strike,
        "filled": cell.fill.fill_type is not None,
    }
    return tuple(name for name, is_set in marks.items() if is_set)


def _frozen(sheet: Any) -> str | None:
    """Return the first cell that scrolls.

    openpyxl's `freeze_panes` is the cell to which it was scrolled, and also that of a split view.
    """
    from openpyxl.utils import cell, get_column_letter

    pane = sheet.sheet_view.pane
    if pane is None or pane.state not in ("frozen", "frozenSplit"):
        return None
    rows, columns = int(pane.ySplit or 0), int(pane.xSplit or 0)
    cell_address = f"{get_column_letter(columns + 1)}{rows + 1}"
    start = sheet.sheet_view.topLeftCell or "A1"
    row, column = cell.coordinate_to_tuple(start)
    is_from_first = (not rows or row == 1) and (not columns or column == 1)
    return cell_address if is_from_first else f"{start}:{cell_address}"


def _hidden(sheet: Any) -> tuple[str, ...]:
    lines = {**sheet.row_dimensions, **sheet.column_dimensions}
    hidden = sorted(str(line) for line, look in lines.items() if look.hidden)
    return (*hidden, *(["all"] if sheet.sheet_state != "visible" else ()))


def _is_excepted(cell: tuple[str, str], first: str, but: Collection[str]) -> bool:
    sheet, address = cell
    if sheet in but or f"{sheet}!{address}" in but:
        return True
    return sheet == first and address in but


def _difference(
    cell: tuple[str, str], after: SheetCell | None, before: SheetCell | None
) -> Iterator[str]:
    location = f"{cell[1]} of {cell[0]}"
    actual = None if after is None else after.entry
    expected = None if before is None else before.entry
    if not _same(actual, expected):
        yield f"{location} is {actual!r}, not {expected!r}"
        return
    if after is None or before is None:
        return
    is_same_format = after.number_format == before.number_format or _is_text(actual)
    if not is_same_format or after.marks != before.marks:
        yield f"{location} looks otherwise than before"


def _is_text(entry: CellValue) -> bool:
    """Return whether an entry is a text, of which the format of numbers changes nothing."""
    return isinstance(entry, str) and not entry.startswith("=")


def _same(actual: CellValue, expected: CellValue) -> bool:
    if isinstance(expected, (int, float)) and not isinstance(expected, bool):
        return is_number(actual, expected)
    return actual == expected


def _with_cached_values(part: bytes, values: Mapping[str, float]) -> bytes:
    """Return the XML of a sheet with values beside its formulas."""
    ElementTree.register_namespace("", _MAIN)
    root = ElementTree.fromstring(part)
    for cell in root.iter(f"{{{_MAIN}}}c"):
        value = values.get(cell.get("r", ""))
        value_element = cell.find(f"{{{_MAIN}}}v")
        if value is not None and value_element is not None:
            value_element.text = repr(value)
    return ElementTree.tostring(root)
