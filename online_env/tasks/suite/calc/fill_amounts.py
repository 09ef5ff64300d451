"""Fill a column with a formula."""

from online_env.tasks.kit.office import dump, save
from online_env.tasks.kit.sheets import (
    SheetTask,
    book,
    changes,
    go_to,
    is_number,
    uses,
    with_values,
)
from online_env.tasks.kit.word_lists import GOODS, sample
from online_env.tasks.plan_words import quoted


class FillAmounts(SheetTask):
    """The header of the column is there; each row below it gets its own formula."""

    name = "fill_amounts"
    domain = "calc"
    apps = ("libreoffice_calc",)
    phrasings = (
        "In the open workbook, fill the column {column} with formulas: {left} times {right}, for"
        " each article. Save the workbook.",
        "{column} = {left} × {right}, as a formula in each row that has an article. Save as xlsx.",
        "Please let the workbook calculate the {column} of every row from its {left} and its"
        " {right} (with formulas, so that they follow later changes), and save it.",
    )

    def draw(self, stream):
        left, right, column = stream.choice(
            (("Pieces", "Price", "Amount"), ("Hours", "Wage", "Pay"), ("Days", "Rent", "Costs"))
        )
        rows = [
            (article, stream.integer(2, 60), stream.integer(105, 4900) / 100)
            for article in sample(stream, GOODS, stream.integer(6, 10))
        ]
        path = f"Documents/{column.lower()}-{stream.integer(100, 999)}.xlsx"
        return {"path": path, "left": left, "right": right, "column": column, "rows": rows}

    def made(self):
        header = ("Article", self.values.left, self.values.right, self.values.column)
        return book({"Sheet1": [header, *self.values.rows]})

    def amounts(self):
        """Return the values by address."""
        return {f"D{n}": row[1] * row[2] for n, row in enumerate(self.values.rows, 2)}

    def judge(self, now, before):
        amounts = self.amounts()
        yield from changes(now, before, set(amounts))
        for address, amount in amounts.items():
            if not is_number(now.value(address), amount):
                yield f"{address} is {now.value(address)!r}, not {amount:.2f}"
            if not uses(now.entry(address), f"B{address[1:]}", f"C{address[1:]}"):
                yield f"{address} holds no formula with columns B and C of its row"

    def oracle(self, hand):
        go_to(hand, f"D2:D{len(self.values.rows) + 1}")
        hand.type("=B2*C2")
        hand.press("alt", "enter")  # into all cells that are selected
        save(hand)

    def plan(self):
        return [
            'window "LibreOffice Calc"',
            "press ctrl+shift+t",
            f"type {quoted(f'D2:D{len(self.values.rows) + 1}')}",
            "press enter",
            'type "=B2*C2"',
            "press alt+enter",
            "press ctrl+s",
            'click "Use Excel 2007-365"',
            "wait",
        ]

    def wrong_results(self):
        amounts = self.amounts()
        last = f"D{len(self.values.rows) + 1}"
        return {
            "numbers": self.put(amounts),
            "the last row is missing": self.filled({last: None}),
            "a sum below it": self.filled({f"D{len(self.values.rows) + 2}": 1}),
            "typed numbers in formulas": self.filled(self.typed()),
            "the first row's formula in all": self.filled(dict.fromkeys(amounts, "=B2*C2")),
        }

    def right_result(self, machine):
        self.filled({})(machine)

    def typed(self):
        """Return formulas that take no cells."""
        return {f"D{n}": f"={row[1]}*{row[2]}" for n, row in enumerate(self.values.rows, 2)}

    def filled(self, but):
        """Return what enters the formulas with their values, except for some entries."""
        amounts = self.amounts()
        formulas = {f"D{n}": f"=C{n}*B{n}" for n in range(2, len(amounts) + 2)}

        def outcome(machine):
            found = self.load(machine.read(self.values.path))
            for address, entry in {**formulas, **but}.items():
                found.active[address] = entry
            first = amounts["D2"]
            values = {a: first if but.get(a) == "=B2*C2" else amounts[a] for a in amounts}
            machine.write(self.values.path, with_values(dump(found), values))

        return outcome
