"""Add a sheet with a name after the others, and write in it."""

from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.office import menu, save
from online_env.tasks.kit.sheets import SheetTask, book, changes, enter, show_sheet
from online_env.tasks.kit.word_lists import CITIES, MONTHS, sample
from online_env.tasks.plan_words import quoted


class AddSheet(SheetTask):
    """A workbook with two sheets gets a third one, with a heading in its first cell."""

    name = "add_sheet"
    domain = "calc"
    apps = ("libreoffice_calc",)
    phrasings = (
        'Add a sheet named "{new}" after the last sheet of the open workbook, write "{text}" into'
        " its cell A1, and save.",
        'New sheet at the end, name: {new}. In its A1: "{text}". Save the file; it stays an xlsx.',
        'Please append a sheet called "{new}" to {file}, with "{text}" in the cell A1 and nothing'
        " more, and save the workbook.",
    )

    def draw(self, stream):
        months = sample(stream, MONTHS, 3)
        file = f"rain-{stream.integer(2012, 2025)}.xlsx"
        rows = {
            month: [
                ("City", "Litres"),
                *((city, stream.integer(2, 190)) for city in sample(stream, CITIES, 5)),
            ]
            for month in months[:2]
        }
        text = f"Rain in {months[2]} (litres)"
        path = f"Documents/{file}"
        return {"file": file, "path": path, "rows": rows, "new": months[2], "text": text}

    def made(self):
        return book(self.values.rows)

    def judge(self, now, before):
        new, text = self.values.new, self.values.text
        yield from changes(now, before, {new})
        if now.sheets != (*before.sheets, new):
            yield f"the sheets are {', '.join(now.sheets)}"
            return
        if now.values(new) != {"A1": text}:
            yield f"the sheet {new} holds {now.values(new)!r}"

    def oracle(self, hand):
        if hand.see("page-tab", self.values.new, app="soffice") is None:
            menu(hand, "Sheet", "Insert Sheet at End...")
            hand.find("dialog", "Append Sheet", app="soffice")
            hand.replace(self.values.new)
            hand.press("enter")
            hand.wait_until_gone("dialog", app="soffice")
        show_sheet(hand, self.values.new)
        enter(hand, "A1", self.values.text)
        save(hand)

    def plan(self):
        return [
            plan_steps.CALC,
            'click "Sheet" near "Data"',
            'click "Insert Sheet at End"',
            'wait for "Append Sheet"',
            "press ctrl+a",
            f"type {quoted(self.values.new)}",
            "press enter",
            "wait",
            *plan_steps.enter_in_cell("A1", self.values.text),
            *plan_steps.SAVE_XLSX,
        ]

    def wrong_results(self):
        new, text = self.values.new, self.values.text
        return {
            "at the start": self.with_sheet(new, {"A1": text}, 0),
            "another name": self.with_sheet("Sheet3", {"A1": text}, 2),
            "without the text": self.with_sheet(new, {}, 2),
            "too much in it": self.with_sheet(new, {"A1": text, "A2": "?"}, 2),
        }

    def right_result(self, machine):
        self.with_sheet(self.values.new, {"A1": self.values.text}, 2)(machine)

    def with_sheet(self, name, cells, index):
        """Return what adds a sheet."""

        def change(found):
            sheet = found.create_sheet(name, index)
            for address, value in cells.items():
                sheet[address] = value

        return self.edited(change)
