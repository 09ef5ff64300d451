"""Put a text at the top of all pages."""

from dataclasses import replace

from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.documents import TextTask, document, text_changes
from online_env.tasks.kit.office import menu, save
from online_env.tasks.kit.sample_reports import report
from online_env.tasks.kit.word_lists import GOODS
from online_env.tasks.plan_words import quoted

CLUBS = ("Rowing Club", "Hill Walkers", "Library Friends", "Repair Circle", "Choir")


class WriteHeader(TextTask):
    """The header, or the footer, is switched on and gets a text."""

    name = "write_header"
    domain = "writer"
    apps = ("libreoffice_writer",)
    phrasings = (
        'Add a page {kind} with the text "{text}" to the open document and save it.',
        'Every page of {file} should have "{text}" as its {kind}. Save it as docx.',
        'Please put the words "{text}" into the {kind} of the pages of this letter, and save.',
    )

    def draw(self, stream):
        text = f"{stream.choice(CLUBS)}, {stream.choice(GOODS)} no. {stream.integer(100, 999)}"
        return {**report(stream), "kind": stream.choice(("header", "footer")), "text": text}

    def made(self):
        return document(self.values.title, self.values.paragraphs)

    def judge(self, now, before):
        wanted = replace(before, **{f"{self.values.kind}s": (self.values.text,)})
        yield from text_changes(now, wanted)

    def oracle(self, hand):
        kind = self.values.kind.capitalize()
        shown = any(node.text == self.values.text for node in hand.look())
        if not shown:
            menu(hand, "Insert", "Header and Footer", kind, "Default Page Style")
            hand.type(self.values.text)
        save(hand)

    def plan(self):
        return [
            plan_steps.WRITER,
            'click "Insert"',
            'click "Header and Footer"',
            f"click {quoted(self.values.kind.capitalize())}",
            'click "Default Page Style"',
            "wait",
            f"type {quoted(self.values.text)}",
            *plan_steps.SAVE_DOCX,
        ]

    def wrong_results(self):
        kind, text = self.values.kind, self.values.text
        other = "footer" if kind == "header" else "header"
        return {
            "at the other end": self.put({other: text}),
            "at both ends": self.put({"header": text, "footer": text}),
            "half of it": self.put({kind: text.partition(",")[0]}),
            "in the text": self.edited(lambda found: found.add_paragraph(text)),
        }

    def right_result(self, machine):
        self.put({self.values.kind: f"{self.values.text}\n"})(machine)

    def put(self, texts):
        """Return what writes at the ends of the pages: texts by `header` or `footer`."""

        def change(found):
            for kind, text in texts.items():
                getattr(found.sections[0], kind).paragraphs[0].text = text

        return self.edited(change)
