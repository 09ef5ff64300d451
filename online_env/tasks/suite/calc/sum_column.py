"""Put the total of a column into a cell."""

from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.office import save
from online_env.tasks.kit.sheets import SheetTask, book, changes, enter, is_number
from online_env.tasks.kit.word_lists import FIRST_NAMES, sample

PURPOSES = ("train", "hotel", "lunch", "taxi", "books", "postage", "tickets", "printing")


class SumColumn(SheetTask):
    """A list of expenses gets its total, as a formula or a number; all else stays."""

    name = "sum_column"
    domain = "calc"
    apps = ("libreoffice_calc",)
    phrasings = (
        "The workbook {file} is open. Put the total of the column {column} into the cell {cell}"
        " and save the workbook in its own format.",
        "What did all this cost? Add up the {column} column, enter the sum in {cell}, save.",
        "Could you please enter the sum of all values under {column} in cell {cell} of {file},"
        " and save the file? Keep it an xlsx file.",
    )

    def draw(self, stream):
        file = f"expenses-{stream.choice(('spring', 'autumn', 'trip', 'office'))}.xlsx"
        people = sample(stream, FIRST_NAMES, 4)
        column = stream.choice(("Amount", "Euros", "Cost"))
        rows = []
        for number in range(1, stream.integer(12, 24)):
            cents = stream.integer(150, 40_000)
            rows.append((number, stream.choice(people), stream.choice(PURPOSES), cents / 100))
        last = len(rows) + 1
        return {
            "file": file,
            "path": f"Documents/{file}",
            "rows": rows,
            "column": column,
            "cell": stream.choice((f"D{last + 1}", f"D{last + 2}", "F1", "F2", "G3")),
            "formula": f"=SUM(D2:D{last})",
            "total": round(sum(row[3] for row in rows), 2),
        }

    def made(self):
        return book(
            {"Expenses": [("Nr", "Person", "Purpose", self.values.column), *self.values.rows]}
        )

    def judge(self, now, before):
        yield from changes(now, before, {self.values.cell})
        found = now.value(self.values.cell)
        if not is_number(found, self.values.total):
            yield f"{self.values.cell} is {found!r}, not {self.values.total}"

    def oracle(self, hand):
        enter(hand, self.values.cell, self.values.formula)
        save(hand)

    def plan(self):
        return [
            plan_steps.CALC,
            *plan_steps.enter_in_cell(self.values.cell, self.values.formula),
            *plan_steps.SAVE_XLSX,
        ]

    def wrong_results(self):
        cell, total = self.values.cell, self.values.total
        return {
            "a row is missing": self.put({cell: round(total - self.values.rows[-1][3], 2)}),
            "in another cell": self.put({"H9": total}),
            "as text": self.put({cell: f"{total} Euros"}),
            "the list changed, too": self.put({cell: total, "B2": "Nobody"}),
        }

    def right_result(self, machine):
        self.put({self.values.cell: self.values.total})(machine)
