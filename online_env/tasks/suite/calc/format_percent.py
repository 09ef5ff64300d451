"""Show the numbers of a column as percentages."""

import re
from dataclasses import replace

from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.office import save
from online_env.tasks.kit.sheets import SheetTask, book, changes, go_to
from online_env.tasks.kit.word_lists import CITIES, sample


class FormatPercent(SheetTask):
    """The format of the column changes, and not its numbers."""

    name = "format_percent"
    domain = "calc"
    apps = ("libreoffice_calc",)
    phrasings = (
        "In the open workbook, show the numbers of the column {column} as percentages, so that 0.25"
        " appears as 25 % or 25.00 %. Save the workbook.",
        "Format {column} as percent. The values themselves must not change. Save.",
        "Please give the cells below {column} in {file} a percent format (whatever number of"
        " decimals) and save the file as xlsx.",
    )

    def draw(self, stream):
        column = stream.choice(("Share", "Turnout", "Growth", "Discount"))
        rows = [
            (city, stream.integer(1200, 98_000), stream.integer(10, 999) / 1000)
            for city in sample(stream, CITIES, stream.integer(6, 10))
        ]
        file = f"cities-{stream.integer(2010, 2025)}.xlsx"
        return {"file": file, "path": f"Documents/{file}", "column": column, "rows": rows}

    def initial_document(self):
        return book({"Cities": [("City", "Voters", self.values.column), *self.values.rows]})

    def cells(self):
        """Return the addresses of the numbers."""
        return [f"C{number}" for number in range(2, len(self.values.rows) + 2)]

    def judge(self, after, before):
        cells = dict(before.cells)
        for address in self.cells():
            cell = (before.sheets[0], address)
            number_format = after.cells.get(cell, before.cells[cell]).number_format
            cells[cell] = replace(cells[cell], number_format=number_format)
            if "%" not in re.sub(
                r'"[^"]*"|\\.', "", number_format
            ):  # a quoted sign is only a letter
                yield f"{address} has the format {number_format}"
        yield from changes(after, replace(before, cells=cells))

    def oracle(self, hand):
        cells = self.cells()
        go_to(hand, f"{cells[0]}:{cells[-1]}")
        hand.press("ctrl", "shift", "5")
        save(hand)

    def plan(self):
        cells = self.cells()
        return [
            plan_steps.CALC,
            *plan_steps.go_to_cell(f"{cells[0]}:{cells[-1]}"),
            "press ctrl+shift+5",
            *plan_steps.SAVE_XLSX,
        ]

    def wrong_results(self):
        cells = self.cells()
        texts = {f"C{n}": f"{row[2]:.1%}" for n, row in enumerate(self.values.rows, 2)}
        hundredfold = {f"C{n}": row[2] * 100 for n, row in enumerate(self.values.rows, 2)}
        return {
            "texts": self.put(texts),
            "a hundred times as much": self.put(hundredfold),
            "a sign behind the old number": self.with_format(cells, '0.00"%"'),
            "one is missing": self.with_format(cells[:-1]),
            "the voters as well": self.with_format([*cells, "B2"]),
        }

    def right_result(self, machine):
        self.with_format(["C1", *self.cells()], "0%")(machine)  # the whole column is as good

    def with_format(self, addresses, look="0.0%"):
        """Return what gives cells a format."""

        def change(workbook):
            for address in addresses:
                workbook.active[address].number_format = look

        return self.edit_document(change)
