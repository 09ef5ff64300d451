"""Delete the rows that have a word in a column."""

import re

from online_env.tasks.kit.office import dump, save
from online_env.tasks.kit.sheets import SheetTask, book, changes, go_to, read_book, visible_cells
from online_env.tasks.kit.word_lists import FIRST_NAMES, GOODS, LAST_NAMES, shuffle
from online_env.tasks.plan_words import quoted

HEADER = ("Order", "Customer", "Article", "State")
STATES = ("open", "paid", "sent", "cancelled", "returned")


class DeleteRows(SheetTask):
    """Some rows in the middle go, without gaps; the order of the others stays."""

    name = "delete_rows"
    domain = "calc"
    apps = ("libreoffice_calc",)
    phrasings = (
        'Delete all rows of the open workbook whose state is "{state}", so that no empty rows are'
        " left, and save it.",
        "The {state} orders can go: remove those rows from {file}, no gaps. Save as xlsx.",
        'Please take every order with the state "{state}" out of the list. The other rows move up'
        " and keep their order. Then save the workbook.",
    )

    def draw(self, stream):
        state = stream.choice(STATES)
        other_states = [name for name in STATES if name != state]
        states = [state] * stream.integer(2, 4)
        states += [stream.choice(other_states) for _ in range(stream.integer(8, 12))]
        rows = [
            (number, stream.choice(FIRST_NAMES) + " " + stream.choice(LAST_NAMES), *cells)
            for number, cells in enumerate(
                ((stream.choice(GOODS), state) for state in shuffle(stream, states)),
                stream.integer(100, 900),
            )
        ]
        file = f"orders-{stream.integer(1, 52)}.xlsx"
        return {"file": file, "path": f"Documents/{file}", "state": state, "rows": rows}

    def initial_document(self):
        return book({"Orders": [HEADER, *self.values.rows]})

    def judge(self, after, before):
        remaining_rows = [row for row in self.values.rows if row[3] != self.values.state]
        yield from changes(after, read_book(dump(book({"Orders": [HEADER, *remaining_rows]}))))

    def oracle(self, hand):
        for number in reversed(matching(hand, self.values.state)):
            go_to(hand, f"{number}:{number}")
            hand.press("ctrl", "-")
        save(hand)

    def plan(self):
        numbers = [n for n, row in enumerate(self.values.rows, 2) if row[3] == self.values.state]
        steps = ['window "LibreOffice Calc"']
        for number in reversed(numbers):
            steps += [
                "press ctrl+shift+t",
                f"type {quoted(f'{number}:{number}')}",
                "press enter",
                "press ctrl+-",
            ]
        return [*steps, "press ctrl+s", 'click "Use Excel 2007-365"', "wait"]

    def wrong_results(self):
        rows, state = self.values.rows, self.values.state
        numbers = [number for number, row in enumerate(rows, 2) if row[3] == state]
        other_row = next(number for number, row in enumerate(rows, 2) if row[3] != state)
        return {
            "one is left": self.without(numbers[1:]),
            "one too many": self.without(sorted([*numbers, other_row])),
            "hidden": self.edit_document(lambda workbook: hide(workbook, numbers)),
            "emptied": self.put({f"{c}{n}": None for c in "ABCD" for n in numbers}),
        }

    def right_result(self, machine):
        rows = enumerate(self.values.rows, 2)
        self.without([number for number, row in rows if row[3] == self.values.state])(machine)

    def without(self, numbers):
        """Return what deletes rows."""

        def change(workbook):
            for number in reversed(numbers):
                workbook.active.delete_rows(number)

        return self.edit_document(change)


def matching(hand, state):
    """Return the numbers of the rows in sight that have the state."""
    cells = visible_cells(hand)
    return sorted(int(a[1:]) for a in cells if re.fullmatch(r"D\d+", a) and cells[a] == state)


def hide(workbook, numbers):
    """Hide rows."""
    for number in numbers:
        workbook.active.row_dimensions[number].hidden = True
