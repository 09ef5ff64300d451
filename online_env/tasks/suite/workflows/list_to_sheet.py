"""Copy the lines of a text file into a sheet."""

from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.office import save, straighten_quotes
from online_env.tasks.kit.sheets import SheetTask, book, changes, go_to
from online_env.tasks.kit.word_lists import FIRST_NAMES, GOODS, LAST_NAMES, sample


class ListToSheet(SheetTask):
    """Names and what they bring stand in a note; they belong into two columns."""

    name = "list_to_sheet"
    domain = "workflows"
    apps = ("libreoffice_calc", "mousepad")
    phrasings = (
        "Enter the people of the note {note}, in Documents, into the open workbook: one row a"
        " line, in the same order, with the name under Name and the thing under Brings. Save the"
        " workbook.",
        "Documents/{note} says who brings what. Copy that into the two columns of {file}, which is"
        " open, line by line, and save as xlsx.",
        "Please transfer the list in {note} (a text file in Documents) to this sheet: names into"
        " the first column, things into the second, in the order of the note. Then save it.",
    )

    def draw(self, stream):
        count = stream.integer(4, 7)
        rows = [
            (f"{first} {stream.choice(LAST_NAMES)}", item)
            for first, item in zip(
                sample(stream, FIRST_NAMES, count), sample(stream, GOODS, count), strict=True
            )
        ]
        event = stream.choice(("picnic", "camp", "party", "fair"))
        return {
            "file": f"{event}.xlsx",
            "path": f"Documents/{event}.xlsx",
            "note": f"{event}.txt",
            "text": f"Documents/{event}.txt",
            "rows": rows,
        }

    def initial_document(self):
        return book({"Sheet1": [("Name", "Brings")]})

    def prepare(self, machine):
        super().prepare(machine)
        lines = [f"{name}: {item}" for name, item in self.values.rows]
        machine.write(self.values.text, "\n".join(lines) + "\n")

    def judge(self, after, before):
        cells = self.cells()
        yield from changes(after, before, set(cells))
        for address, text in cells.items():
            actual = straighten_quotes(str(after.value(address))).strip()
            if actual.casefold() != text.casefold():
                yield f"{address} is {actual!r}, not {text!r}"

    def cells(self):
        """Return the entries by address."""
        entries = {}
        for number, (name, item) in enumerate(self.values.rows, 2):
            entries[f"A{number}"] = name
            entries[f"B{number}"] = item
        return entries

    def oracle(self, hand):
        if hand.see("text", app="mousepad") is None:
            hand.press("alt", "f2")
            hand.find(("entry", "text"), app="appfinder", state="focused")
            hand.replace(f"mousepad {hand.path(self.values.text)}\n")
        note = hand.find("text", app="mousepad").text
        hand.press("ctrl", "q")
        hand.wait_until_gone("frame", app="mousepad")
        for number, line in enumerate(note.splitlines(), 2):
            name, _, item = line.partition(": ")
            go_to(hand, f"A{number}")
            hand.type(f"{name}\t{item}\n")
        save(hand)

    def plan(self):
        steps = [plan_steps.CALC]
        for number, (name, item) in enumerate(self.values.rows, 2):
            steps += plan_steps.enter_in_cell(f"A{number}", name)
            steps += plan_steps.enter_in_cell(f"B{number}", item)
        return [*steps, *plan_steps.SAVE_XLSX]

    def wrong_results(self):
        cells = self.cells()
        last = f"B{len(self.values.rows) + 1}"
        turned = {f"{'B' if a[0] == 'A' else 'A'}{a[1:]}": text for a, text in cells.items()}
        return {
            "a thing is missing": self.put({a: text for a, text in cells.items() if a != last}),
            "the columns turned": self.put(turned),
            "whole lines in one column": self.put(
                {f"A{n}": f"{a}: {b}" for n, (a, b) in enumerate(self.values.rows, 2)}
            ),
            "the header gone": self.put({**cells, "A1": None}),
        }

    def right_result(self, machine):
        self.put({address: f"{text} " for address, text in self.cells().items()})(machine)
