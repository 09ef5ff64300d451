"""Make some words of a sentence bold."""

from online_env.tasks.kit import plan_steps
from online_env.tasks.kit.documents import (
    TextTask,
    document,
    find_paragraph,
    replace_paragraph,
    text_changes,
)
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
        full_text = "\n".join([text["title"], *text["paragraphs"]]).lower()
        sentence = stream.choice(text["bodies"])
        words = sentence.rstrip(".").split()
        terms = [
            " ".join(words[start : start + 3]).rstrip(",") for start in range(1, len(words) - 3)
        ]
        term = stream.choice([term for term in terms if full_text.count(term.lower()) == 1])
        return {**text, "sentence": sentence, "term": term}

    def initial_document(self):
        return document(self.values.title, self.values.paragraphs)

    def judge(self, after, before):
        bold = (self.values.term,)
        yield from text_changes(after, replace_paragraph(before, self.values.sentence, bold=bold))

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
        other_sentence = next(text for text in self.values.bodies if text != sentence)
        return {
            "the whole sentence": self.with_bold(sentence, sentence),
            "one word of them": self.with_bold(sentence, term.split()[0]),
            "another sentence": self.with_bold(other_sentence, other_sentence),
        }

    def right_result(self, machine):
        self.with_bold(self.values.sentence, self.values.term)(machine)

    def with_bold(self, sentence, term):
        """Return what makes a part of a paragraph bold."""

        def change(document_file):
            paragraph = find_paragraph(document_file, sentence)
            before, _, after = sentence.partition(term)
            paragraph.clear()
            paragraph.add_run(before)
            paragraph.add_run(term).bold = True
            paragraph.add_run(after)

        return self.edit_document(change)
