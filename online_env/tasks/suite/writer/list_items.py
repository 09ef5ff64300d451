"""Make the last lines of a text a list with bullets."""

from dataclasses import replace

from online_env.tasks.kit.documents import TextTask, document, find_paragraph, text_changes
from online_env.tasks.kit.office import find_text, save
from online_env.tasks.kit.sample_reports import report
from online_env.tasks.plan_words import quoted


class ListItems(TextTask):
    """The lines below "Please bring:" become the items of a list."""

    name = "list_items"
    domain = "writer"
    apps = ("libreoffice_writer",)
    phrasings = (
        'Make the {count} lines below "Please bring:" in the open document a bulleted list, and'
        " save it.",
        "The things to bring at the end of {file} should be a list with bullets. Save it as docx.",
        'In this letter, please turn everything after "Please bring:" into bullet points, and'
        " save the letter.",
    )

    def draw(self, stream):
        text = report(stream)
        return {**text, "count": len(text["items"])}

    def made(self):
        return document(self.values.title, self.values.paragraphs)

    def judge(self, now, before):
        wanted = [
            replace(paragraph, marker="bullet" if paragraph.text in self.values.items else "")
            for paragraph in before.paragraphs
        ]
        yield from text_changes(now, replace(before, paragraphs=tuple(wanted)), {"style"})
        for paragraph, was in zip(now.paragraphs, before.paragraphs, strict=False):
            if not paragraph.marker and paragraph.style != was.style:
                yield f"{paragraph.text!r} has the style {paragraph.style}, not {was.style}"

    def oracle(self, hand):
        find_text(hand, self.values.items[0])
        hand.press("home")
        hand.press("ctrl", "shift", "end")
        if hand.see("list-item", app="soffice") is None:
            hand.press("shift", "f12")
        save(hand)

    def plan(self):
        return [
            'window "LibreOffice Writer"',
            "press ctrl+f",
            "wait",
            f"type {quoted(self.values.items[0])}",
            "press enter",
            "press esc",
            "press home",
            "press ctrl+shift+end",
            "press shift+f12",
            "press ctrl+s",
            'click "Use Word 2007-365"',
            "wait",
        ]

    def wrong_results(self):
        items = self.values.items
        return {
            "one is missing": self.styled(items[1:], "List Bullet"),
            "the line above as well": self.styled(["Please bring:", *items], "List Bullet"),
            "with numbers": self.styled(items, "List Number"),
            "only indented": self.styled(items, "List Continue"),
        }

    def right_result(self, machine):
        self.styled(self.values.items, "List Bullet")(machine)

    def styled(self, texts, style):
        """Return what gives paragraphs a style."""

        def change(found):
            for text in texts:
                find_paragraph(found, text).style = found.styles[style]

        return self.edited(change)
