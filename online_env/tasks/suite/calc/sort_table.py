"""Sort the rows of a table by a column."""

from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.office import dump, menu, save
from online_env.tasks.kit.sheets import SheetTask, book, changes, go_to, read_book
from online_env.tasks.kit.word_lists import CITIES, GOODS, sample, shuffled
from online_env.tasks.plan_words import quoted

HEADER = ("Article", "Made in", "Pieces", "Price")
LETTERS = "ABCD"


class SortTable(SheetTask):
    """All columns of a row stay together, and the header stays at the top."""

    name = "sort_table"
    domain = "calc"
    apps = ("libreoffice_calc",)
    phrasings = (
        "Sort the stock list in the open workbook by {column}, {order}. The header stays in the"
        " first row. Save the workbook.",
        "I need the rows of the list by {column}, {order}. Sort and save, please.",
        "Please bring the rows below the header into order by the column {column} ({order}) and"
        " save the file under its name, as xlsx.",
    )

    def draw(self, stream):
        articles = sample(stream, GOODS, stream.integer(7, 10))
        pieces = sample(stream, range(5, 95), len(articles))
        prices = sample(stream, range(120, 9900, 10), len(articles))
        rows = [
            (article, stream.choice(CITIES), count, cents / 100)
            for article, count, cents in zip(articles, pieces, prices, strict=True)
        ]
        index = stream.choice((0, 2, 3))
        rising = bool(stream.integer(0, 1))
        low, high = ("A", "Z") if index == 0 else ("the smallest", "the largest")
        wanted = sorted(rows, key=lambda row: row[index], reverse=not rising)
        while rows in (wanted, wanted[::-1]):
            rows = shuffled(stream, rows)
        return {
            "path": f"Documents/stock-{stream.choice(CITIES)}.xlsx",
            "rows": rows,
            "wanted": wanted,
            "column": HEADER[index],
            "letter": LETTERS[index],
            "rising": rising,
            "order": f"from {low} to {high}" if rising else f"from {high} to {low}",
        }

    def made(self):
        return book({"Stock": [HEADER, *self.values.rows]})

    def judge(self, now, before):
        wanted = book({"Stock": [HEADER, *self.values.wanted]})
        yield from changes(now, read_book(dump(wanted)))

    def oracle(self, hand):
        go_to(hand, f"{self.values.letter}1")
        menu(hand, "Data", "Sort Ascending" if self.values.rising else "Sort Descending")
        save(hand)

    def plan(self):
        way = "Ascending" if self.values.rising else "Descending"
        return [
            plan_steps.CALC,
            *plan_steps.go_to_cell(f"{self.values.letter}1"),
            'click "Data" near "Tools"',
            f"click {quoted(f'Sort {way}')}",
            *plan_steps.SAVE_XLSX,
        ]

    def wrong_results(self):
        wanted, rows = self.values.wanted, self.values.rows
        index = HEADER.index(self.values.column)
        torn = [
            (*row[:index], other[index], *row[index + 1 :])
            for row, other in zip(rows, wanted, strict=True)
        ]
        return {
            "the other way round": self.fill(wanted[::-1]),
            "the column alone": self.fill(torn),
            "a row is missing": self.fill([*wanted[:-1], (None,) * 4]),
        }

    def right_result(self, machine):
        self.fill(self.values.wanted)(machine)

    def fill(self, rows):
        """Return what puts rows below the header."""
        cells = {
            f"{letter}{number}": value
            for number, row in enumerate(rows, 2)
            for letter, value in zip(LETTERS, row, strict=True)
        }
        return self.put(cells)
