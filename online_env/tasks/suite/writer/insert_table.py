"""Insert an empty table of a size at the end of a text."""

from dataclasses import replace

from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.documents import TextTask, document, text_changes
from online_env.tasks.kit.office import save
from online_env.tasks.kit.sample_reports import report
from online_env.tasks.plan_words import quoted


class InsertTable(TextTask):
    """Rows and columns are asked for; the head of the table is to be filled in."""

    name = "insert_table"
    domain = "writer"
    apps = ("libreoffice_writer",)
    phrasings = (
        "Insert a table with {columns} columns and {rows} rows at the end of the open document."
        ' Write "{head}" into its first cell, leave the others empty, and save.',
        '{file} needs a table at its end: {rows} rows, {columns} columns, "{head}" in the top left'
        " cell, nothing in the others. Save it as docx.",
        'Please add an empty table ({columns} columns, {rows} rows) below the text, with "{head}"'
        " in the first cell of the first row, and save the document.",
    )

    def draw(self, stream):
        return {
            **report(stream),
            "columns": stream.integer(3, 6),
            "rows": stream.integer(4, 9),
            "head": stream.choice(("Name", "Person", "Who", "Day", "Task", "Guest")),
        }

    def made(self):
        return document(self.values.title, self.values.paragraphs)

    def judge(self, now, before):
        yield from text_changes(now, replace(before, tables=(self.wanted(),)))
        if now.after_table:
            yield f"{now.after_table!r} comes after the table"

    def wanted(self):
        """Return the cells of the table by rows."""
        empty = ("",) * self.values.columns
        first = (self.values.head, *empty[1:])
        return (first, *[empty] * (self.values.rows - 1))

    def oracle(self, hand):
        if hand.see("table", app="soffice") is None:
            hand.press("ctrl", "end")
            hand.press("enter")
            hand.press("ctrl", "f12")
            hand.find("dialog", "Insert Table", app="soffice")
            hand.press("tab")
            hand.replace(str(self.values.columns))
            hand.press("tab")
            hand.replace(str(self.values.rows))
            hand.button("Insert", app="soffice")
            hand.wait_until_gone("dialog", app="soffice")
            hand.type(self.values.head)
        save(hand)

    def plan(self):
        return [
            plan_steps.WRITER,
            "press ctrl+end",
            "press enter",
            "press ctrl+f12",
            'wait for "Insert Table"',
            "press tab",
            "press ctrl+a",
            f"type {quoted(str(self.values.columns))}",
            "press tab",
            "press ctrl+a",
            f"type {quoted(str(self.values.rows))}",
            'click "Insert" near "Cancel"',
            "wait",
            f"type {quoted(self.values.head)}",
            *plan_steps.SAVE_DOCX,
        ]

    def wrong_results(self):
        rows, columns = self.values.rows, self.values.columns
        return {
            "turned": self.put(columns, rows, self.values.head),
            "a row too few": self.put(rows - 1, columns, self.values.head),
            "without a head": self.put(rows, columns, ""),
            "before the text": self.put(rows, columns, self.values.head, first=True),
        }

    def right_result(self, machine):
        self.put(self.values.rows, self.values.columns, self.values.head)(machine)

    def put(self, rows, columns, head, first=False):
        """Return what adds a table."""

        def change(found):
            table = found.add_table(rows, columns)
            table.cell(0, 0).text = head
            if first:
                found.paragraphs[0]._element.addprevious(table._element)

        return self.edited(change)
