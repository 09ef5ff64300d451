"""Make some words of a sentence bold."""

from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.documents import TextTask, changed, document, find_paragraph, text_changes
from online_env.tasks.kit.office import find_text, save
from online_env.tasks.kit.sample_reports import report


class BoldTerm(TextTask):
    """A few words in the middle of a paragraph become bold; the rest of it stays."""

    name = "bold_term"
    domain = "writer"
    apps = ("libreoffice_writer",)
    phrasings = (
        'Make the words "{term}" bold in the open document, only those, and save it.',
        'Put "{term}" in bold. Nothing else. Save.',
        'So that nobody overlooks it, please set the words "{term}" in bold type and save the'
        " document as docx.",
    )

    def draw(self, stream):
        text = report(stream)
        whole = "\n".join([text["title"], *text["paragraphs"]]).lower()
        sentence = stream.choice(text["bodies"])
        words = sentence.rstrip(".").split()
        terms = [
            " ".join(words[start : start + 3]).rstrip(",") for start in range(1, len(words) - 3)
        ]
        term = stream.choice([term for term in terms if whole.count(term.lower()) == 1])
        return {**text, "sentence": sentence, "term": term}

    def made(self):
        return document(self.values.title, self.values.paragraphs)

    def judge(self, now, before):
        bold = (self.values.term,)
        yield from text_changes(now, changed(before, self.values.sentence, bold=bold))

    def oracle(self, hand):
        find_text(hand, self.values.term)
        if hand.see("toggle-button", "Bold", app="soffice", state="checked") is None:
            hand.press("ctrl", "b")
        hand.find("toggle-button", "Bold", app="soffice", state="checked")
        save(hand)

    def plan(self):
        return [
            plan_steps.WRITER,
            *plan_steps.find_in_writer(self.values.term),
            "press ctrl+b",
            *plan_steps.SAVE_DOCX,
        ]

    def wrong_results(self):
        sentence, term = self.values.sentence, self.values.term
        other = next(text for text in self.values.bodies if text != sentence)
        return {
            "the whole sentence": self.marked(sentence, sentence),
            "one word of them": self.marked(sentence, term.split()[0]),
            "another sentence": self.marked(other, other),
        }

    def right_result(self, machine):
        self.marked(self.values.sentence, self.values.term)(machine)

    def marked(self, sentence, term):
        """Return what makes a part of a paragraph bold."""

        def change(found):
            paragraph = find_paragraph(found, sentence)
            before, _, after = sentence.partition(term)
            paragraph.clear()
            paragraph.add_run(before)
            paragraph.add_run(term).bold = True
            paragraph.add_run(after)

        return self.edited(change)
