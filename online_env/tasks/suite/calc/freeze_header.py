"""Keep the first row, or the first column as well, in sight while the rest scrolls."""

from dataclasses import replace

from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.office import menu, save
from online_env.tasks.kit.sheets import SheetTask, book, changes, go_to
from online_env.tasks.kit.word_lists import FIRST_NAMES, LAST_NAMES, MONTHS

PARTS = {"the first row": "A2", "the first column": "B1", "the first row and column": "B2"}


class FreezeHeader(SheetTask):
    """A table that is longer than the screen keeps its header, or its first column."""

    name = "freeze_header"
    domain = "calc"
    apps = ("libreoffice_calc",)
    phrasings = (
        "Freeze {part} of the open sheet, so that it stays in sight while one scrolls, and save.",
        "I lose track when I scroll through {file}. Freeze {part}, nothing else, and save as xlsx.",
        "Please make sure that {part} of this table can always be seen (freeze it), and save the"
        " workbook.",
    )

    def draw(self, stream):
        rows = [
            (
                f"{stream.choice(FIRST_NAMES)} {stream.choice(LAST_NAMES)}",
                *(stream.integer(0, 31) for _ in MONTHS),
            )
            for _ in range(stream.integer(45, 60))
        ]
        file = f"attendance-{stream.integer(2012, 2025)}.xlsx"
        part = stream.choice(list(PARTS))
        return {"file": file, "path": f"Documents/{file}", "rows": rows, "part": part}

    def initial_document(self):
        return book({"Days": [("Member", *MONTHS), *self.values.rows]})

    def judge(self, after, before):
        expected = PARTS[self.values.part]
        yield from changes(after, replace(before, frozen={"Days": expected}))

    def oracle(self, hand):
        go_to(hand, PARTS[self.values.part])
        if hand.see("toggle-button", "Freeze Rows and Columns", "soffice", "checked") is None:
            menu(hand, "View", "Freeze Rows and Columns")
        save(hand)

    def plan(self):
        return [
            plan_steps.CALC,
            *plan_steps.go_to_cell(PARTS[self.values.part]),
            'click "View"',
            'click "Freeze Rows and Columns"',
            *plan_steps.SAVE_XLSX,
        ]

    def wrong_results(self):
        expected = PARTS[self.values.part]
        other_places = [address for address in PARTS.values() if address != expected]
        return {
            "another part": self.with_frozen_pane(other_places[0]),
            "yet another part": self.with_frozen_pane(other_places[1]),
            "a row too many": self.with_frozen_pane("A3"),
            "split, not frozen": self.with_frozen_pane(expected, state="split"),
            "frozen further down": self.with_frozen_pane(expected, start="C9"),
        }

    def right_result(self, machine):
        self.with_frozen_pane(PARTS[self.values.part], scrolled="C30")(machine)

    def with_frozen_pane(self, address, state="frozen", start="A1", scrolled=""):
        """Return what freezes all above and left of a cell, where a view begins and scrolls to."""

        def change(workbook):
            view = workbook.active.sheet_view
            workbook.active.freeze_panes = address
            view.topLeftCell = start
            view.pane.state = state
            view.pane.topLeftCell = scrolled or address

        return self.edit_document(change)
