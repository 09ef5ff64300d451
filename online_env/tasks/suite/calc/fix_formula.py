"""Find the one wrong formula of a column and put it right."""

from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.office import save
from online_env.tasks.kit.sheets import (
    SheetTask,
    book,
    changes,
    enter,
    is_number,
    uses,
    with_values,
)
from online_env.tasks.kit.word_lists import GOODS, sample


class FixFormula(SheetTask):
    """One row adds, or takes a number of another row, where it should multiply its own."""

    name = "fix_formula"
    domain = "calc"
    apps = ("libreoffice_calc",)
    phrasings = (
        "In the open workbook, the column Amount is the product of Pieces and Price. One formula of"
        " it is wrong. Correct that formula and save the workbook.",
        "One of the formulas under Amount in {file} is not pieces times price. Find it, fix it"
        " (a formula again, not a number), save.",
        "The amount of {item} cannot be right: its formula is not like the others of the column."
        " Please correct the formula and save the file as xlsx.",
    )

    def draw(self, stream):
        items = sample(stream, GOODS, stream.integer(7, 10))
        rows = [(i, stream.integer(3, 60), stream.integer(11, 4000) / 100) for i in items]
        wrong = stream.integer(3, len(rows))
        formulas = {
            "add": f"=B{wrong}+C{wrong}",
            "row above": f"=B{wrong}*C{wrong - 1}",
            "row below": f"=B{wrong + 1}*C{wrong}",
            "squared": f"=B{wrong}*B{wrong}",
        }
        file = f"order-{stream.integer(100, 999)}.xlsx"
        return {
            "file": file,
            "path": f"Documents/{file}",
            "rows": rows,
            "wrong": wrong,
            "cell": f"D{wrong}",
            "item": items[wrong - 2],
            "formula": formulas[stream.choice(list(formulas))],
        }

    def made(self):
        lines = [
            (item, pieces, price, f"=B{number}*C{number}")
            for number, (item, pieces, price) in enumerate(self.values.rows, 2)
        ]
        made = book({"Order": [("Item", "Pieces", "Price", "Amount"), *lines]})
        made.active[self.values.cell] = self.values.formula
        return made

    def judge(self, now, before):
        cell, number = self.values.cell, self.values.wrong
        yield from changes(now, before, {cell})
        if not uses(now.entry(cell), f"B{number}", f"C{number}"):
            yield f"{cell} holds {now.entry(cell)!r}, and no formula with its pieces and price"
        if now.entry(cell) == self.values.formula:
            yield f"{cell} still holds {self.values.formula}"
        _, pieces, price = self.values.rows[number - 2]
        if not is_number(now.value(cell), pieces * price):
            yield f"{cell} is {now.value(cell)!r}, not {pieces * price:.2f}"

    def oracle(self, hand):
        number = self.values.wrong
        enter(hand, self.values.cell, f"=B{number}*C{number}")
        save(hand)

    def plan(self):
        number = self.values.wrong
        return [
            plan_steps.CALC,
            *plan_steps.enter_in_cell(self.values.cell, f"=B{number}*C{number}"),
            *plan_steps.SAVE_XLSX,
        ]

    def wrong_results(self):
        number = self.values.wrong
        _, pieces, price = self.values.rows[number - 2]
        other = f"D{number - 1}"
        return {
            "a number": self.put({self.values.cell: pieces * price}),
            "another formula": self.put({other: f"=C{number - 1}*B{number - 1}"}),
            "the price changed": self.fixed({f"C{number}": price + 1}),
            "typed numbers in the formula": self.fixed({self.values.cell: f"={pieces}*{price}"}),
        }

    def right_result(self, machine):
        self.fixed({})(machine)

    def fixed(self, but):
        """Return what puts the formula right with its value, except for some entries."""
        number = self.values.wrong
        _, pieces, price = self.values.rows[number - 2]

        def outcome(machine):
            self.put({self.values.cell: f"=C{number}*B{number}", **but})(machine)
            data = machine.read(self.values.path)
            machine.write(self.values.path, with_values(data, {self.values.cell: pieces * price}))

        return outcome
