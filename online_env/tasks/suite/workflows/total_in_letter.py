"""Read a total in a workbook, and write it into a letter."""

import re

from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.documents import (
    TextTask,
    document,
    find_paragraph,
    replace_paragraph,
    text_changes,
)
from online_env.tasks.kit.office import dump, open_document, replace_all, save
from online_env.tasks.kit.sheets import book, go_to, read_cells
from online_env.tasks.kit.word_lists import FIRST_NAMES, GOODS, LAST_NAMES, MONTHS, sample
from online_env.tasks.plan_words import quoted

BLANK = "[SUM]"


class TotalInLetter(TextTask):
    """The bill is a workbook without a total; the letter has a blank for it."""

    name = "total_in_letter"
    domain = "workflows"
    apps = ("libreoffice_writer", "libreoffice_calc")
    phrasings = (
        "The open letter has the blank [SUM]. Put the total of the column Euros of the workbook"
        " {book}, in Documents, in its place (a whole number), and save the letter. Leave the"
        " workbook as it is.",
        "Add up the Euros in Documents/{book}, write the result (only its digits) instead of [SUM]"
        " into {file}, which is open, and save it. Don't change the workbook.",
        "Please finish this letter: [SUM] should be the sum of all amounts (Euros) in {book}, only"
        " its digits. The workbook lies in Documents, too. Save the letter as docx; do not save the"
        " workbook.",
    )

    def draw(self, stream):
        rows = [
            (article, stream.integer(12, 990))
            for article in sample(stream, GOODS, stream.integer(5, 9))
        ]
        month = stream.choice(MONTHS)
        name = f"{stream.choice(FIRST_NAMES)} {stream.choice(LAST_NAMES)}"
        file = f"letter-{month.lower()}.docx"
        bill = f"bill-{stream.integer(100, 999)}.xlsx"
        return {
            "month": month,
            "file": file,
            "path": f"Documents/{file}",
            "book": bill,
            "bill": f"Documents/{bill}",
            "rows": rows,
            "total": sum(row[1] for row in rows),
            "paragraphs": (
                f"Dear {name},",
                f"The goods that you ordered in {month} have arrived.",
                f"They cost {BLANK} euros in all, to be paid within {stream.integer(10, 40)} days.",
                "With kind regards",
            ),
        }

    def initial_document(self):
        return document(f"Order of {self.values.month}", self.values.paragraphs)

    def prepare(self, machine):
        super().prepare(machine)
        machine.write(
            self.values.bill, dump(book({"Bill": [("Article", "Euros"), *self.values.rows]}))
        )

    def sentence(self, total):
        """Return the sentence with a total."""
        return self.values.paragraphs[2].replace(BLANK, str(total))

    def judge(self, after, before):
        texts = {paragraph.text for paragraph in after.paragraphs}
        total = self.values.total
        forms = (f"{total}", f"{total:,}", f"{total}.00")
        amount_text = next((form for form in forms if self.sentence(form) in texts), forms[0])
        expected = replace_paragraph(
            before, self.values.paragraphs[2], text=self.sentence(amount_text)
        )
        yield from text_changes(after, expected)

    def oracle(self, hand):
        open_document(hand, self.values.bill, "table", "Sheet Bill")
        read_cells(hand, [f"B{len(self.values.rows) + 1}"])
        go_to(hand, f"B2:B{len(self.values.rows) + 1}")
        bar = hand.wait("sum", lambda node: re.search(r"Sum: [1-9]", node.text) is not None)
        total = bar.text.rpartition("Sum: ")[2]  # the status bar adds up what is selected
        hand.press("ctrl", "w")
        hand.find("document-text", app="soffice")
        replace_all(hand, BLANK, total)
        save(hand)

    def plan(self):
        return [
            plan_steps.WRITER,
            *plan_steps.open_in_office(self.values.bill, "Bill"),
            *plan_steps.go_to_cell(f"B2:B{len(self.values.rows) + 1}"),
            f"wait for {quoted(f'Sum: {self.values.total}')}",
            "press ctrl+w",
            plan_steps.WRITER,
            *plan_steps.replace_in_office(BLANK, str(self.values.total)),
            *plan_steps.SAVE_DOCX,
        ]

    def wrong_results(self):
        total, last = self.values.total, self.values.rows[-1][1]
        return {
            "an article is missing": self.put(self.sentence(total - last)),
            "the blank is still there": self.put(self.sentence(f"{BLANK} {total}")),
            "more was written": self.put(f"{self.sentence(total)} Thank you!"),
            "the workbook changed": self.spoilt,
        }

    def right_result(self, machine):
        self.put(self.sentence(f"{self.values.total:,}"))(machine)

    def put(self, text):
        """Return what replaces the sentence with the blank."""

        def change(document_file):
            find_paragraph(document_file, self.values.paragraphs[2]).text = text

        return self.edit_document(change)

    def spoilt(self, machine):
        """Do it rightly, and save a total in the workbook."""
        self.right_result(machine)
        rows = [("Article", "Euros"), *self.values.rows, ("Total", self.values.total)]
        machine.write(self.values.bill, dump(book({"Bill": rows})))
