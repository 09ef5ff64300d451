"""Save a sheet as comma-separated values."""

import csv
import io
import re

from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.office import keep_format
from online_env.tasks.kit.sheets import SheetTask, book, changes
from online_env.tasks.kit.word_lists import CITIES, FIRST_NAMES, LAST_NAMES, TOPICS

HEADER = ("Name", "City", "Members", "Fee")
NUMBER = re.compile(r"[0-9]+(\.[0-9]+)?")


class ExportCsv(SheetTask):
    """A CSV file lies beside the workbook afterwards, with all rows; the workbook stays."""

    name = "export_csv"
    domain = "calc"
    apps = ("libreoffice_calc",)
    added = ("csv",)
    phrasings = (
        "Save the open sheet as a CSV file with commas, as {name}.csv in the folder {folder}. The"
        " workbook itself stays as it is.",
        "I need {file} as CSV (comma-separated): {folder}/{name}.csv, please.",
        "Please export this table as comma-separated values to {name}.csv in my {folder} folder,"
        " without changing the workbook.",
    )

    def draw(self, stream):
        rows = [
            (
                f"{stream.choice(FIRST_NAMES)} {stream.choice(LAST_NAMES)}",
                stream.choice(CITIES),
                stream.integer(1, 90),
                stream.integer(100, 2000) / 100,
            )
            for _ in range(stream.integer(6, 14))
        ]
        file = f"{stream.choice(TOPICS)}-{stream.integer(2012, 2025)}.xlsx"
        name = f"{stream.choice(('members', 'groups', 'list'))}-{stream.integer(10, 99)}"
        folder = stream.choice(("Documents", "Downloads", "Desktop"))
        return {
            "file": file,
            "path": f"Documents/{file}",
            "name": name,
            "folder": folder,
            "csv": f"{folder}/{name}.csv",
            "rows": rows,
        }

    def made(self):
        return book({"Groups": [HEADER, *self.values.rows]})

    def judge(self, now, before):
        yield from changes(now, before)

    def problems(self, machine):
        yield from super().problems(machine)
        text = machine.text(self.values.csv)
        if text is None:
            yield f"there is no file {self.values.csv}"
            return
        found = list(csv.reader(text.splitlines()))  # which also reads what is no text
        wanted = [list(map(str, row)) for row in (HEADER, *self.values.rows)]
        if [plain(row) for row in found if row] != [plain(row) for row in wanted]:
            yield f"{self.values.csv} begins with {text[:200]!r}"

    def oracle(self, hand):
        hand.press("ctrl", "shift", "s")
        hand.choose_file(self.values.csv, "Save", app="soffice")
        overwrite(hand)
        keep_format(hand)
        hand.find("dialog", "Export Text File", app="soffice")
        hand.button("OK", app="soffice")
        hand.wait_until_gone("dialog", app="soffice")
        hand.find("frame", f"{self.values.name}.csv - LibreOffice Calc", app="soffice")

    def plan(self):
        return [
            plan_steps.CALC,
            "press ctrl+shift+s",
            *plan_steps.name_file(self.values.csv),
            'click "Use Text CSV"',
            'wait for "Export Text File"',
            'click "OK"',
            "wait",
        ]

    def wrong_results(self):
        return {
            "with semicolons": lambda m: m.write(self.values.csv, self.lines(";")),
            "a row is missing": lambda m: m.write(self.values.csv, self.lines(",", 1)),
            "the workbook itself": lambda m: m.run("cp", self.values.path, self.values.csv),
            "under another name": lambda m: m.write(f"{self.values.csv}.xlsx", self.lines(",")),
            "the workbook changed": self.spoilt,
        }

    def right_result(self, machine):
        machine.write(self.values.csv, self.lines(",", quoted=True))

    def spoilt(self, machine):
        """Export rightly, and change a cell of the workbook."""
        self.right_result(machine)
        self.put({"A2": "Nobody"})(machine)

    def lines(self, comma, less=0, quoted=False):
        """Return the text of the file."""
        text = io.StringIO()
        rows = [HEADER, *self.values.rows]
        quoting = csv.QUOTE_ALL if quoted else csv.QUOTE_MINIMAL
        csv.writer(text, delimiter=comma, quoting=quoting).writerows(rows[: len(rows) - less])
        return text.getvalue()


def plain(row):
    """Return a row with its numbers in one form."""
    return [f"{float(text):g}" if NUMBER.fullmatch(text) else text for text in row]


def overwrite(hand):
    """Agree to write over a file that an earlier try has left."""
    if hand.see("alert", app="soffice") and hand.see("push-button", "Replace", app="soffice"):
        hand.button("Replace", app="soffice")
